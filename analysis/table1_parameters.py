"""Table 1: the D-H parameters of the arm, with the ratios of Eq. 5.

python analysis/table1_parameters.py
"""

from paper_figures.style import subscript

from vdsm_pin.manipulator import Manipulator, built_in
from vdsm_pin.units import MM_PER_M


def rows(arm: Manipulator) -> list[tuple[str, str, str, str, str]]:
    """Rows (a_i, theta_i, alpha_i, d_i, k_{i,N+1}) from the rail to the tip."""
    found = [("x₀", "0", "0", "0", "")]
    for i in range(1, arm.n_links + 2):
        a = "0"
        if i > 1:
            length = arm.link_lengths[i - 2] * MM_PER_M
            a = f"L{subscript(i - 1)} = {length:.0f}"
        tip = i == arm.n_links + 1
        angles = ("0", "0") if tip else (f"θ{subscript(i)}", f"α{subscript(i)}")
        found.append((a, *angles, "0", f"{arm.ratios[i - 1]:.3f}"))
    return found


def markdown(arm: Manipulator) -> str:
    """The table for reading."""
    last = subscript(arm.n_links + 1)
    lines = [
        f"| a [mm] | θ | α | d [mm] | kᵢ,{last} |",
        "|---|---|---|---|---|",
        *("| " + " | ".join(row) + " |" for row in rows(arm)),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(markdown(built_in("hrm8")))
