"""One obstacle across the rail, prismatic along Z or Y (obs3): one bend or two.

Seen along the obstacle (from the top for Z, from the front for Y), the arm passes its
section on one side. Where the straight arm would meet it, one joint moves along the
auxiliary line, or the two ends of one link, which so is laid past the obstacle; the
rest follow in proportion between O_1, these joints and the tip (paper, 6.1: "adjusted
in proportion between the first boundary and the second boundary"). Of all the choice
with the smallest link angle is taken. The arm keeps its side all the way: to change
it, it would have to withdraw.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from vdsm_pin.errors import PathBlocked
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.paper.bend_kernels import Bends, Passing, clear_bends, least_moves
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.lift import largest_angles
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.scale import scale
from vdsm_pin.planner.paper.sections import VIEWS, grown_by, hull_corners, planned_gap
from vdsm_pin.planner.paper.tip_path import Route, drawn_rows, straight_route
from vdsm_pin.problem.planning_problem import PlanningProblem

TRIAL_ROWS: Final = 48
"""Waypoints on which the bends are compared."""


@dataclass(frozen=True)
class AcrossRail:
    """A complete choice for Steps 4 and 5.

    Args:
        problem: What was asked.
        region: The danger region in the view (x, w), with everything behind it on
            the side the arm must not pass.
        axis: 0 where w is y, 1 where w is z.
        side: The arm passes at larger w (1) or at smaller w (-1).
        bends: The joint that moves, 2..N, or the two at the ends of a link.
        margins: How far the region is grown for each link, shape (N,); [m].
    """

    problem: PlanningProblem
    region: DangerRegion
    axis: int
    side: int
    bends: tuple[int, ...]
    margins: FloatArray

    @property
    def passed(self) -> str:
        """Names of the obstacles that are gone round."""
        return self.region.name

    def route(self, missing: float) -> Route:
        """Step 4: as without obstacles; the tip itself must stay clear."""
        route = replace(straight_route(self.problem.path), notes=(self._told,))
        points = route.tip_path.points[:, [0, 1 + self.axis]]
        inside = self.region.grown(self.margins[-1]).contains(points)
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
        return (
            f"link {self.bends[0]} is laid past {name!r}: joints {self.bends[0]} and "
            f"{self.bends[1]} bend, the others follow"
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
            move = self._least_move(reference[blocked], tip_x[blocked])
            planar[blocked] = self._moved(reference[blocked], move)
        return planar

    def _least_move(self, reference: FloatArray, tip_x: FloatArray) -> FloatArray:
        """Smallest move of the bends that clears the region, signed, (n,); [m]."""
        farthest = self._farthest(reference)
        bends = self._arms(reference, tip_x)
        moves = least_moves(self._passing, bends, farthest)
        if np.isnan(moves).any():
            row = int(np.argmax(np.isnan(moves)))
            tip = np.array([tip_x[row], *reference[row, -1]])
            joints = " and ".join(f"joint {joint}" for joint in self.bends)
            reason = (
                f"{joints} cannot lead the arm round it within the limit of psi_1 with "
                f"the tip at {self.problem.in_file(tip)}"
            )
            raise PathBlocked(obstacle=self.region.name, reason=reason)
        return np.asarray(moves)

    def _farthest(self, reference: FloatArray) -> FloatArray:
        """Largest move to their side that leaves psi_1 within its cone, (n,); [m]."""
        manipulator, first = self.problem.manipulator, self.bends[0] - 1
        at = reference[:, first]
        cone = np.sin(manipulator.max_link_angle)
        reach = manipulator.stations[first] * cone
        along, across = at[:, self.axis], at[:, 1 - self.axis]
        room = np.sqrt(np.maximum(reach**2 - across**2, 0.0))
        return np.asarray(self.side * room - along)

    def _moved(self, reference: FloatArray, move: FloatArray) -> FloatArray:
        """Bends moved, the others in proportion, as `reference`; [m]."""
        stations = self.problem.manipulator.stations
        knots = stations[self._ends]
        part = np.interp(stations, knots, [0.0, *[1.0] * len(self.bends), 0.0])
        planar = reference.copy()
        planar[..., self.axis] += move[:, None] * part
        return planar

    def clear(self, planar: FloatArray, tip_x: FloatArray) -> BoolArray:
        """Whether the arm of straight pieces stays out of the region, (n,)."""
        return clear_bends(self._passing, self._arms(planar, tip_x))

    def _arms(self, planar: FloatArray, tip_x: FloatArray) -> Bends:
        """The arms by the joints that move and their tips."""
        knots = np.ascontiguousarray(planar[:, self._ends[1:-1]])
        return Bends(knots, planar[:, -1], tip_x)

    @cached_property
    def _passing(self) -> Passing:
        margins = [self.margins[a:b].max() for a, b in pairwise(self._ends)]
        radii = self.region.radius + np.array(margins)
        lengths = np.diff(self.problem.manipulator.stations[self._ends])
        return Passing(self.region.corners, radii, lengths, self.axis)

    @cached_property
    def _ends(self) -> list[int]:
        """Rows of the joints between which the arm is straight."""
        bends = (bend - 1 for bend in self.bends)
        return [0, *bends, self.problem.manipulator.n_links]

    def largest_angle(self, points: FloatArray) -> float:
        """Largest link angle with the tip at points; infinite where there is none.

        The link angles follow from the directions of the straight pieces.

        Args:
            points: Shape (n, 3); [m].

        Returns:
            The angle; [rad].
        """
        manipulator = self.problem.manipulator
        reference, tip_x = scale(manipulator, project(points)), points[:, 0]
        blocked = ~self.clear(reference, tip_x)
        try:
            move = self._least_move(reference[blocked], tip_x[blocked])
            planar = self._moved(reference[blocked], move)
        except PathBlocked:
            return np.inf
        angles = largest_angles(planar[:, self._ends], self._passing.lengths)
        return float(angles.max(initial=0.0))


def across_rail(
    problem: PlanningProblem, section: DangerRegion, axis: str, margins: FloatArray
) -> Iterator[AcrossRail]:
    """Choices for one obstacle prismatic along Y or Z, the least bent first.

    Args:
        problem: What was asked.
        section: The obstacle's section in the view (x, w).
        axis: "y" or "z", along which it is prismatic.
        margins: Kept beyond the required clearance by each link, shape (N,); [m].
    """
    manipulator = problem.manipulator
    growth = grown_by(problem)
    which = VIEWS[axis][1] - 1
    points = drawn_rows(problem.path, 0.0).points
    points = points[:: max(1, len(points) // TRIAL_ROWS)]
    joints = range(2, manipulator.n_links + 1)
    bends = [*((joint,) for joint in joints), *pairwise(joints)]
    # The side nearer to the rail first: from there the straight arm comes.
    first = -1 if section.middle[1] > 0.0 else 1
    for side in (first, -first):
        region = _with_lee(section, growth, side, problem)
        choices = [
            AcrossRail(problem, region, which, side, some, margins) for some in bends
        ]
        yield from sorted(choices, key=lambda choice: choice.largest_angle(points))


def _with_lee(
    section: DangerRegion, growth: float, side: int, problem: PlanningProblem
) -> DangerRegion:
    """The section drawn out to beyond the arm's reach on the side not to be passed."""
    far = 4.0 * problem.manipulator.total_length
    drawn_out = section.corners - np.array([0.0, side * far])
    corners = hull_corners(np.vstack([section.corners, drawn_out]))
    return replace(section, corners=corners).grown(growth)
