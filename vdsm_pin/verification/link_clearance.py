"""Clearance of every link at given configurations, for planners to steer by.

Planners receive it as an argument and know nothing of where it comes from.
"""

from collections.abc import Callable

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.links import link_clearances
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import covers_of
from vdsm_pin.proof.budget import rounding_pad
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
    return rounding_pad(float(largest))


def link_clearance(problem: PlanningProblem) -> Callable[[FloatArray], FloatArray]:
    """A function that measures the clearance of links in this problem's scene.

    Args:
        problem: Arm and scene.

    Returns:
        Joint centres (n, N + 1, 3) to proved lower bounds of the distance between the
        surface of each link and the nearest obstacle, shape (n, N); negative where they
        meet (there the sign alone is meant), infinite without obstacles; [m]. The tool
        counts as part of the last link, and what links carry as if it were round about
        their axes. Pieces of an arm, of other numbers of links, are taken to be as
        thick as its thickest part.

    Raises:
        InvalidInput: If an obstacle moves: nothing of time is known here.
    """
    if problem.scene.moving:
        name = problem.scene.moving[0].name
        message = (
            f"obstacle {name!r} moves: no motion is planned beside it; vdsm verify "
            "judges a given one"
        )
        raise InvalidInput(message)
    obstacles = problem.scene.obstacles
    pieces = problem.packed_obstacles
    covers, pad = covers_of(obstacles, pieces), arithmetic_pad(problem, pieces)
    arm, goal = problem.manipulator, TOLERANCES.bracket_gap
    alike = arm.least_radius == arm.most_radius

    def clearances(centres: FloatArray) -> FloatArray:
        rows = np.ascontiguousarray(centres, dtype=np.float64)
        if alike or rows.shape[1] != arm.n_links + 1:
            return link_clearances(pieces, covers, rows, arm.most_radius, pad, goal)
        if arm.bodies:
            gaps = link_clearances(pieces, covers, rows, 0.0, pad, goal)
            return np.asarray(gaps - arm.reaches)
        axes = np.ascontiguousarray(arm.axes(rows))
        gaps = link_clearances(pieces, covers, axes, 0.0, pad, goal) - arm.axis_radii
        gaps[:, arm.n_links - 1] = gaps[:, arm.n_links - 1 :].min(axis=1)
        return gaps[:, : arm.n_links]

    return clearances
