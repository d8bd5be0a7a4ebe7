"""Table 1: the D-H parameters of the arm, and the 16 frames that it stands for.

    python analysis/table1_parameters.py

The paper turns 16 traditional D-H frames (its Fig. 1, first row) into 8 frames with two
angles each (middle row, Table 1). It prints the second table only.
"""

from dataclasses import dataclass

import numpy as np
from paper_figures.style import subscript
from result_files import table_lines

from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.units import MM_PER_M

QUARTER = np.pi / 2.0


@dataclass(frozen=True)
class TraditionalRow:
    """One row of the traditional table: Rot(z, angle) Trans(x, a) Rot(x, twist).

    Every d is 0.

    Args:
        angle: Name and number of the joint variable, as ("α", 3).
        a: Length along x; [m].
        twist: About x; [rad].
    """

    angle: tuple[str, int]
    a: float
    twist: float


def traditional(arm: Manipulator) -> tuple[TraditionalRow, ...]:
    """The 2N rows: each universal joint is a yaw α and a pitch θ with a = 0 between.

    Ry(θ) = Rot(x, -90°) Rot(z, θ) Rot(x, 90°), so twists of -90° and 90° take turns.
    """
    rows = []
    for i, length in enumerate(arm.link_lengths.tolist(), start=1):
        rows += [
            TraditionalRow(("α", i), 0.0, -QUARTER),
            TraditionalRow(("θ", i), length, QUARTER),
        ]
    return tuple(rows)


def by_traditional(
    arm: Manipulator, x0: float, alpha: FloatArray, theta: FloatArray
) -> FloatArray:
    """Joint centres O_1..O_{N+1} by the 16 frames, shape (N + 1, 3); [m].

    Args:
        arm: The arm.
        x0: Base position; [m].
        alpha: Yaw angles, shape (N,); [rad].
        theta: Pitch angles, shape (N,); [rad].
    """
    values = {"α": alpha, "θ": theta}
    pose, centres = np.eye(4), []
    pose[0, 3] = x0
    for row in traditional(arm):
        name, number = row.angle
        if name == "α":
            centres.append(pose[:3, 3])
        turn = values[name][number - 1]
        pose = pose @ _turned(2, turn) @ _moved(row.a) @ _turned(0, row.twist)
    return np.array([*centres, pose[:3, 3]])


def by_table_1(
    arm: Manipulator, x0: float, alpha: FloatArray, theta: FloatArray
) -> FloatArray:
    """The same by Table 1 and the product before Eq. 1's printed matrix."""
    lengths = [0.0, *arm.link_lengths.tolist()]
    angles = [*zip(alpha.tolist(), theta.tolist(), strict=True), (0.0, 0.0)]
    pose, centres = _moved(x0), []
    for a, (yaw, pitch) in zip(lengths, angles, strict=True):
        pose = pose @ _moved(a) @ _turned(2, yaw) @ _turned(1, pitch)
        centres.append(pose[:3, 3])
    return np.array(centres)


def printed_matrix(a: float, alpha: float, theta: float) -> FloatArray:
    """Eq. 1's product as the paper prints it, which is not the product."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ca * ca, -sa, ca * sa, a],
            [sa * ca, ca, sa * sa, 0.0],
            [-st, 0.0, ct, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _moved(a: float) -> FloatArray:
    pose = np.eye(4)
    pose[0, 3] = a
    return pose


def _turned(axis: int, angle: float) -> FloatArray:
    """A right-handed turn about x, y or z."""
    pose, (i, j) = np.eye(4), [(1, 2), (2, 0), (0, 1)][axis]
    pose[[i, j], [i, j]] = np.cos(angle)
    pose[j, i], pose[i, j] = np.sin(angle), -np.sin(angle)
    return pose


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
    """Table 1 for reading."""
    last = subscript(arm.n_links + 1)
    head = "a [mm]", "θ", "α", "d [mm]", f"kᵢ,{last}"
    return "\n".join([*table_lines(head, rows(arm)), ""])


def traditional_markdown(arm: Manipulator) -> str:
    """The table of the 16 frames for reading."""
    head = "frame", "angle about z", "d [mm]", "a [mm]", "twist about x [°]"
    cells = []
    for k, row in enumerate(traditional(arm), start=1):
        name, number = row.angle
        angle, twist = f"{name}{subscript(number)}", np.rad2deg(row.twist)
        turned = f"{twist:+.0f}".replace("-", "−")
        cells.append((k, angle, 0, f"{row.a * MM_PER_M:.0f}", turned))
    return "\n".join([*table_lines(head, cells), ""])


if __name__ == "__main__":
    print(markdown(built_in("hrm8")))
    print(traditional_markdown(built_in("hrm8")))
