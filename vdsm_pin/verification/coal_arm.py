"""An arm and its scene as Coal measures them, with our own brackets beside.

Poses come from Pinocchio, which reads the URDF, and distances from Coal; the brackets
of links come from the closed-form kinematics and our own kernels.

Pairs that are far apart add no evidence. A chain of balls along each link against the
boxes of the obstacles bounds every distance from below at a hundredth of the price; a
row is measured where that bound is within reach, and every pair at its nearest row. Nor
does a row add any at which the arm has hardly moved since the row before.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres, link_frame
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray, distinct
from vdsm_pin.geometry.row_bounds import coarse_bounds, link_gaps, row_brackets
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_bodies import Witness
from vdsm_pin.verification.coal_shapes import (
    CoalPairs,
    Sides,
    assembly_shapes,
    disagreement,
)
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.task import arm_assembly

CHUNK_BOUNDS: Final = 1 << 17
"""Coarse bounds held in memory at a time: rows times links times partners."""

CHUNK_PAIRS: Final = 1 << 10
"""Pairs measured between two looks at the time."""

MANY: Final = 10_000
"""Of more obstacles than this only the nearest link of each is measured when far."""

SPREAD: Final = 32
"""Rows at which pairs without a coarse bound are measured, evenly over the motion."""


@dataclass(frozen=True)
class CoalDistances:
    """Measured distances of pairs, with our own brackets beside them.

    Args:
        moment: When, in waypoints, whole at a row, shape (m,).
        pair: Number of the pair in `CoalPairs`, shape (m,).
        distance: By Coal; -inf where its answer is unusable, shape (m,); [m].
        lower: Our lower bound then, -inf where we have none, shape (m,); [m].
        upper: Our upper bound, inf where we have none; the lower one where there is a
            closed form, shape (m,); [m].
    """

    moment: FloatArray
    pair: IntArray
    distance: FloatArray
    lower: FloatArray
    upper: FloatArray

    @property
    def disagreement(self) -> FloatArray:
        """How far Coal lies outside the bracket, inf if unusable, shape (m,); [m]."""
        found = disagreement(self.distance, self.lower, self.upper)
        return np.maximum(found, 0.0)


def coal_reach(problem: PlanningProblem) -> float:
    """Distance up to which Coal measures a link and an obstacle at every row; [m].

    It is the required clearance plus the arm's largest radius.
    """
    return problem.required_clearance + problem.manipulator.most_radius


class CoalArm:
    """Links, tool, what they carry, and obstacles as Coal has them.

    Args:
        problem: Arm and scene.
        deadline: When to give up making shapes.
        links: Whether links near links are looked for, not near obstacles alone.

    Raises:
        OutOfTime: If the time is over.
        VerificationFailed: If Coal refuses a shape.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        deadline: Deadline = NO_LIMIT,
        *,
        links: bool = True,
    ) -> None:
        self.problem, self._asked = problem, arm_assembly(problem)
        self.pairs = CoalPairs(self._asked)
        self._model = load_arm(problem.manipulator)
        self._shapes = assembly_shapes(self._asked, deadline)
        self._radii = problem.manipulator.axis_radii
        # Partners with coarse bounds: obstacles at rest, then links and tool.
        moves = [isinstance(one, Moving) for one in problem.scene.obstacles]
        still = problem  # with what it keeps packed
        if any(moves):
            still = replace(problem, scene=problem.scene.at_rest)
        self._pieces, self._n_rest = still.packed_obstacles, moves.count(False)
        n_axes, n_own = self._radii.size, self.pairs.n_own
        n_columns = self._n_rest + links * n_axes
        columns = np.full(len(self.pairs.names), -1)
        columns[: links * n_axes] = np.arange(self._n_rest, n_columns)
        columns[n_own:][~np.array(moves, bool)] = np.arange(self._n_rest)
        of_link = self.pairs.one < n_axes
        self._column = np.where(of_link, columns[self.pairs.other], -1)
        self._number = np.full((n_axes, n_columns), -1)
        near = np.flatnonzero(self._column >= 0)
        self._number[self.pairs.one[near], self._column[near]] = near

    @property
    def untold(self) -> str:
        """Which bodies Coal says nothing of, in words; "" where there is none."""
        return self._shapes.untold(self.pairs.names)

    def near(
        self,
        trajectory: Trajectory,
        room: float,
        travel: float = 0.0,
        deadline: Deadline = NO_LIMIT,
    ) -> Iterator[CoalDistances]:
        """Measure links near what they are looked for at, then each such pair unseen.

        Args:
            trajectory: The rows.
            room: Measure where the coarse bound is at most this larger than the
                required clearance; inf for all; [m].
            travel: Look at one row of each stretch in which the joint centres move by
                this much; 0 for every row; [m].
            deadline: When to give up.

        Yields:
            Distances in the order of the rows; last the pairs that were not measured,
            each at the row where its coarse bound is least; of more than `MANY`
            obstacles each with the link that is nearest then.

        Raises:
            OutOfTime: If the time is over.
        """
        for row, pair in self._near(trajectory, room, travel, deadline):
            yield from self._at(trajectory, row, pair, deadline)

    def spread(
        self, trajectory: Trajectory, deadline: Deadline = NO_LIMIT
    ) -> Iterator[CoalDistances]:
        """Measure the other pairs, of what is carried or moves, at rows all over.

        Raises:
            OutOfTime: If the time is over.
        """
        others = np.flatnonzero(self._column < 0)
        rows = np.linspace(0, trajectory.n_samples - 1, SPREAD).astype(np.int64)
        for row in distinct(rows) if others.size else ():
            yield from self._at(trajectory, np.full(others.size, row), others, deadline)

    def _at(
        self, trajectory: Trajectory, row: IntArray, pair: IntArray, deadline: Deadline
    ) -> Iterator[CoalDistances]:
        """Measure pairs at rows, shape (m,) each, some at a time."""
        for first in range(0, len(pair), CHUNK_PAIRS):
            deadline.check()
            part = slice(first, first + CHUNK_PAIRS)
            yield self.measured(trajectory, row[part].astype(np.float64), pair[part])

    def measured(
        self, trajectory: Trajectory, moments: FloatArray, pair: IntArray
    ) -> CoalDistances:
        """Ask both about pairs at moments in waypoints, shape (m,) each."""
        rows, place = np.unique(moments, return_inverse=True)
        now, poses = self._placed(trajectory, rows)
        one, other = self.pairs.one[pair], self.pairs.other[pair]
        found = self._shapes.distances(poses, Sides(place, one, other))
        lower, upper = self._brackets(
            self._axes(*now), Sides(place, one, self._column[pair])
        )
        return CoalDistances(moments, pair, found, lower, upper)

    def witness(self, trajectory: Trajectory, row: int, pair: int) -> Witness:
        """Where Coal has a pair nearest at a row, which it tells a distance of."""
        _, poses = self._placed(trajectory, np.array([float(row)]))
        one, other = self.pairs.one[[pair]], self.pairs.other[[pair]]
        return self._shapes.witness(poses, Sides(np.zeros(1, np.int64), one, other))

    def _placed(
        self, trajectory: Trajectory, moments: FloatArray
    ) -> tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
        """x0, alpha and theta at moments in waypoints, and the poses of the frames."""
        joints = trajectory.path.at_moments(moments)
        now = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
        return now, self._poses(now, trajectory.times_at(moments))

    def _near(
        self, trajectory: Trajectory, room: float, travel: float, deadline: Deadline
    ) -> Iterator[tuple[IntArray, IntArray]]:
        """Rows and pairs within reach, then one row of each other pair."""
        problem, apart = self.problem, self._number >= 0
        if not apart.any():
            return
        reach = np.full(apart.shape[1], problem.required_self_clearance + room)
        reach[: self._n_rest] = problem.required_clearance + room
        least = np.full(apart.shape, np.inf)
        nearest = np.zeros(least.shape, dtype=np.int64)
        seen, moved = ~apart, _Moved(travel)
        step = max(1, CHUNK_BOUNDS // least.size)
        for first in range(0, trajectory.n_samples, step):
            deadline.check()
            part = trajectory.joints[first : first + step]
            axes = self._axes(part[:, 0], part[:, 1::2], part[:, 2::2])
            bounds = self._bounds(axes)
            here = np.argmin(bounds, axis=0)
            value = np.take_along_axis(bounds, here[None], axis=0)[0]
            nearer = value < least
            least[nearer], nearest[nearer] = value[nearer], here[nearer] + first
            within = (bounds <= reach) & moved(axes)[:, None, None] & apart
            seen |= within.any(axis=0)
            row, link, column = np.nonzero(within)
            yield first + row, self._number[link, column]
        if self._n_rest > MANY:  # of the far ones the nearest link alone
            far = least[:, : self._n_rest]
            nearest_link = np.argmin(far, axis=0)
            seen[:, : self._n_rest] |= np.arange(len(far))[:, None] != nearest_link
        yield nearest[~seen], self._number[~seen]

    def _bounds(self, axes: FloatArray) -> FloatArray:
        """Lower bounds of the clearance of links and tool, (n, n_axes, n_columns)."""
        found = []
        if self._n_rest:
            found.append(coarse_bounds(self._pieces, axes, self._radii))
        if self._number.shape[1] > self._n_rest:
            found.append(link_gaps(axes, self._radii))
        return np.concatenate(found, axis=2)

    def _brackets(
        self, axes: FloatArray, sides: Sides
    ) -> tuple[FloatArray, FloatArray]:
        """Both bounds of links and columns at some of these rows; [m]."""
        place, link, column = sides
        lower, upper = np.full((2, link.size), [[-np.inf], [np.inf]])
        rest = np.flatnonzero((column >= 0) & (column < self._n_rest))
        if rest.size:
            at, own = place[rest], link[rest]
            ends = np.stack([axes[at, own], axes[at, own + 1]], axis=1)
            goal = TOLERANCES.bracket_gap
            found = row_brackets(self._pieces, ends, column[rest], goal)
            lower[rest], upper[rest] = (found - self._radii[own, None]).T
        links = np.flatnonzero(column >= self._n_rest)
        if links.size:
            partner = column[links] - self._n_rest
            gaps = link_gaps(axes, self._radii)[place[links], link[links], partner]
            lower[links] = upper[links] = gaps
        return lower, upper

    def _axes(self, x0: FloatArray, alpha: FloatArray, theta: FloatArray) -> FloatArray:
        """Ends of the links and of the tool at rows, (n, n_axes + 1, 3); [m]."""
        arm = self.problem.manipulator
        return np.ascontiguousarray(arm.axes(joint_centres(arm, x0, alpha, theta)))

    def _poses(
        self, now: tuple[FloatArray, FloatArray, FloatArray], times: FloatArray | None
    ) -> FloatArray:
        """T_base_frame of the tree's frames, by Pinocchio, (n_rows, n_frames, 3, 4).

        Those between yaw and pitch of a joint carry nothing; the feed's does not turn.
        """
        n, asked = self.problem.manipulator.n_links, self._asked
        poses = np.zeros((len(now[0]), asked.tree.n_frames, 3, 4))
        poses[..., :3] = np.eye(3)
        links = self._model.poses(*now)[:, :n]
        poses[:, link_frame(0), :, 3] = links[:, 0, :, 3]
        poses[:, link_frame(1) : link_frame(n) + 1 : 2] = links
        for body, one in enumerate(asked.scene.obstacles, start=len(asked.own)):
            if isinstance(one, Moving) and times is not None:
                poses[:, asked.bodies[body].frame] = one.poses(times)[:, :3]
        return poses


class _Moved:
    """Picks the first row of each stretch of a motion, part after part.

    Args:
        travel: Joint centres move by this much in a stretch; 0 for every row; [m].
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
