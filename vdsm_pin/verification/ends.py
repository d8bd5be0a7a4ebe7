"""Where a motion begins and ends, against the start and the goal of the problem."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.records import Check, Verdict


def check_ends(
    problem: PlanningProblem, trajectory: Trajectory, tips: FloatArray
) -> tuple[Check, ...]:
    """The first row at the start, the last one at the goal.

    Args:
        problem: With start and goal, where it states them, and how far the tip may be
            off.
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
        if posture is None:
            continue
        gap = float(np.linalg.norm(tips[row] - posture.tip))
        checks.append(_check(problem, f"tip at its {end}", gap, row))
        if posture.joints is not None:
            ways = _ways(problem, posture.joints, trajectory.part(row, row + 1))
            name = f"joints at their {end}"
            checks.append(_check(problem, name, float(ways.max()), row, ways.size))
    return tuple(checks)


def _ways(problem: PlanningProblem, joints: FloatArray, row: Trajectory) -> FloatArray:
    """How far each joint value is off, as the way that it may move the tip; [m]."""
    levers = np.full(joints.size, problem.manipulator.total_length)
    levers[0] = 1.0
    return np.asarray(levers * np.abs(row.joints[0] - joints))


def _check(
    problem: PlanningProblem, name: str, off: float, row: int, count: int = 1
) -> Check:
    kept = off + TOLERANCES.arithmetic <= problem.tip_tolerance
    return Check(
        name=name,
        verdict=Verdict.CERTIFIED if kept else Verdict.REFUTED,
        count=count,
        worst=off,
        limit=problem.tip_tolerance,
        unit="m",
        moment=row,
    )
