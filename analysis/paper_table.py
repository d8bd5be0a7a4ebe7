"""The paper's numbers beside ours: certified plans of the strategy `paper`.

    python analysis/paper_table.py --out reports/paper

Writes `table.json` and `table.md`. "Paper says" is quoted from the text, with its
section; "we get" comes from the certified plan and its verification.
"""

import math
from dataclasses import astuple, dataclass, replace
from typing import Final

import numpy as np
from result_files import output_folder, table_lines, write_table

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.feasibility import curled_reach, straight_reach
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import Refinement, plan_and_verify
from vdsm_pin.report.words import at_least
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M, quantity
from vdsm_pin.verification.robust import largest_joint_error

SCENES: Final = ("free", "obs1", "obs2", "obs2-small", "obs3")


@dataclass(frozen=True)
class Row:
    """One number or statement of the paper and ours.

    Args:
        scene: The environment.
        quantity: What is compared, with its unit.
        paper: What the paper says, and where.
        ours: What we get.
    """

    scene: str
    quantity: str
    paper: str
    ours: str


PAPER: Final = {
    ("free", "psi"): "32 (6.2.3)",
    ("obs1", "psi"): "39 (6.2.3)",
    ("obs2", "psi"): "42 (6.2.3)",
    ("obs2-small", "psi"): "42 (6.2.3)",
    ("obs3", "psi"): "30 (6.2.3)",
    ("free", "x0 min"): "-98 (6.2.3)",
    ("obs1", "x0 min"): "-98 (6.2.3)",
    ("obs3", "x0 min"): "-98 (6.2.3)",
    ("free", "x0 max"): "465 (6.2.3)",
    ("obs1", "x0 max"): "one of 465, 538, 591 (6.2.3)",
    ("obs3", "x0 max"): "one of 465, 538, 591 (6.2.3)",
    ("obs1", "clearance"): "axis above 265 from the axis, so 3.5 at waypoints (6.3)",
    ("obs2", "clearance"): "axis above 265 from the axis (6.3)",
    ("obs2-small", "clearance"): "axis above 265 from the axis (6.3)",
    ("obs3", "clearance"): "axis above 265 from the axis, so 3.5 at waypoints (6.3)",
    ("free", "changed"): "psi1 (6.2.1)",
    ("obs1", "changed"): "psi1, psi4..psi8; psi2 = psi3 = 0 always (6.2.3)",
    ("obs2", "changed"): "psi1..psi8 (6.2.3)",
    ("obs2-small", "changed"): "psi1..psi8 (6.2.3)",
    ("obs3", "changed"): "psi1, psi4..psi6 (6.2.3)",
    ("obs1", "A4"): "psi7, psi8 besides psi1 (6.2.2)",
    ("obs1", "A5"): "psi4..psi8 besides psi1 (6.2.1)",
    ("obs1", "A6"): "psi1, psi4, psi5, psi6 (6.2.1)",
    ("obs1", "stretch"): "A3 to A7 (6.2.2)",
    ("obs2", "stretch"): "B1 to B4 and B6 to B10 (6.2.2)",
    ("obs2-small", "stretch"): "B1 to B4 and B6 to B10 (6.2.2)",
    ("obs3", "stretch"): "A2 to A7 (6.2.2)",
    ("obs1", "order"): "psi8, psi7, .. psi4 near A5 (6.2.2)",
    ("obs1", "ended"): "psi8, psi7, at last psi4..psi6 (6.2.2)",
    ("obs2", "ended"): "psi8..psi2 separately (6.2.2)",
    ("obs2-small", "ended"): "psi8..psi2 separately (6.2.2)",
    ("obs2", "order"): "psi2..psi8 slightly all at once, then separately (6.2.2)",
    ("obs2-small", "order"): "psi2..psi8 slightly all at once, then separately (6.2.2)",
    ("obs3", "order"): "psi4..psi6, psi4 and psi6 never together (6.2.2)",
    ("obs3", "joint"): "within 35 (7)",
    ("obs1", "error"): "mostly within 0.3, up to about 4 (7)",
    ("obs3", "error"): "mostly within 0.3, up to about 4 (7)",
}
"""What the paper says; a dash stands for nothing."""

ENLARGED: Final = {"obs1": -1}
"""Which of the stretches with more than psi1 Fig. 15 shows: the first if not here."""


def changed(psi: FloatArray) -> str:
    """The link angles above the threshold, in words; psi of shape (n, N); [rad]."""
    joints = np.flatnonzero(psi.max(axis=0) > TOLERANCES.changed_angle) + 1
    return ", ".join(f"psi{joint}" for joint in joints)


def moments(trajectory: Trajectory, tip: FloatArray) -> dict[str, int]:
    """Waypoints A4 and A5 (leaving and rejoining the path) and A6 (the far corner)."""
    on = trajectory.on_path
    left = np.flatnonzero(on[:-1] & ~on[1:])
    joined = np.flatnonzero(~on[:-1] & on[1:]) + 1
    corner = np.where(on, tip[:, 1] + tip[:, 2], -np.inf)
    return {"A4": int(left[0]), "A5": int(joined[1]), "A6": int(np.argmax(corner))}


def stretch(result: Refinement) -> str:
    """Where on the path more than psi1 is changed, from first to last row, y and z."""
    trajectory = result.plan.trajectory
    bent = link_angles(trajectory.alpha, trajectory.theta)[:, 1:].max(axis=1)
    rows = np.flatnonzero(trajectory.on_path & (bent > TOLERANCES.changed_angle))
    if not len(rows):
        return "nowhere"
    ends = result.plan.tip_path.points[rows[[0, -1]], 1:] * MM_PER_M
    return " to ".join(f"({y:.0f}, {z:.0f})" for y, z in ends)


def stretches(psi: FloatArray) -> list[slice]:
    """Rows between which psi2..psiN are not all zero; psi of shape (n, N); [rad]."""
    bent = (psi[:, 1:] > TOLERANCES.changed_angle).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], bent.astype(int), [0]])))
    return [slice(a, b) for a, b in edges.reshape(-1, 2).tolist()]


def order(psi: FloatArray) -> str:
    """The link angles in the order in which they first change, but for psi1.

    Args:
        psi: Rows in the order to look at, shape (n, N); [rad].
    """
    bent = psi[:, 1:] > TOLERANCES.changed_angle
    first = np.where(bent.any(axis=0), np.argmax(bent, axis=0), -1)
    together = [
        np.flatnonzero(first == row) + 2 for row in np.unique(first[first >= 0])
    ]
    names = [" with ".join(f"psi{joint}" for joint in joints) for joints in together]
    return ", ".join(names)


def orders(scene: str, psi: FloatArray) -> tuple[str, str]:
    """In which order link angles begin and end where Fig. 15 enlarges the scene."""
    found = stretches(psi)
    if not found:
        return "psi1 alone", "psi1 alone"
    rows = psi[found[ENLARGED.get(scene, 0)]]
    ended = order(rows[::-1]).split(", ")
    return order(rows), ", ".join(reversed(ended))


def touching_error(result: Refinement) -> float:
    """The largest joint error for which no contact is proved; [rad]."""
    problem = replace(result.plan.problem, required_clearance=0.0)
    trajectory, errors = result.plan.trajectory, result.verification.errors
    return largest_joint_error(problem, trajectory, errors)


def rows_of(scene: str, result: Refinement) -> list[Row]:
    """Every row of one scene."""
    trajectory, verification = result.plan.trajectory, result.verification
    psi = link_angles(trajectory.alpha, trajectory.theta)
    steps = np.abs(np.diff(trajectory.joints[:, 1:], axis=0))
    begun, ended = orders(scene, psi)
    ours = {
        "psi": ("largest psi [deg]", f"{np.rad2deg(psi.max()):.2f}"),
        "changed": ("link angles that change", changed(psi)),
        "order": ("link angles in the order in which they begin in Fig. 15", begun),
        "ended": (
            "link angles in the order in which they return to zero in Fig. 15",
            ended,
        ),
        "stretch": (
            "more than psi1 is changed, on the path (y, z) [mm]",
            stretch(result),
        ),
        "joint": (
            "largest joint angle [deg]",
            f"{np.rad2deg(np.abs(trajectory.joints[:, 1:]).max()):.2f}",
        ),
        "x0 min": ("x0 min [mm]", f"{trajectory.x0.min() * MM_PER_M:.1f}"),
        "x0 max": ("x0 max [mm]", f"{trajectory.x0.max() * MM_PER_M:.1f}"),
        "step": (
            "largest change between waypoints [deg]",
            f"{np.rad2deg(steps.max()):.2f}",
        ),
        "coverage": (
            "coverage of the desired path [%]",
            f"{verification.coverage * 100.0:.2f}",
        ),
    }
    if result.plan.problem.scene.obstacles:
        ours["clearance"] = (
            "smallest proved clearance [mm]",
            at_least(verification.min_clearance).removesuffix(" mm"),
        )
        error = quantity(touching_error(result), "rad", math.floor)
        ours["error"] = (
            "largest joint error proved without contact [deg]",
            error.removesuffix("°"),
        )
    if scene == "obs1":
        for name, row in moments(trajectory, result.plan.tip_path.points).items():
            ours[name] = (
                f"link angles not zero at {name}",
                changed(psi[row : row + 1]),
            )
    return [
        Row(scene, name, PAPER.get((scene, key), "-"), value)
        for key, (name, value) in ours.items()
    ]


def reach_rows() -> list[Row]:
    """Step 1: the reach by Eq. 4, and what the straight arm reaches."""
    arm = built_in("hrm8")
    return [
        Row(
            "-",
            "reach with every joint at its limit, Eq. 4 [mm]",
            "2966 (3.2)",
            f"{curled_reach(arm) * MM_PER_M:.2f}",
        ),
        Row(
            "-",
            "reach of the straight arm within psi1 [mm]",
            "-",
            f"{straight_reach(arm) * MM_PER_M:.2f}",
        ),
    ]


def table() -> list[Row]:
    """All rows."""
    rows = reach_rows()
    for scene in SCENES:
        problem = read_problem(f"paper/{scene}")
        rows += rows_of(scene, plan_and_verify(problem, "paper"))
    return rows


def markdown(rows: list[Row]) -> str:
    """The table for reading."""
    lines = [
        "# The paper's numbers and ours",
        "",
        "Plans of the strategy `paper` at 10 mm spacing, certified; made by",
        "`python analysis/paper_table.py --out reports/paper`. Section numbers are the",
        "paper's; the reasons for differences are in `docs/paper.md`.",
        "",
    ]
    head = "scene", "quantity", "paper says", "we get"
    return "\n".join([*lines, *table_lines(head, map(astuple, rows)), ""])


def main() -> None:
    """Write both files and print the table."""
    folder = output_folder(__doc__)
    rows = table()
    write_table(folder, "table", rows, markdown(rows))


if __name__ == "__main__":
    main()
