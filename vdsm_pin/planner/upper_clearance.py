"""Upper bounds of a clearance: what proves that a link is too near an obstacle."""

from typing import Final

import numpy as np

from vdsm_pin.compiled import borrowed, clock, compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.kernels import BRACKET, NORMAL, SCRATCH_ROWS, UPPER
from vdsm_pin.geometry.obstacles import STACK, obstacle_bracket
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

GOAL: Final = TOLERANCES.bracket_gap
"""Width of a bracket at which to stop; [m]."""


@compiled
def upper_bounds(
    pieces: PackedPieces, segments: FloatArray, until: float
) -> FloatArray:
    """Proved upper bounds of the distance of segments to each obstacle.

    Args:
        pieces: The scene.
        segments: Shape (n, 2, 3); [m].
        until: When to stop, by the monotonic clock; [s].

    Returns:
        Shape (n, n_obstacles), infinite where the time was over; [m].
    """
    pieces = borrowed(pieces)
    count = pieces.root.size
    result = np.full((segments.shape[0], count), np.inf)
    scratch = np.zeros((SCRATCH_ROWS + 2, 3))
    stack = np.zeros(STACK, np.int64)
    trial, out = np.zeros(BRACKET + 4), np.zeros(BRACKET + 4)
    body = new_body(2, 2, 0)
    for n in range(segments.shape[0]):
        body.points[:] = segments[n]
        for o in range(count):
            if clock() > until:
                return result
            out[NORMAL : NORMAL + 3] = 1.0
            obstacle_bracket(pieces, o, body, GOAL, scratch, stack, trial, out)
            result[n, o] = out[UPPER]
    return result


def upper_clearance(problem: PlanningProblem, segments: FloatArray) -> FloatArray:
    """Upper bounds of the clearance of links along segments to each obstacle.

    Each rests on two points, one of the link and one of the obstacle's surface.

    Args:
        problem: Arm and scene.
        segments: Axes of links, shape (n, 2, 3); [m].

    Returns:
        Shape (n, n_obstacles); [m].
    """
    if not problem.scene.obstacles:
        return np.full((len(segments), 0), np.inf)
    upper = upper_bounds(
        problem.packed_obstacles, np.ascontiguousarray(segments), np.inf
    )
    return np.asarray(upper - problem.manipulator.least_radius)


def culprit(problem: PlanningProblem, centres: FloatArray) -> tuple[int, str, float]:
    """The link nearest to an obstacle, that obstacle, and the clearance's upper bound.

    Args:
        problem: Arm and scene.
        centres: Joint centres of one configuration, shape (N + 1, 3); [m].
    """
    upper = upper_clearance(problem, np.stack([centres[:-1], centres[1:]], axis=1))
    link, obstacle = np.unravel_index(int(np.argmin(upper)), upper.shape)
    name = problem.scene.obstacles[int(obstacle)].name
    return int(link) + 1, name, float(upper[link, obstacle])
