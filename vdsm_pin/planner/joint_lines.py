"""Straight lines in joint space, looked at for clearance as closely as it takes."""

from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import row_centres
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem

FEWEST: Final = 16
"""Intervals a straight line is begun to be looked at with."""
MOST: Final = 2048
"""Intervals at which a line that is not known to be clear is given up."""


def clear_line(
    problem: PlanningProblem,
    clearance: LinkClearance,
    begin: FloatArray,
    end: FloatArray,
    need: float,
) -> FloatArray | None:
    """Rows from begin to end if every place in between is clear; limits are not asked.

    Args:
        problem: Arm and largest change per row.
        clearance: Clearance of links at given joint centres.
        begin: Joint values q = (x0, alpha1, theta1, ..), shape (1 + 2N,); [m], [rad].
        end: The same at the end.
        need: Clearance to keep; [m].

    Returns:
        Shape (r, 1 + 2N), both ends included; None where a place is not clear, or is
        not known to be.
    """
    arm, turn = problem.manipulator, np.abs(end - begin)
    # No point is farther from a joint than the arm is long from there.
    lever = np.repeat(arm.total_length - arm.stations[:-1], 2)
    way = float(turn[0] + turn[1:] @ lever)
    count = FEWEST
    while count * problem.planned_row_change < turn[1:].max():
        count *= 2
    own = problem.own_pairs
    turns = own.levers @ (turn[1::2] + turn[2::2])
    while count <= MOST:
        share = np.arange(count + 1)[:, None] / count
        rows = (1.0 - share) * begin + share * end
        clearances = clearance(row_centres(arm, rows)).min(axis=1, initial=np.inf)
        spare = own.spare(rows[:, 1::2], rows[:, 2::2])
        if not ((clearances >= need).all() and (spare >= 0.0).all()):
            return None
        apart = (spare[:-1] + spare[1:] >= turns / count).all()
        if (
            apart
            and (clearances[:-1] + clearances[1:] - way / count >= 2.0 * need).all()
        ):
            return np.asarray(rows)
        count *= 2
    return None
