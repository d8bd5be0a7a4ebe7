"""Upper bounds of a clearance: what proves that a link is too near an obstacle."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import FEED, Manipulator
from vdsm_pin.compiled import borrowed, clock, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import Body, new_body
from vdsm_pin.geometry.kernels import NORMAL, UPPER
from vdsm_pin.geometry.obstacles import (
    Measuring,
    box_distance,
    new_measuring,
    obstacle_bracket,
)
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.problem.held import drawn_out
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import clearance_words

TIP_ONLY: Final = slice(-1, None)
"""The axis at whose end the tip is."""
WHOLE_ARM: Final = slice(None)
"""Every axis."""
GOAL: Final = TOLERANCES.bracket_gap
"""Width of a bracket at which to stop; [m]."""


@compiled
def _upper_bound(
    pieces: PackedPieces, obstacle: int, body: Body, work: Measuring
) -> float:
    """A proved upper bound of the distance of a body to an obstacle; [m]."""
    work.out[NORMAL : NORMAL + 3] = 1.0
    obstacle_bracket(pieces, obstacle, body, GOAL, work)
    return float(work.out[UPPER])


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
    body, work = new_body(2, 2, 0), new_measuring()
    for n in range(segments.shape[0]):
        body.points[:] = segments[n]
        for o in range(count):
            if clock() > until:
                return result
            result[n, o] = _upper_bound(pieces, o, body, work)
    return result


@compiled
def upper_bounds_to(
    pieces: PackedPieces, points: FloatArray, obstacles: IntArray, until: float
) -> FloatArray:
    """`upper_bounds` of points, each to an obstacle of its own.

    Args:
        pieces: The scene.
        points: Shape (n, 3); [m].
        obstacles: Numbers of obstacles, shape (n,).
        until: When to stop, by the monotonic clock; [s].

    Returns:
        Shape (n,), infinite where the time was over; [m].
    """
    pieces, result = borrowed(pieces), np.full(points.shape[0], np.inf)
    body, work = new_body(1, 1, 0), new_measuring()
    for n in range(points.shape[0]):
        if clock() > until:
            return result
        body.points[0] = points[n]
        result[n] = _upper_bound(pieces, obstacles[n], body, work)
    return result


@compiled
def nearest_bounds(
    pieces: PackedPieces, points: FloatArray, until: float
) -> tuple[FloatArray, IntArray]:
    """The least of `upper_bounds` of points, and whose it is.

    Obstacles whose box is farther are left alone.

    Args:
        pieces: The scene.
        points: Shape (n, 3); [m].
        until: When to stop, by the monotonic clock; [s].

    Returns:
        Shape (n,) each; infinite without obstacles and where the time was over; [m].
    """
    pieces, count = borrowed(pieces), pieces.root.size
    result = np.full(points.shape[0], np.inf)
    which = np.zeros(points.shape[0], np.int64)
    boxes = np.zeros(count)
    body, work = new_body(1, 1, 0), new_measuring()
    for n in range(points.shape[0]):
        if count == 0 or clock() > until:
            return result, which
        for o in range(count):
            boxes[o] = box_distance(pieces, pieces.root[o], points[n], points[n])
        first = int(np.argmin(boxes))
        body.points[0] = points[n]
        best, nearest = _upper_bound(pieces, first, body, work), first
        for o in range(count):
            if o != first and boxes[o] < best:
                upper = _upper_bound(pieces, o, body, work)
                if upper < best:
                    best, nearest = upper, o
        result[n], which[n] = best, nearest
    return result, which


def upper_distances(
    problem: PlanningProblem, segments: FloatArray, deadline: Deadline = NO_LIMIT
) -> FloatArray:
    """Upper bounds of the distance of segments to each obstacle.

    Each rests on two points, one of the segment and one of the obstacle's surface.

    Args:
        problem: The scene.
        segments: Shape (n, 2, 3); [m].
        deadline: When to give up.

    Returns:
        Shape (n, n_obstacles); [m].

    Raises:
        OutOfTime: If the time is over.
    """
    if not problem.scene.obstacles:
        return np.full((len(segments), 0), np.inf)
    pieces, ends = problem.packed_obstacles, np.ascontiguousarray(segments)
    found = upper_bounds(pieces, ends, deadline.end)
    deadline.check()
    return np.asarray(found)


def upper_clearance(problem: PlanningProblem, segments: FloatArray) -> FloatArray:
    """Upper bounds of the clearance of links, however thick, as `upper_distances`."""
    return upper_distances(problem, segments) - problem.manipulator.least_radius


def held_from(problem: PlanningProblem, axes: slice = WHOLE_ARM) -> PlanningProblem:
    """The problem with those obstacles alone that all of some axes may not touch.

    What is impossible among them is so whatever `ignore_pairs` leaves out.

    Args:
        problem: Arm and scene.
        axes: Numbers from 0, links first, then the tool.
    """
    return problem.among(np.all(problem.held.axes[axes], axis=0))


def last_link(problem: PlanningProblem) -> slice:
    """The axes of the last link and the tool on it."""
    return slice(problem.manipulator.n_links - 1, None)


def nearest(problem: PlanningProblem, place: FloatArray) -> tuple[str, float]:
    """The obstacle nearest to the tip, shape (3,), and how far it is at most; [m].

    Of those that the tip is held apart from; no name and inf without any.
    """
    problem = held_from(problem, TIP_ONLY)
    if not problem.scene.obstacles:
        return "", np.inf
    (upper,) = upper_distances(problem, np.stack([place, place])[None])
    obstacle = int(np.argmin(upper))
    return problem.scene.obstacles[obstacle].name, float(upper[obstacle])


@dataclass(frozen=True)
class Culprit:
    """The part of an arm that is nearest to an obstacle.

    Args:
        link: Number of the link, from 1; 0 for the feed.
        obstacle: Name of the obstacle.
        clearance: Between the two, from above; [m].
        deeper: Whether the axis meets the obstacle: no depth beyond the radius is
            measured.
    """

    link: int
    obstacle: str
    clearance: float
    deeper: bool

    @property
    def words(self) -> str:
        """The clearance as people read it."""
        return clearance_words(self.clearance, self.deeper)


def culprit(problem: PlanningProblem, centres: FloatArray) -> Culprit:
    """The link nearest to an obstacle, that obstacle, and the clearance between them.

    As `link_clearance` has it: the tool is part of the last link, and links count as
    thick as what they carry reaches.

    Args:
        problem: Arm and scene.
        centres: Joint centres of one configuration, shape (N + 1, 3); [m].

    Returns:
        At an infinite clearance where nothing is held apart.
    """
    arm, radii = problem.manipulator, problem.held.radii
    axes = arm.axes(centres[None])[0]
    segments = np.stack([axes[:-1], axes[1:]], axis=1)
    segments = drawn_out(segments, problem.held.beyond.max(axis=2).T)
    links = np.minimum(np.arange(len(segments)) + 1, arm.n_links)
    return _nearest_of(problem, upper_distances(problem, segments), radii, links)


def feed_culprit(
    problem: PlanningProblem, base: FloatArray, to: float | None = None
) -> Culprit:
    """The obstacle nearest to the feed, of those that it is held apart from.

    Args:
        problem: Arm and scene.
        base: Where O_1 is, shape (3,); [m].
        to: The x0 up to which the feed slides from there; None where it rests; [m].

    Returns:
        At an infinite clearance without a feed or such an obstacle.
    """
    arm = problem.manipulator
    held = np.array([not arm.ignores(FEED, name) for name in problem.scene.names])
    if not arm.feed or not held.any():
        return Culprit(0, "", np.inf, deeper=False)
    rear, front = base.copy(), base.copy()
    slides = (base[0], base[0] if to is None else to)
    rear[0], front[0] = min(slides) - arm.feed.length, max(slides)
    distances = upper_distances(problem, np.stack([rear, front])[None])
    radii, link = np.where(held, arm.feed.radius, -np.inf)[None], np.zeros(1, np.int64)
    return _nearest_of(problem, distances, radii, link)


def _nearest_of(
    problem: PlanningProblem, distances: FloatArray, radii: FloatArray, links: IntArray
) -> Culprit:
    """The least clearance of axes to obstacles, distances and radii (n, m) given."""
    upper = distances - radii
    at = np.unravel_index(int(np.argmin(upper)), upper.shape)
    name = problem.scene.obstacles[int(at[1])].name
    deeper = bool(distances[at] <= GOAL)
    return Culprit(int(links[at[0]]), name, float(upper[at]), deeper)


def named(arm: Manipulator, link: int) -> str:
    """A link, counted from 1, in words, with what counts as part of it; 0, the feed."""
    if link == 0:
        return "the feed"
    words = f"link {link}"
    if link == arm.n_links and arm.tool:
        words += " with its tool"
    if any(body.link == link for body in arm.bodies):
        words += ", taken to be as thick as what it carries,"
    return words
