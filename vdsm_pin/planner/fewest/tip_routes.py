"""Ways of the tip through the openings of a scene, the widest first, then the shortest.

The cheapest way through the cells of an octree (`tip_cells`) is pulled to the middle of
the openings (`elastic_band`). Another way avoids places where an arm got stuck, or else
the narrowest of the ways before. These are proposals for the search of the arm's
motion: nothing is proved here.
"""

from collections.abc import Iterator
from copy import copy
from itertools import islice
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.broad_phase import BroadPhase
from vdsm_pin.planner.feasibility import curled_reach
from vdsm_pin.planner.fewest.elastic_band import (
    LONG_PULL,
    SHORT_PULL,
    is_followed,
    pulled,
    refined,
    resampled,
    shortened,
)
from vdsm_pin.planner.fewest.tip_cells import TipCells, TipRoom
from vdsm_pin.planner.start import start_centres
from vdsm_pin.planner.tip_curve import own_curve
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import angles_between
from vdsm_pin.tolerances import TOLERANCES

LONGER: Final = 3
"""Times as many cells as before after which a longer pull of the last way comes before
another way; [-]."""


class TipSpace:
    """Where the tip can be, and ways through it, each looked for once.

    Args:
        problem: Arm and limits.
        clearance: The clearance function, exact also where it is too small.
        required: Clearance that the tip must keep; [m].
        spacing: Largest distance of the points of a way; [m].
        most: Cells at which the search for a way ends.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        clearance: BroadPhase,
        required: float,
        spacing: float,
        most: int,
    ) -> None:
        self.arm, self.start = problem.manipulator, problem.path.start
        self.spacing, self.most = spacing, most
        centres = start_centres(problem)
        self.behind = self._lain(np.concatenate([centres[-1:], own_curve(centres)]))
        self.room = TipRoom(self.arm, clearance, required)
        self.stuck: list[FloatArray] = []
        self.known: dict[bytes, list[FloatArray]] = {}
        self.searches: dict[bytes, Iterator[FloatArray]] = {}
        self.begun: dict[bytes, tuple[TipCells, FloatArray | None]] = {}

    def _lain(self, curve: FloatArray) -> FloatArray:
        """Points on what an arm lies on, from behind its tip to a link's length back.

        Args:
            curve: From the tip on, shape (k, 3); [m].
        """
        points = resampled(curve, self.spacing)
        step = float(np.linalg.norm(np.diff(points[:2], axis=0)))
        count = int(np.ceil(self.arm.link_lengths.max() / step))
        return points[1 : count + 1]

    def begun_at(self, start: FloatArray) -> "TipSpace":
        """The same from another start, shape (3,); what is avoided is so in both."""
        other = copy(self)
        other.start = start
        far = self.arm.total_length * np.eye(3)[:1]
        other.behind = self._lain(np.concatenate([start[None], start - far]))
        other.known, other.searches, other.begun = {}, {}, {}
        return other

    def routes(self, goal: FloatArray, most: int) -> Iterator[FloatArray]:
        """Ways of the tip from the start to a goal, the best first.

        Args:
            goal: Where they end, shape (3,); [m].
            most: Largest number of ways.

        Yields:
            Points, shape (k, 3), both ends included; [m].
        """
        key = goal.tobytes()
        known = self.known.setdefault(key, [])
        search = self.searches.setdefault(key, self._search(goal))
        for number in range(most):
            if number == len(known):
                known.extend(islice(search, 1))
            if number == len(known):
                return
            yield known[number]

    def leads_to(self, goal: FloatArray, most: int) -> bool:
        """Whether so many cells are enough for a clear way to a goal, shape (3,)."""
        if not (self.start != goal).any():
            return True
        way = self._begun(goal, min(most, self.most))[1]
        return way is not None and bool((self.room.spare(way[:-1], way[1:]) >= 0).all())

    def _begun(self, goal: FloatArray, most: int) -> tuple[TipCells, FloatArray | None]:
        """Cells halved so far that a way to a goal is known, if any, and that way."""
        key = goal.tobytes()
        if key not in self.begun:
            self.begun[key] = self._cells(np.stack([self.start, goal])), None
        cells, route = self.begun[key]
        if route is None and cells.codes.size <= most:
            cells.avoided = self.stuck
            route = cells.cheapest(self.start, goal, most)
            self.begun[key] = cells, route
        return cells, route

    def _search(self, goal: FloatArray) -> Iterator[FloatArray]:
        """Ways to a goal without end, as long as there are any."""
        start = self.start
        if not (start != goal).any():
            yield start[None]
            return
        cells, route = self._begun(goal, self.most)
        narrow, before = list[FloatArray](), list[FloatArray]()
        shortest = False
        while route is not None:
            short = resampled(shortened(self.room, route), self.spacing)
            way = self._pulled(short, SHORT_PULL)
            stuck = len(self.stuck)
            yield way
            # A longer pull comes after another way.
            if before:
                yield self._pulled(before.pop(), LONG_PULL)
            if not is_followed(self.room, way, self.behind):
                before.append(short)
            if len(self.stuck) == stuck:
                narrow.append(self.room.narrowest(way))
            cells.avoided = [*narrow, *self.stuck]
            # What is wide may be a detour on which the arm cannot follow.
            shortest = not shortest
            few = min(LONGER * cells.codes.size, self.most)
            route = cells.cheapest(start, goal, few, shortest)
            if route is None and before:
                yield self._pulled(before.pop(), LONG_PULL)
            if route is None:
                route = cells.cheapest(start, goal, self.most, shortest)
        for short in before:
            yield self._pulled(short, LONG_PULL)

    def _pulled(self, short: FloatArray, effort: tuple[int, int]) -> FloatArray:
        """A way pulled to the middle of openings, and refined there."""
        way = pulled(self.room, short, self.behind, effort=effort)
        way = resampled(way, self.spacing)
        return refined(self.room, way, self.behind, effort)

    def avoid(self, place: FloatArray) -> None:
        """Have ways that are looked for from now on avoid a place, shape (3,); [m]."""
        self.stuck.append(place)

    def swing(self, goal: FloatArray) -> Iterator[FloatArray]:
        """The route round the rail, no straighter than a base with a short rail lets.

        Direction and distance from the middle of the rail change steadily. Obstacles
        are not looked at: the arm is.

        Args:
            goal: Where it ends, shape (3,); [m].

        Yields:
            Points, shape (k, 3), both ends included; none for a rail as long as the
            arm; [m].
        """
        low, high = self.arm.base_range
        if high - low >= self.arm.total_length:
            return
        pivot = np.array([(low + high) / 2.0, 0.0, 0.0])
        sides = np.stack([self.start, goal]) - pivot
        far = np.linalg.norm(sides, axis=1)
        angle = float(angles_between(sides[:1], sides[1:])[0])
        if not 0.0 < angle < np.pi - TOLERANCES.joint_limit:
            return
        count = int(np.ceil(far.max() * angle / self.spacing))
        part = np.linspace(0.0, 1.0, count + 1)[:, None]
        ends = sides / far[:, None]
        turned = np.sin((1.0 - part) * angle) * ends[0] + np.sin(part * angle) * ends[1]
        size = (1.0 - part) * far[0] + part * far[1]
        points = pivot + size * turned / np.sin(angle)
        points[0], points[-1] = self.start, goal
        yield points

    def _cells(self, ends: FloatArray) -> TipCells:
        """Cells over the places a tip can be that may be worth a way between these."""
        low, high = self.arm.base_range
        reach, length = curled_reach(self.arm), self.arm.total_length
        low = max(low - length, float(ends[:, 0].min()) - length)
        high = min(high + length, float(ends[:, 0].max()) + length)
        side = max(high - low, 2.0 * reach)
        corner = np.array([low, -side / 2.0, -side / 2.0])
        return TipCells(self.room, self.most, corner, side)
