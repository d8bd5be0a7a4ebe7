"""Whether the arm may stand where the problem says that it starts."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vdsm_pin.arm.kinematics import row_centres, straight_joints
from vdsm_pin.errors import InsideUnknown, StartBlocked, StartInside
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.geometry.winding import Location, Side, locate
from vdsm_pin.planner.records import LinkClearance, Prepared
from vdsm_pin.planner.upper_clearance import (
    Culprit,
    culprit,
    feed_culprit,
    named,
    upper_clearance,
)
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene, with_hulls


def start_centres(problem: PlanningProblem) -> FloatArray:
    """Joint centres of the arm as it starts, shape (N + 1, 3); [m].

    NaN along the rail where the start is farther from it than the arm is long.
    """
    arm, path = problem.manipulator, problem.path
    if path.start_joints is not None:
        return np.asarray(row_centres(arm, path.start_joints[None])[0])
    across = arm.ratios[:, None] * path.start[1:]
    square = arm.total_length**2 - path.start[1:] @ path.start[1:]
    rise = np.sqrt(square) if square >= 0.0 else np.nan
    along = path.start[0] - rise * (1.0 - arm.ratios)
    return np.column_stack([along, across])


def start_joints(problem: PlanningProblem) -> FloatArray:
    """Joint values q = (x0, alpha1, ..) of the arm as it starts, (1 + 2N,); [m], [rad].

    The start is nearer to the rail than the arm is long.
    """
    path = problem.path
    if path.start_joints is not None:
        return path.start_joints
    return straight_joints(problem.manipulator, path.start)


def _located(problem: PlanningProblem) -> Iterator[tuple[Mesh, Location]]:
    """Where the arm starts as seen from each mesh that may have an inside."""
    arm, centres = problem.manipulator, start_centres(problem)
    axes = arm.axes(centres[None])[0]
    for o, mesh in enumerate(problem.scene.obstacles):
        held = problem.held.axes[:, o]
        if not isinstance(mesh, Mesh) or mesh.is_surface or not held.any():
            continue
        first = axes[int(np.argmax(held))]
        if np.isfinite(first).all():
            yield mesh, locate(mesh.closed_mesh, first, arm.least_radius)


def _check_outside(problem: PlanningProblem) -> None:
    """Refuse a start inside a mesh, and one within the hull of an unknown inside."""
    for mesh, found in _located(problem):
        if found.side is Side.INSIDE:
            raise StartInside(obstacle=mesh.name)
        if found.side is Side.UNKNOWN and not _clear_of_hull(problem, mesh):
            raise InsideUnknown(obstacle=mesh.name, reason=found.words(mesh.name))


def _clear_of_hull(problem: PlanningProblem, mesh: Mesh) -> bool:
    """Whether nothing proves that the start is too near a mesh's convex hull."""
    axes = problem.manipulator.axes(start_centres(problem)[None])[0]
    alone = replace(problem, scene=with_hulls(Scene((mesh,)), [mesh.name]))
    upper = upper_clearance(alone, np.stack([axes[:-1], axes[1:]], axis=1))
    upper = upper[alone.held.axes[:, 0]]
    return bool(upper.min() >= problem.required_clearance)


def with_known_insides(problem: PlanningProblem) -> Prepared:
    """Put hulls in the places of meshes whose inside cannot be told.

    Whatever counts as the inside of such a mesh lies in its convex hull.

    Raises:
        InsideUnknown: If the start is within one of them.
    """
    found = {m.name: w for m, w in _located(problem) if w.side is Side.UNKNOWN}
    if found:
        _check_outside(problem)
    notes = tuple(
        f"the inside of {name!r} cannot be told ({where.reason}), so that its convex "
        f"hull stands for it: write `solid: false` under {name!r} in the problem file "
        "if only its surface is meant"
        for name, where in found.items()
    )
    scene = with_hulls(problem.scene, found)
    return Prepared(replace(problem, scene=scene) if found else problem, notes)


def check_start(problem: PlanningProblem, clearance: LinkClearance) -> None:
    """Refuse a start that is too close to an obstacle.

    The start is a pose that the problem states: no strategy takes another one. One out
    of reach is not judged here.

    Args:
        problem: What is asked.
        clearance: Clearance of links at given joint centres.

    Raises:
        StartInside: Where it is inside a mesh.
        StartBlocked: With the link or the feed, the obstacle and the clearance
            between them.
        InsideUnknown: Where it is within the convex hull of a mesh whose inside
            cannot be told.
    """
    centres = start_centres(problem)
    required = problem.required_clearance
    if not np.isfinite(centres).all():
        return
    _check_outside(problem)
    if not clearance(centres[None]).min() >= required:
        raise _blocked(problem, culprit(problem, centres))
    feed = feed_culprit(problem, centres[0])
    if feed.clearance < required:
        raise _blocked(problem, feed)


def _blocked(problem: PlanningProblem, found: Culprit) -> StartBlocked:
    return StartBlocked(
        link=found.link,
        obstacle=found.obstacle,
        clearance=found.clearance,
        required=problem.required_clearance,
        bent=problem.path.start_joints is not None,
        called=named(problem.manipulator, found.link),
        deeper=found.deeper,
    )
