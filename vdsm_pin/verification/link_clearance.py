"""Clearance of every link at given configurations, for planners to steer by.

Planners receive it as an argument and know nothing of where it comes from.
"""

from collections.abc import Callable

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.links import link_clearances
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.problem.held import Axes, drawn_out
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
    values = pieces.points, pieces.centre, pieces.radius, pieces.extent
    largest = [np.abs(one).max(initial=arm.total_length) for one in values]
    return rounding_pad(float(max(*largest, *np.abs(arm.base_range))))


def link_clearance(problem: PlanningProblem) -> Callable[..., FloatArray]:
    """A function that measures the clearance of links in this problem's scene.

    Args:
        problem: Arm and scene.

    Returns:
        Joint centres (n, N + 1, 3) to proved lower bounds of the distance between the
        surface of each link and the nearest obstacle that it is held apart from, shape
        (n, N); negative where they meet (there the sign alone is meant), infinite
        without obstacles; [m]. The tool counts as part of the last link, and what links
        carry as if it were round about their axes. A second argument says which axes
        any other straight pieces of an arm are of (`Axes`), else these are taken to be
        as thick as its thickest part.

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
    if problem.held.alike:
        return _from_all(problem)
    return _from_held(problem)


def _from_all(problem: PlanningProblem) -> Callable[..., FloatArray]:
    """The function of an arm that is equally thick and held from every obstacle."""
    obstacles = problem.scene.obstacles
    pieces = problem.packed_obstacles
    covers, pad = covers_of(obstacles, pieces), arithmetic_pad(problem, pieces)
    radius, goal = problem.manipulator.most_radius, TOLERANCES.bracket_gap

    def clearances(centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        rows = np.ascontiguousarray(centres, dtype=np.float64)
        return link_clearances(pieces, covers, rows, radius, pad, goal)

    return clearances


def _axes(arm: Manipulator, rows: FloatArray) -> FloatArray:
    return np.ascontiguousarray(arm.axes(rows))


def _by_link(arm: Manipulator, gaps: FloatArray) -> FloatArray:
    """The clearance of each link, shape (n, N), its tool included; [m]."""
    gaps[:, arm.n_links - 1] = gaps[:, arm.n_links - 1 :].min(axis=1)
    return gaps[:, : arm.n_links]


def _from_held(problem: PlanningProblem) -> Callable[..., FloatArray]:
    """The function where groups of obstacles are held from axes, or these differ."""
    arm, goal, groups = problem.manipulator, TOLERANCES.bracket_gap, problem.held.groups
    pad, packed = arithmetic_pad(problem, problem.packed_obstacles), []
    for group in groups:
        obstacles = [problem.scene.obstacles[o] for o in group.obstacles]
        pieces = pack_pieces([obstacle.pieces for obstacle in obstacles])
        packed.append((pieces, covers_of(obstacles, pieces)))

    def clearances(centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        rows = np.ascontiguousarray(centres, dtype=np.float64)
        shape = len(rows), rows.shape[1] - 1
        if axes is None and shape[1] == arm.n_links:
            rows = _axes(arm, rows)
            least = np.full((len(rows), rows.shape[1] - 1), np.inf)
            pieces = np.stack([rows[:, :-1], rows[:, 1:]], axis=2).reshape(-1, 2, 3)
            for group, scene in zip(groups, packed, strict=True):
                beyond = np.tile(group.beyond, (len(rows), 1))
                some = drawn_out(pieces, beyond)
                gaps = link_clearances(*scene, some, 0.0, pad, goal)
                np.minimum(least, gaps.reshape(least.shape) - group.radii, out=least)
            return _by_link(arm, least)
        ends = np.stack([rows[:, :-1], rows[:, 1:]], axis=2).reshape(-1, 2, 3)
        number = problem.held.numbers(axes, shape)
        least = np.full(len(ends), np.inf)
        for group, scene in zip(groups, packed, strict=True):
            which, some, radii = group.held(ends, number)
            gaps = link_clearances(*scene, some, 0.0, pad, goal)[:, 0] - radii
            np.minimum.at(least, which, gaps)
        return least.reshape(shape)

    return clearances
