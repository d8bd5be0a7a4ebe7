"""One obstacle across the rail, prismatic along Z or Y (obs3): one bend or two.

Seen along the obstacle (from the top for Z, from the front for Y), the arm passes its
section on one side. Where the straight arm would meet it, one joint moves along the
auxiliary line, or the two ends of one link, which so is laid past the obstacle; the
rest follow in proportion between O_1, these joints and the tip (paper, 6.1: "adjusted
in proportion between the first boundary and the second boundary"). The link laid past
it is one link all the way, or of the two links at a joint the one that is beside the
obstacle: the further the joint is before its middle, the more the end of the link
behind the joint moves along, up to as much as the joint. Of all the choice with the
smallest link angle is taken, and of those with the same one that which moves the joints
least, as the paper takes the nearest point. The arm keeps its side all the way: to
change it, it would have to withdraw.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from vdsm_pin.errors import PathBlocked
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.paper.bend_kernels import (
    Bends,
    Passing,
    clear_bends,
    least_moves,
)
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.lift import largest_angles, lift
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.scale import scale
from vdsm_pin.planner.paper.sections import (
    VIEWS,
    Passed,
    grown_by,
    hull_corners,
    planned_gap,
)
from vdsm_pin.planner.paper.tip_path import (
    Route,
    RowOf2D,
    drawn_rows,
    straight_route,
)
from vdsm_pin.problem.planning_problem import PlanningProblem

TRIAL_ROWS: Final = 200
"""Waypoints on which the bends are compared: of 48, 0.1 deg may be between rows."""

ALIKE: Final = float(np.deg2rad(0.1))
"""A largest link angle that is more by so little is as good as the least; [rad]."""


@dataclass(frozen=True)
class AcrossRail:
    """A complete choice for Steps 4 and 5.

    Args:
        problem: What was asked.
        region: The danger region in the view (x, w), with everything behind it on
            the side the arm must not pass.
        axis: 0 where w is y, 1 where w is z.
        side: The arm passes at larger w (1) or at smaller w (-1).
        bends: The joint that moves, 2..N, or the two at the ends of a link, or a
            joint between its neighbours, of which one moves more than in proportion.
        margins: Kept beyond the required clearance by each link, shape (N,); [m].
        growths: How far the region is grown for each link, no less, shape (N,); [m].
        obstacles: Numbers in the scene of those that are gone round.
    """

    problem: PlanningProblem
    region: DangerRegion
    axis: int
    side: int
    bends: tuple[int, ...]
    margins: FloatArray
    growths: FloatArray
    obstacles: tuple[int, ...]

    @property
    def passed(self) -> str:
        """Names of the obstacles that are gone round."""
        return self.region.name

    def route(self, missing: float) -> Route:
        """Step 4: as without obstacles; the tip itself must stay clear."""
        route = replace(straight_route(self.problem.path), notes=(self._told,))
        points = route.tip_path.points[:, [0, 1 + self.axis]]
        inside = self.region.grown(self.growths[-1]).contains(points)
        if inside.any():
            waypoint = int(np.argmax(inside))
            reason = (
                f"the tip would be in its danger region at waypoint {waypoint}; this "
                "rule leads the arm round an obstacle across the rail, not the tip"
            )
            raise PathBlocked(obstacle=self.region.name, reason=reason)
        return route

    @property
    def _told(self) -> str:
        name = self.region.name
        if len(self.bends) == 1:
            return f"joint {self.bends[0]} bends to pass {name!r}, the others follow"
        if len(self.bends) == 2:
            return (
                f"link {self.bends[0]} is laid past {name!r}: joints {self.bends[0]} "
                f"and {self.bends[1]} bend, the others follow"
            )
        before, joint, after = self.bends
        return (
            f"link {before} or {joint}, the one beside {name!r}, is laid past it: "
            f"joint {joint} bends and {before} or {after}, the others follow"
        )

    def clearance(self, centres: FloatArray) -> float:
        """From the section and its lee, taken as endless, less the margins."""
        chains = np.ascontiguousarray(centres[..., [0, 1 + self.axis]])
        reserve = self.region.radius - planned_gap(self.problem)
        distance = self.region.link_distances(chains) - self.margins
        return float(distance.min()) - reserve

    def joints(self, route: Route, reference: FloatArray) -> FloatArray:
        """Step 5: the bends move as little as clears the region.

        Raises:
            PathBlocked: If they cannot lead the arm round the obstacle.
        """
        return self.bent(reference, route.tip_path.points[:, 0])

    def bent(self, reference: FloatArray, tip_x: FloatArray) -> FloatArray:
        """Projections of arms whose bends have moved, shape (n, N + 1, 2); [m].

        Args:
            reference: Projections of the joints without obstacle, the same shape; [m].
            tip_x: Tip positions along the rail, shape (n,); [m].

        Raises:
            PathBlocked: If the bends cannot lead the arm round the obstacle.
        """
        planar = reference.copy()
        blocked = np.flatnonzero(~self.clear(reference, tip_x))
        if len(blocked):
            planar[blocked] = self._cleared(reference[blocked], tip_x[blocked])
        return planar

    def _cleared(self, reference: FloatArray, tip_x: FloatArray) -> FloatArray:
        """The bends moved clear, as `reference`; [m].

        Raises:
            PathBlocked: If they cannot lead the arm round the obstacle.
        """
        shares = self.shares(reference, tip_x)
        farthest = self._farthest(reference) / shares[:, 0]
        bends = self._arms(reference, tip_x, shares)
        moves = np.asarray(least_moves(self._passing, bends, farthest))
        if np.isnan(moves).any():
            row = int(np.argmax(np.isnan(moves)))
            tip = np.array([tip_x[row], *reference[row, -1]])
            joints = " and ".join(f"joint {joint}" for joint in self.bends)
            reason = (
                f"{joints} cannot lead the arm round it within the limit of psi_1 with "
                f"the tip at {self.problem.in_file(tip)}"
            )
            raise PathBlocked(obstacle=self.region.name, reason=reason)
        return self.moved(reference, moves[:, None] * shares)

    def shares(self, reference: FloatArray, tip_x: FloatArray) -> FloatArray:
        """Part of the move that each of the bends makes, shape (n, k).

        All of it, but for three bends: the neighbours of the joint in the middle move
        in proportion, and more where the link to them is beside the obstacle.
        """
        shares = np.ones((len(reference), len(self.bends)))
        if len(self.bends) == 3:
            stations = self.problem.manipulator.stations
            ahead, end = stations[self._ends[1:-1]], stations[-1]
            in_part = ahead[0] / ahead[1], (end - ahead[2]) / (end - ahead[1])
            beyond = self._beyond(reference, tip_x)
            for k, part, by in ((0, in_part[0], beyond), (2, in_part[1], -beyond)):
                shares[:, k] = part + (1.0 - part) * np.maximum(by, 0.0)
        return shares

    def _beyond(self, reference: FloatArray, tip_x: FloatArray) -> FloatArray:
        """How far joint j, bending alone, is beyond the middle, in body radii, (n,)."""
        joint = self.bends[1]
        alone = replace(self, bends=(joint,), growths=self.margins)
        bends = alone._arms(reference, tip_x, np.ones((len(reference), 1)))
        farthest = alone._farthest(reference)
        moves = np.asarray(least_moves(alone._passing, bends, farthest))
        moves = np.where(np.isnan(moves), farthest, moves)
        planar = alone.moved(reference, moves[:, None])
        gap = np.linalg.norm(planar[:, -1] - planar[:, joint - 1], axis=1)
        square = alone._passing.lengths[-1] ** 2 - gap**2
        x = tip_x - np.sqrt(np.maximum(square, 0.0))
        corners = self.region.corners[:, 0]
        middle = 0.5 * (corners.min() + corners.max())
        reach = self.problem.manipulator.most_radius
        return np.asarray(np.clip((x - middle) / reach, -1.0, 1.0))

    def _farthest(self, reference: FloatArray) -> FloatArray:
        """Largest move to their side that leaves psi_1 within its cone, (n,); [m]."""
        manipulator, first = self.problem.manipulator, self.bends[0] - 1
        at = reference[:, first]
        cone = np.sin(manipulator.max_link_angle)
        reach = manipulator.stations[first] * cone
        along, across = at[:, self.axis], at[:, 1 - self.axis]
        room = np.sqrt(np.maximum(reach**2 - across**2, 0.0))
        return np.asarray(self.side * room - along)

    def moved(self, reference: FloatArray, moves: FloatArray) -> FloatArray:
        """Bends moved, the others in proportion, as `reference`; [m].

        Args:
            reference: The arms before, shape (n, N + 1, 2); [m].
            moves: Of each of the bends, shape (n, k); [m].
        """
        stations = self.problem.manipulator.stations
        hats = np.eye(len(self._ends))[1:-1]
        parts = [np.interp(stations, stations[self._ends], hat) for hat in hats]
        planar = reference.copy()
        planar[..., self.axis] += moves @ np.stack(parts)
        return planar

    def clear(self, planar: FloatArray, tip_x: FloatArray) -> BoolArray:
        """Whether the arm of straight pieces stays out of the region, (n,)."""
        shares = np.ones((len(planar), len(self.bends)))
        return clear_bends(self._passing, self._arms(planar, tip_x, shares))

    def _arms(self, planar: FloatArray, tip_x: FloatArray, shares: FloatArray) -> Bends:
        """The arms by the joints that move and their tips."""
        knots = np.ascontiguousarray(planar[:, self._ends[1:-1]])
        return Bends(knots, planar[:, -1], tip_x, shares)

    @cached_property
    def _passing(self) -> Passing:
        margins = [self.growths[a:b].max() for a, b in pairwise(self._ends)]
        radii = self.region.radius + np.array(margins)
        lengths = np.diff(self.problem.manipulator.stations[self._ends])
        return Passing(self.region.corners, radii, lengths, self.axis)

    def grown(self, growths: FloatArray) -> "AcrossRail":
        """The same with the danger region grown for each link, shape (N,); [m]."""
        return replace(self, growths=growths)

    def sliding(self, side: int, link: int) -> list[tuple[int, ...]]:
        """The joints that bend, whatever the link: the others follow in proportion."""
        return [self.bends]

    def slid(self, row: RowOf2D, joints: tuple[int, ...], by: float) -> RowOf2D:
        """The waypoint with those that bend farther to their side; [m]."""
        arm, tip_x = self.problem.manipulator, np.array([row.tip_x])
        shares = self.shares(scale(arm, row.planar[None, -1]), tip_x)
        return row._replace(
            planar=self.moved(row.planar[None], self.side * by * shares)[0]
        )

    def growth_to(self, row: RowOf2D, link: int, joints: tuple[int, ...]) -> float:
        """The region reaches the straight piece that the link is a part of; [m]."""
        tip_x = np.array([row.tip_x])
        centres = lift(self.problem.manipulator, row.planar[None], tip_x)
        gaps = self.region.link_distances(centres[..., [0, 1 + self.axis]])[0]
        piece = next(slice(a, b) for a, b in pairwise(self._ends) if a < link <= b)
        return float(gaps[piece].min()) - self.region.radius

    @cached_property
    def _ends(self) -> list[int]:
        """Rows of the joints between which the arm is straight."""
        bends = (bend - 1 for bend in self.bends)
        return [0, *bends, self.problem.manipulator.n_links]

    def costs(self, points: FloatArray) -> tuple[float, float]:
        """The largest link angle with the tip at points, and how far joints move.

        Both are infinite where there is no way. The link angles follow from the
        directions of the straight pieces.

        Args:
            points: Shape (n, 3); [m].

        Returns:
            The angle [rad], and the mean move of all joints [m].
        """
        reference, tip_x = (
            scale(self.problem.manipulator, project(points)),
            points[:, 0],
        )
        try:
            planar = self.bent(reference, tip_x)
        except PathBlocked:
            return np.inf, np.inf
        angles = largest_angles(planar[:, self._ends], self._passing.lengths)
        moves = np.linalg.norm(planar - reference, axis=2)
        return float(angles.max()), float(moves.mean())


def across_rail(
    problem: PlanningProblem, passed: Passed, axis: str, margins: FloatArray
) -> Iterator[AcrossRail]:
    """Choices for one obstacle prismatic along Y or Z, the least bent first.

    Args:
        problem: What was asked.
        passed: The obstacle and its section in the view (x, w).
        axis: "y" or "z", along which it is prismatic.
        margins: Kept beyond the required clearance by each link, shape (N,); [m].
    """
    manipulator = problem.manipulator
    growth, section = grown_by(problem), passed.section
    which = VIEWS[axis][1] - 1
    points = drawn_rows(problem.path, 0.0).points
    points = points[:: max(1, len(points) // TRIAL_ROWS)]
    joints = range(2, manipulator.n_links + 1)
    beside = [(joint - 1, joint, joint + 1) for joint in joints[1:-1]]
    bends = [*beside, *((joint,) for joint in joints), *pairwise(joints)]
    # The side nearer to the rail first: from there the straight arm comes.
    first = -1 if section.middle[1] > 0.0 else 1
    for side in (first, -first):
        region = _with_lee(section, growth, side, problem)
        choices = [
            AcrossRail(
                problem, region, which, side, some, margins, margins, passed.obstacles
            )
            for some in bends
        ]
        costs = np.array([choice.costs(points) for choice in choices])
        yield from (choices[k] for k in _ranked(costs))


def _ranked(costs: FloatArray) -> IntArray:
    """Choices in order, by their largest link angle and mean move, shape (n, 2).

    Of those whose angle is as good as the least the one whose joints move least is
    first; the others follow by their angles.
    """
    angle, moved = costs.T
    alike = angle <= angle.min() + ALIKE
    return np.lexsort([np.where(alike, moved, angle), ~alike])


def _with_lee(
    section: DangerRegion, growth: float, side: int, problem: PlanningProblem
) -> DangerRegion:
    """The section drawn out to beyond the arm's reach on the side not to be passed."""
    far = 4.0 * problem.manipulator.total_length
    drawn_out = section.corners - np.array([0.0, side * far])
    corners = hull_corners(np.vstack([section.corners, drawn_out]))
    return replace(section, corners=corners).grown(growth)
