"""Where a motion begins and ends, against the start and the goal of the problem."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem import PlanningProblem, Posture
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.records import Check, Verdict


def check_ends(
    problem: PlanningProblem, trajectory: Trajectory, tips: FloatArray
) -> tuple[Check, ...]:
    """The first row at the start, the last one at the goal.

    Args:
        problem: With start and goal, where it states them.
        trajectory: What is judged.
        tips: The tip at every row, shape (n_samples, 3); [m].

    Returns:
        A row for the tip and one for the joints, of what is stated.
    """
    checks: list[Check] = []
    for posture, row, end in (
        (problem.begin, 0, "start"),
        (problem.goal, trajectory.n_samples - 1, "goal"),
    ):
        if posture is not None:
            checks.append(_tip_check(posture, tips[row], row, end))
            checks += _joint_checks(posture, trajectory, row, end)
    return tuple(checks)


def _tip_check(posture: Posture, tip: FloatArray, row: int, end: str) -> Check:
    gap = float(np.linalg.norm(tip - posture.tip))
    kept = gap <= TOLERANCES.tip_on_path
    return Check(
        name=f"tip at its {end}",
        verdict=Verdict.CERTIFIED if kept else Verdict.REFUTED,
        count=1,
        worst=gap,
        limit=TOLERANCES.tip_on_path,
        unit="m",
        moment=row,
    )


def _joint_checks(
    posture: Posture, trajectory: Trajectory, row: int, end: str
) -> tuple[Check, ...]:
    if posture.joints is None:
        return ()
    off = np.abs(trajectory.part(row, row + 1).joints[0] - posture.joints)
    worst = float(off.max())
    kept = worst <= TOLERANCES.start_joints
    return (
        Check(
            name=f"joints at their {end}",
            verdict=Verdict.CERTIFIED if kept else Verdict.REFUTED,
            count=posture.joints.size,
            worst=worst,
            limit=TOLERANCES.start_joints,
            unit="-",
            moment=row,
        ),
    )
