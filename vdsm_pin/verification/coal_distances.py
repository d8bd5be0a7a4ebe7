"""Coal's distances of links at the rows of a trajectory, with our brackets beside them.

Poses come from Pinocchio, which reads the URDF, and distances from Coal; the brackets
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
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
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


def coal_reach(problem: PlanningProblem) -> float:
    """Distance up to which Coal measures a pair at every row; [m].

    It is the required clearance plus the arm's largest radius.
    """
    return problem.required_clearance + problem.manipulator.most_radius


@dataclass(frozen=True)
class Partners:
    """What links and tool are held against: obstacles at rest, or links farther out.

    Args:
        robot: The arm in Pinocchio and Coal.
        names: Of the partners.
        shapes: Coal's: links and tool, then what else there is.
        first: Number of the first partner among the shapes.
        apart: Which pairs to look at, shape (n_axes, n_partners).
        bounds: Lower bounds of the clearance at ends of links and tool, shape
            (n, n_axes + 1, 3), for each of them and each partner; [m].
        brackets: Of links and partners at some of these rows: both bounds; [m].
        held: Bounds held in memory at a time.
    """

    robot: RobotModel
    names: tuple[str, ...]
    shapes: CoalShapes
    first: int
    apart: BoolArray
    bounds: Callable[[FloatArray], FloatArray]
    brackets: Callable[[FloatArray, Sides], tuple[FloatArray, FloatArray]]
    held: int

    def distances(
        self,
        trajectory: Trajectory,
        reach: float,
        travel: float = 0.0,
        deadline: Deadline = NO_LIMIT,
    ) -> Iterator[CoalDistances]:
        """Measure the pairs within reach, then every pair not yet seen.

        Args:
            trajectory: The rows.
            reach: Measure where the coarse bound is at most this; inf for all; [m].
            travel: Look at one row of each stretch in which the joint centres move by
                this much; 0 for every row; [m].
            deadline: When to give up.

        Yields:
            Distances in the order of the rows; last the pairs that were not measured,
            each at the row where its coarse bound is least; of more than `MANY`
            partners each with the link that is nearest then.

        Raises:
            OutOfTime: If the time is over.
        """
        for pairs in self._near(trajectory, reach, travel, deadline):
            for first in range(0, len(pairs), CHUNK_PAIRS):
                deadline.check()
                yield self.measured(trajectory, pairs[first : first + CHUNK_PAIRS])

    def _near(
        self, trajectory: Trajectory, reach: float, travel: float, deadline: Deadline
    ) -> Iterator[IntArray]:
        """(waypoint, link, partner) triples within reach, then one of each other pair.

        Raises:
            OutOfTime: If the time is over.
        """
        if not self.apart.any():
            return
        least = np.full(self.apart.shape, np.inf)
        nearest = np.zeros(least.shape, dtype=np.int64)
        seen = ~self.apart
        moved = _Moved(travel)
        step = max(1, self.held // least.size)
        for first in range(0, trajectory.n_samples, step):
            deadline.check()
            axes = self._axes(trajectory, slice(first, first + step))
            bounds = self.bounds(axes)
            here = np.argmin(bounds, axis=0)
            value = np.take_along_axis(bounds, here[None], axis=0)[0]
            nearer = value < least
            least[nearer], nearest[nearer] = value[nearer], here[nearer] + first
            within = (bounds <= reach) & moved(axes)[:, None, None] & self.apart
            seen |= within.any(axis=0)
            close = np.argwhere(within)
            close[:, 0] += first
            yield close
        if self.apart.shape[1] > MANY:  # of the far ones the nearest link alone
            seen |= np.arange(len(least))[:, None] != np.argmin(least, axis=0)
        yield np.column_stack([nearest[~seen], np.argwhere(~seen)])

    def measured(self, trajectory: Trajectory, pairs: IntArray) -> CoalDistances:
        """Ask both about (waypoint, link, partner) triples, shape (m, 3)."""
        rows, place = np.unique(pairs[:, 0], return_inverse=True)
        sides = Sides(place, pairs[:, 1], pairs[:, 2])
        lower, upper = self.brackets(self._axes(trajectory, rows), sides)
        poses = arm_poses(self.robot, _joints(trajectory, rows))
        placed = sides._replace(other=self.first + sides.other)
        found = self.shapes.distances(poses, placed)
        row, link, other = pairs.T
        return CoalDistances(
            row, link, other, found.distance, lower, upper, found.near, found.far
        )

    def _axes(self, trajectory: Trajectory, rows: IntArray | slice) -> FloatArray:
        """Ends of the links and of the tool at some rows, (m, n_axes + 1, 3); [m]."""
        arm = self.robot.manipulator
        centres = joint_centres(arm, *_joints(trajectory, rows))
        return np.ascontiguousarray(arm.axes(centres))


def obstacles_at_rest(
    robot: RobotModel, problem: PlanningProblem, deadline: Deadline = NO_LIMIT
) -> Partners:
    """The obstacles of a problem, none of which moves.

    Raises:
        OutOfTime: If the time is over.
    """
    scene, radii = problem.scene, robot.manipulator.axis_radii
    pieces = problem.packed_obstacles

    def brackets(axes: FloatArray, sides: Sides) -> tuple[FloatArray, FloatArray]:
        row, link, obstacle = sides
        ends = np.stack([axes[row, link], axes[row, link + 1]], axis=1)
        found = row_brackets(pieces, ends, obstacle, TOLERANCES.bracket_gap)
        lower, upper = (found - radii[link, None]).T
        return lower, upper

    return Partners(
        robot=robot,
        names=scene.names,
        shapes=arm_shapes(robot, (), scene.obstacles, deadline)[0],
        first=radii.size,
        apart=np.ones((radii.size, len(scene.obstacles)), dtype=np.bool_),
        bounds=lambda axes: coarse_bounds(pieces, axes, radii),
        brackets=brackets,
        held=CHUNK_BOUNDS,
    )


def links_farther_out(robot: RobotModel) -> Partners:
    """The links and the tool two or more farther from the base."""
    arm, radii = robot.manipulator, robot.manipulator.axis_radii

    def brackets(axes: FloatArray, sides: Sides) -> tuple[FloatArray, FloatArray]:
        gaps = link_gaps(axes, radii)[sides.row, sides.one, sides.other]
        return gaps, gaps

    return Partners(
        robot=robot,
        names=tuple(arm.axis_names),
        shapes=arm_shapes(robot)[0],
        first=0,
        apart=np.triu(np.ones((radii.size, radii.size), dtype=np.bool_), k=2),
        bounds=lambda axes: link_gaps(axes, radii),
        brackets=brackets,
        held=CHUNK_GAPS,
    )


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


def _joints(
    trajectory: Trajectory, rows: IntArray | slice
) -> tuple[FloatArray, FloatArray, FloatArray]:
    return trajectory.x0[rows], trajectory.alpha[rows], trajectory.theta[rows]
