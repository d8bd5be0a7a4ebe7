"""Coal's distances of links at the rows of a trajectory, with our brackets beside them.

Poses come from Pinocchio, shapes from the URDF and distances from Coal; the brackets
come from the closed-form kinematics and our own kernels.

Pairs that are far apart add no evidence. A chain of balls along each link against the
boxes of the obstacles bounds every distance from below at a hundredth of the price; a
row is measured where that bound is within reach, and every pair at its nearest row. Nor
does a row add any at which the arm has hardly moved since the row before.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.row_bounds import coarse_bounds, link_gaps, row_brackets
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_arm import arm_poses, arm_shapes
from vdsm_pin.verification.coal_shapes import CoalShapes, Sides, disagreement
from vdsm_pin.verification.robot_model import RobotModel

CHUNK_BOUNDS: Final = 1 << 17
"""Coarse bounds held in memory at a time: rows times links times obstacles."""

CHUNK_GAPS: Final = 1 << 20
"""Closed forms held in memory at a time: rows times links times links."""

CHUNK_PAIRS: Final = 1 << 10
"""Pairs measured between two looks at the time."""

MANY: Final = 10_000
"""Of more obstacles than this only the nearest link of each is measured when far."""


@dataclass(frozen=True)
class CoalDistances:
    """Measured distances of links, with our own brackets beside them.

    Args:
        waypoint: Row of the trajectory, from 0, shape (m,).
        link: Link, from 0, or N for the tool, shape (m,).
        other: Number of the obstacle in the scene, or the other link, shape (m,).
        distance: By Coal; -inf where its answer is unusable, shape (m,); [m].
        lower: Our lower bound at the row, shape (m,); [m].
        upper: Our upper bound; the lower one where there is a closed form; [m].
        link_point: Coal's witness on the link, in the frame of the other, (m, 3); [m].
        other_point: Coal's witness on the other body, the same; [m].
    """

    waypoint: IntArray
    link: IntArray
    other: IntArray
    distance: FloatArray
    lower: FloatArray
    upper: FloatArray
    link_point: FloatArray
    other_point: FloatArray

    @property
    def disagreement(self) -> FloatArray:
        """How far Coal lies outside the bracket, inf if unusable, shape (m,); [m]."""
        found = disagreement(self.distance, self.lower, self.upper)
        return np.maximum(found, 0.0)


@dataclass(frozen=True)
class CoalScene:
    """Obstacles at rest, as the proof and as Coal see them.

    Args:
        pieces: Convex pieces for the proof's kernels.
        shapes: Coal's: links and tool, then the obstacles.
    """

    pieces: PackedPieces
    shapes: CoalShapes

    @classmethod
    def of(
        cls, robot: RobotModel, problem: PlanningProblem, deadline: Deadline
    ) -> "CoalScene":
        """The obstacles of a problem, none of which moves.

        Raises:
            OutOfTime: If the time is over.
        """
        obstacles = problem.scene.obstacles
        shapes, _ = arm_shapes(robot, (), obstacles, deadline)
        return cls(problem.packed_obstacles, shapes)


def reach_of(problem: PlanningProblem) -> float:
    """Distance up to which pairs are measured at every row; [m].

    The required clearance and the arm's own radius past it.
    """
    return problem.required_clearance + problem.manipulator.most_radius


def coal_distances(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    reach: float,
    travel: float = 0.0,
    deadline: Deadline = NO_LIMIT,
    scene: CoalScene | None = None,
) -> Iterator[CoalDistances]:
    """Measure the pairs within reach, chunk by chunk, then every pair not yet seen.

    Args:
        robot: The arm in Pinocchio and Coal.
        problem: The scene.
        trajectory: The rows.
        reach: Measure where the coarse bound is at most this; inf for everything; [m].
        travel: Look at one row of each stretch in which the joint centres move by this
            much; 0 for every row; [m].
        deadline: When to give up.
        scene: The obstacles, where they are there already.

    Yields:
        Distances in the order of the rows; last the pairs that were not measured, each
        at the row where its coarse bound is least; of more than `MANY` obstacles each
        with the link that is nearest then.

    Raises:
        OutOfTime: If the time is over.
    """
    arm, obstacles = problem.manipulator, problem.scene.obstacles
    if not obstacles:
        return
    ready = scene or CoalScene.of(robot, problem, deadline)
    every = np.ones((arm.axis_radii.size, len(obstacles)), dtype=np.bool_)

    def bounds(axes: FloatArray) -> FloatArray:
        return coarse_bounds(ready.pieces, axes, arm.axis_radii)

    near = _Nearness(arm, bounds, every, CHUNK_BOUNDS)
    for pairs in near.pairs(trajectory, reach, travel, deadline):
        yield against_obstacles(robot, trajectory, ready, pairs)


def link_distances(
    robot: RobotModel,
    trajectory: Trajectory,
    reach: float,
    deadline: Deadline = NO_LIMIT,
) -> Iterator[CoalDistances]:
    """Measure the pairs of links within reach, then every pair not yet seen.

    Args:
        robot: The arm in Pinocchio and Coal.
        trajectory: The rows.
        reach: Measure where the closed form is at most this; inf for everything; [m].
        deadline: When to give up.

    Yields:
        Distances in the order of the rows, of a link and one farther out; last the
        pairs that never came within reach, each at the row where it is nearest.

    Raises:
        OutOfTime: If the time is over.
    """
    arm = robot.manipulator
    n_axes = arm.axis_radii.size
    every = np.ones((n_axes, n_axes), dtype=np.bool_)

    def bounds(axes: FloatArray) -> FloatArray:
        return link_gaps(axes, arm.axis_radii)

    near = _Nearness(arm, bounds, np.triu(every, k=2), CHUNK_GAPS)
    for pairs in near.pairs(trajectory, reach, 0.0, deadline):
        yield between_links(robot, trajectory, pairs)


def in_turns(pairs: IntArray, deadline: Deadline) -> Iterator[IntArray]:
    """The same pairs, so many at a time that a deadline is heard in between."""
    for first in range(0, len(pairs), CHUNK_PAIRS):
        deadline.check()
        yield pairs[first : first + CHUNK_PAIRS]


@dataclass(frozen=True)
class _Nearness:
    """Picks the pairs of a motion that are worth a measurement.

    Args:
        arm: Its links and tool are the one side.
        bounds: Lower bounds of the clearance at ends of links and tool, shape
            (n, n_axes + 1, 3), for each of them and each partner; [m].
        apart: Which pairs to look at, shape (n_axes, n_partners).
        held: Bounds held in memory at a time.
    """

    arm: Manipulator
    bounds: Callable[[FloatArray], FloatArray]
    apart: BoolArray
    held: int

    def pairs(
        self, trajectory: Trajectory, reach: float, travel: float, deadline: Deadline
    ) -> Iterator[IntArray]:
        """(waypoint, link, partner) triples within reach, then one of each other pair.

        Raises:
            OutOfTime: If the time is over.
        """
        least = np.full(self.apart.shape, np.inf)
        nearest = np.zeros(least.shape, dtype=np.int64)
        seen = ~self.apart
        moved = _Moved(travel)
        step = max(1, self.held // least.size)
        for first in range(0, trajectory.n_samples, step):
            deadline.check()
            axes = _axes(self.arm, trajectory, slice(first, first + step))
            bounds = self.bounds(axes)
            here = np.argmin(bounds, axis=0)
            value = np.take_along_axis(bounds, here[None], axis=0)[0]
            nearer = value < least
            least[nearer], nearest[nearer] = value[nearer], here[nearer] + first
            within = (bounds <= reach) & moved(axes)[:, None, None] & self.apart
            seen |= within.any(axis=0)
            close = np.argwhere(within)
            close[:, 0] += first
            yield from in_turns(close, deadline)
        if self.apart.shape[1] > MANY:  # of the far ones the nearest link alone
            seen |= np.arange(len(least))[:, None] != np.argmin(least, axis=0)
        far = np.argwhere(~seen)
        yield from in_turns(np.column_stack([nearest[~seen], far]), deadline)


class _Moved:
    """Picks the first row of each stretch of a motion, part after part.

    Args:
        travel: How far the joint centres move in a stretch; [m].
    """

    def __init__(self, travel: float) -> None:
        self._travel = travel
        self._way, self._last = 0.0, np.zeros((0, 0, 3))

    def __call__(self, centres: FloatArray) -> BoolArray:
        """Which rows of the next part to look at, shape (n,).

        Args:
            centres: Ends of links and tool at the rows, shape (n, n_axes + 1, 3); [m].
        """
        if self._travel == 0.0:
            return np.ones(len(centres), dtype=np.bool_)
        begin = self._last if len(self._last) else centres[:1]
        steps = np.linalg.norm(np.diff(centres, axis=0, prepend=begin), axis=2)
        ways = self._way + np.cumsum(steps.max(axis=1))
        marks = np.floor(np.append(self._way, ways) / self._travel)
        found = np.diff(marks) > 0.0
        found[0] |= not len(self._last)
        self._way, self._last = float(ways[-1]), centres[-1:]
        return np.asarray(found)


def against_obstacles(
    robot: RobotModel, trajectory: Trajectory, scene: CoalScene, pairs: IntArray
) -> CoalDistances:
    """Ask both about (waypoint, link, obstacle) triples, shape (m, 3)."""
    rows, place = np.unique(pairs[:, 0], return_inverse=True)
    link, obstacle, radii = pairs[:, 1], pairs[:, 2], robot.manipulator.axis_radii
    axes = _axes(robot.manipulator, trajectory, rows)
    ends = np.stack([axes[place, link], axes[place, link + 1]], axis=1)
    bounds = row_brackets(scene.pieces, ends, obstacle, TOLERANCES.bracket_gap)
    bounds -= radii[link, None]
    poses = arm_poses(robot, _joints(trajectory, rows))
    found = scene.shapes.distances(poses, Sides(place, link, radii.size + obstacle))
    lower, upper = bounds.T
    return CoalDistances(
        pairs[:, 0], link, obstacle, found.distance, lower, upper, found.near, found.far
    )


def between_links(
    robot: RobotModel, trajectory: Trajectory, pairs: IntArray
) -> CoalDistances:
    """Ask both about (waypoint, link, other link) triples, shape (m, 3)."""
    rows, place = np.unique(pairs[:, 0], return_inverse=True)
    link, other = pairs[:, 1], pairs[:, 2]
    axes = _axes(robot.manipulator, trajectory, rows)
    gaps = link_gaps(axes, robot.manipulator.axis_radii)[place, link, other]
    poses, (shapes, _) = arm_poses(robot, _joints(trajectory, rows)), arm_shapes(robot)
    found = shapes.distances(poses, Sides(place, link, other))
    return CoalDistances(
        pairs[:, 0], link, other, found.distance, gaps, gaps, found.near, found.far
    )


def _joints(
    trajectory: Trajectory, rows: IntArray | slice
) -> tuple[FloatArray, FloatArray, FloatArray]:
    return trajectory.x0[rows], trajectory.alpha[rows], trajectory.theta[rows]


def _axes(
    arm: Manipulator, trajectory: Trajectory, rows: IntArray | slice
) -> FloatArray:
    """Ends of the links and of the tool at some rows, shape (m, n_axes + 1, 3); [m]."""
    centres = joint_centres(arm, *_joints(trajectory, rows))
    return np.ascontiguousarray(arm.axes(centres))
