"""Clearance of every link at given configurations, for planners to steer by.

Planners receive it as an argument and know nothing of where it comes from.
"""

from collections.abc import Callable

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.links import link_clearances
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.scene import covers_of
from vdsm_pin.tolerances import TOLERANCES


def arithmetic_pad(problem: PlanningProblem, pieces: PackedPieces) -> float:
    """Bound of all rounding in one clearance evaluation for this problem; [m].

    `TOLERANCES.arithmetic` holds within `TOLERANCES.scene_extent`; rounding grows in
    proportion beyond it.

    Args:
        problem: The arm.
        pieces: The scene.
    """
    arm = problem.manipulator
    largest = max(arm.total_length, *np.abs(arm.base_range))
    for values in (pieces.points, pieces.centre, pieces.radius, pieces.extent):
        largest = max(largest, np.abs(values).max(initial=0.0))
    return TOLERANCES.arithmetic * max(1.0, float(largest) / TOLERANCES.scene_extent)


def link_clearance(problem: PlanningProblem) -> Callable[[FloatArray], FloatArray]:
    """A function that measures the clearance of links in this problem's scene.

    Args:
        problem: Arm and scene.

    Returns:
        Joint centres (n, N + 1, 3) to proved lower bounds of the distance between the
        surface of each link and the nearest obstacle, shape (n, N); negative where they
        meet (there the sign alone is meant), infinite without obstacles; [m].
    """
    obstacles = problem.scene.obstacles
    pieces = pack_pieces([obstacle.pieces for obstacle in obstacles])
    covers = covers_of(obstacles, pieces)
    radius, pad = problem.manipulator.link_radius, arithmetic_pad(problem, pieces)

    def clearances(centres: FloatArray) -> FloatArray:
        rows = np.ascontiguousarray(centres, dtype=np.float64)
        return link_clearances(
            pieces, covers, rows, radius, pad, TOLERANCES.bracket_gap
        )

    return clearances
