"""Cables there and back: the planned lengths must give the planned angles."""

import numpy as np

from vdsm_pin.cables import angles_from_cables, cable_lengths
from vdsm_pin.errors import InconsistentCables
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.records import Check, Verdict


def check_cables(problem: PlanningProblem, trajectory: Trajectory) -> Check:
    """Turn every row into cable lengths and these into angles again.

    Args:
        problem: Names the arm and its cable holes.
        trajectory: What is judged.

    Returns:
        The largest difference of an angle, in radians. Where the angles leave the
        domain in which lengths determine them, the motion cannot be driven by these
        cables: refuted.
    """
    limit = TOLERANCES.cable_round_trip
    planned = np.stack([trajectory.alpha, trajectory.theta])
    lengths = cable_lengths(problem.manipulator, *planned)
    try:
        found = np.stack(angles_from_cables(problem.manipulator, lengths))
    except InconsistentCables as error:
        worst, where = float("inf"), f"waypoint {error.sample}, joint {error.link}"
    else:
        residual = np.abs(found - planned)
        angle, row, joint = np.unravel_index(int(np.argmax(residual)), residual.shape)
        worst = float(residual[angle, row, joint])
        where = f"waypoint {row}, {('alpha', 'theta')[angle]}{joint + 1}"
    return Check(
        name="angles recovered from the cable lengths",
        verdict=Verdict.CERTIFIED if worst <= limit else Verdict.REFUTED,
        count=planned.size,
        worst=worst,
        limit=limit,
        unit="rad",
        where=where,
    )
