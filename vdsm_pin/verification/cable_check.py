"""Cables there and back: the planned lengths must give the planned angles."""

from typing import Final

import numpy as np

from vdsm_pin.arm.cables import angles_from_cables, cable_lengths
from vdsm_pin.errors import InconsistentCables
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.records import Check, Verdict

CHUNK: Final = 8192
"""Rows held in memory at a time."""


NAME: Final = "angles recovered from the cable lengths"
"""Name of the row."""


def check_cables(
    problem: PlanningProblem, trajectory: Trajectory, deadline: Deadline = NO_LIMIT
) -> Check:
    """Turn every row into cable lengths and these into angles again.

    Args:
        problem: Names the arm and its cable holes.
        trajectory: What is judged.
        deadline: When to give up.

    Returns:
        The largest difference of an angle, in radians. Where the angles leave the
        domain in which lengths determine them, the motion cannot be driven by these
        cables: refuted.

    Raises:
        OutOfTime: If the time is over.
    """
    worst, where, moment = -np.inf, "", float("nan")
    for first in range(0, trajectory.n_samples, CHUNK):
        deadline.check()
        rows = slice(first, first + CHUNK)
        planned = np.stack([trajectory.alpha[rows], trajectory.theta[rows]])
        lengths = cable_lengths(problem.manipulator, *planned)
        try:
            found = np.stack(angles_from_cables(problem.manipulator, lengths))
        except InconsistentCables as error:
            worst = float("inf")
            where, moment = f"joint {error.link}", float(first + error.waypoint)
            break
        residual = np.abs(found - planned)
        residual[np.isnan(residual)] = np.inf
        kind, row, joint = np.unravel_index(int(np.argmax(residual)), residual.shape)
        if residual[kind, row, joint] > worst:
            worst = float(residual[kind, row, joint])
            where = f"{('alpha', 'theta')[kind]}{joint + 1}"
            moment = float(first + row)
    limit = TOLERANCES.cable_round_trip
    return Check(
        name=NAME,
        verdict=Verdict.CERTIFIED if worst <= limit else Verdict.REFUTED,
        count=trajectory.alpha.size + trajectory.theta.size,
        worst=worst,
        limit=limit,
        unit="rad",
        where=where,
        moment=moment,
    )
