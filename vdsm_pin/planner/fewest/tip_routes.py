"""Ways of the tip through the openings of a scene, the widest first.

Space is cut into the cells of an octree. A cell costs its size, and more the narrower
it is there for the body; where nobody knows yet, it is thought wide. Dijkstra's
cheapest way is halved cell by cell until all of it is known to be clear. It is then
pulled to the middle of the openings. A second way avoids the narrowest place of the
first, and where an arm got stuck. These are proposals for the search of the arm's
motion: nothing is proved here.
"""

from collections.abc import Iterator
from itertools import islice
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.feasibility import curled_reach
from vdsm_pin.planner.impossible.octree import (
    DEPTH,
    Octree,
    adjoining,
    doubt_to,
    holders,
)
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import angles_between
from vdsm_pin.tolerances import TOLERANCES

LEAST: Final = 0.05
"""Cells smaller than this part of the body's radius are not halved; [-]."""
NARROW: Final = 0.3
"""Room below this part of the body's radius makes a way costly; [-]."""
DETOUR: Final = 0.01
"""Doubtful cells on ways that cost so much more than the best are halved too; [-]."""
LONGEST: Final = 2.0
"""Length of a way, over the arm's, from which on that is no more; [-]."""
MORE: Final = 5.0
"""How many times more that is at the largest number of cells; [-]."""
AVOIDED: Final = 30.0
"""Cost of the cells near a place to be avoided, in their own, for each time that it is;
[-]."""
AROUND: Final = 3.0
"""How near that is, over the body's radius; [-]."""
CAP: Final = 0.6
"""Room below this part of what is narrow costs no more; [-]."""
PULLS: Final = 30
"""Rounds of pulling a way to the middle of its openings."""
SHIFTS: Final = 8
"""Places tried for each point in a round by chance."""
SIZES: Final = (0.5, 0.2, 0.1)
"""How far away they are, round after round, over the body's radius; [-]."""
FINER: Final = (0.05, 0.02, 0.01)
"""The same where it is narrow; [-]."""
CHORDS: Final = 2.0
"""What a way is worth more for chords with all the room that is worth having; [-]."""
STEEP: Final = 0.85
"""Part of the largest link angle that a way may bend by from chord to chord; [-]."""
STEEP_COST: Final = 4.0
"""What a way is worse for each part of that angle that it bends more; [-]."""
BOW: Final = 0.2
"""Part of the room of a narrow place that the way between two points may bow; [-]."""


class _Cells(Octree):
    """Cells over all places a tip can be.

    Args:
        space: Clearance function and limits.
        corner: Lowest corner of the whole, shape (3,); [m].
        side: Side of the whole; [m].
    """

    def __init__(self, space: "TipSpace", corner: FloatArray, side: float) -> None:
        self.clearance, self.required = space.clearance, space.required
        self.radius, self.most = space.arm.most_radius, space.most
        self.reach = curled_reach(space.arm)
        self.longest = LONGEST * space.arm.total_length
        self.avoided: list[FloatArray] = []
        super().__init__(corner, side)

    def look(self, codes: IntArray, levels: IntArray) -> tuple[FloatArray]:
        """What the tip has to spare at the centre of each cell, shape (n,); [m]."""
        centre, half = self.boxes(codes, levels)
        clearances = (
            self.clearance(np.stack([centre, centre], axis=1))[:, 0] - self.required
        )
        # From within a solid a tip that is clear is at least so far away.
        clearances = np.maximum(clearances, -self.radius - self.required)
        out = np.hypot(centre[:, 1], centre[:, 2]) - self.reach
        clearances[out > np.sqrt(2.0) * half] = -np.inf
        return (np.asarray(clearances),)

    def costs(self) -> tuple[FloatArray, BoolArray]:
        """Cost of passing each cell, inf where it is shut; whether it is in doubt."""
        centre, half = self.boxes(self.codes, self.levels)
        (clearances,), radius = self.known, np.sqrt(3.0) * half
        shut = clearances + radius < 0.0
        doubt = ~shut & (clearances < half) & (half > LEAST * self.radius)
        shut |= ~doubt & (clearances < 0.0)
        # A cell in doubt is taken for as wide as it may be.
        clearances = np.where(doubt, clearances + radius, clearances)
        narrow = NARROW * self.radius
        cost = 2.0 * half * (1.0 + (narrow / np.maximum(clearances, CAP * narrow)) ** 2)
        around = AROUND * self.radius + half
        times = np.zeros(len(half))
        for place in self.avoided:
            times += np.linalg.norm(centre - place, axis=1) < around
        cost *= np.where(doubt | (times == 0.0), 1.0, AVOIDED * times)
        return np.where(shut, np.inf, cost), doubt

    def holders(self, points: FloatArray) -> IntArray:
        """Cells that hold points within the whole, shape (n,)."""
        place = (points - self.corner) / self.side * 2.0**DEPTH
        return holders(self.codes, np.clip(place, 0, 2**DEPTH - 1).astype(np.int64))

    def cheapest(self, start: FloatArray, goal: FloatArray) -> FloatArray | None:
        """Points on the cheapest way that is clear, shape (k, 3); None without one."""
        while True:
            cost, doubt = self.costs()
            ends = self.holders(np.stack([start, goal]))
            open_ = np.isfinite(cost)
            open_[ends] = True
            cost[ends] = np.where(np.isfinite(cost[ends]), cost[ends], 0.0)
            first, neighbours = adjoining(self.codes, self.levels, open_)
            there = doubt_to(ends[:1], first, neighbours, cost)
            best = float(there[ends[1]])
            if not np.isfinite(best):
                return None
            back = doubt_to(ends[1:], first, neighbours, cost)
            # The more cells there are, the more are halved at once.
            detour = DETOUR * (1.0 + MORE * self.codes.size / self.most)
            detour *= min(best, self.longest)
            halved = doubt & (there + back <= best + detour + cost)
            route = self._traced(int(ends[1]), int(ends[0]), there, first, neighbours)
            if not doubt[route].any():
                points = np.vstack([start, self._through(route), goal])
                halved = self._blocked(route, points)
                if not halved.any():
                    return points
            if self.codes.size > self.most:
                return None
            self.split(np.flatnonzero(halved))

    def _blocked(self, route: IntArray, points: FloatArray) -> BoolArray:
        """Cells to halve, as a way through them is blocked near a corner of theirs.

        Args:
            route: Cells of the way, shape (k,).
            points: Where it enters and leaves them, shape (k + 1, 3); [m].
        """
        lines = np.stack([points[:-1], points[1:]], axis=1)
        near = self.clearance(lines)[:, 0] < self.required
        half = self.side / 2.0 ** (self.levels[route] + 1.0)
        picked = np.zeros(self.codes.size, dtype=np.bool_)
        picked[route[near & (half > LEAST * self.radius)]] = True
        return picked

    def _through(self, route: IntArray) -> FloatArray:
        """Centres of the faces that a way passes, shape (k - 1, 3); [m]."""
        centre, half = self.boxes(self.codes[route], self.levels[route])
        low = np.maximum((centre - half[:, None])[:-1], (centre - half[:, None])[1:])
        high = np.minimum((centre + half[:, None])[:-1], (centre + half[:, None])[1:])
        return np.asarray((low + high) / 2.0)

    @staticmethod
    def _traced(
        at: int, to: int, there: FloatArray, first: IntArray, neighbours: IntArray
    ) -> IntArray:
        """Cells of the way that a search found, from its source on."""
        route = [at]
        while route[-1] != to:
            near = neighbours[first[route[-1]] : first[route[-1] + 1]]
            route.append(int(near[np.argmin(there[near])]))
        return np.array(route[::-1])


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
        clearance: LinkClearance,
        required: float,
        spacing: float,
        most: int,
    ) -> None:
        self.arm, self.start = problem.manipulator, problem.path.start
        self.clearance, self.required = clearance, required
        self.spacing, self.most = spacing, most
        self.stuck: list[FloatArray] = []
        self.known: dict[bytes, list[FloatArray]] = {}
        self.searches: dict[bytes, Iterator[FloatArray]] = {}

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

    def _search(self, goal: FloatArray) -> Iterator[FloatArray]:
        """Ways to a goal without end, as long as there are any."""
        start = self.start
        if not (start != goal).any():
            yield start[None]
            return
        cells, narrow = self._cells(np.stack([start, goal])), list[FloatArray]()
        cells.avoided = self.stuck
        while (route := cells.cheapest(start, goal)) is not None:
            route = resampled(self._shortened(route), self.spacing)
            route = self._pulled(route, SIZES)
            yield self._refined(resampled(route, self.spacing))
            narrow.append(self._narrowest(route))
            cells.avoided = [*narrow, *self.stuck]

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

    def _cells(self, ends: FloatArray) -> _Cells:
        """Cells over the places a tip can be that may be worth a way between these."""
        low, high = self.arm.base_range
        reach, length = curled_reach(self.arm), self.arm.total_length
        low = max(low - length, float(ends[:, 0].min()) - length)
        high = min(high + length, float(ends[:, 0].max()) + length)
        side = max(high - low, 2.0 * reach)
        corner = np.array([low, -side / 2.0, -side / 2.0])
        return _Cells(self, corner, side)

    def _spare(self, points: FloatArray, ends: FloatArray | None = None) -> FloatArray:
        """What the tip has to spare at points, or on lines to ends, shape (n,); [m]."""
        ends = points if ends is None else ends
        clearances = self.clearance(np.stack([points, ends], axis=1))[:, 0]
        return np.asarray(clearances - self.required)

    def _narrowest(self, route: FloatArray) -> FloatArray:
        """The inner place of a route with the least clearance, shape (3,)."""
        inner = route[1:-1] if len(route) > 2 else route
        return np.asarray(inner[int(np.argmin(self._spare(inner)))])

    def _shortened(self, route: FloatArray) -> FloatArray:
        """A way with corners cut where that leaves as much room as is worth having.

        Args:
            route: Shape (k, 3); [m].
        """
        worth = NARROW * self.arm.most_radius
        own = np.minimum(self._spare(route[:-1], route[1:]), worth)
        kept, last = [0], len(route) - 1
        while kept[-1] < last:
            at = kept[-1]
            begins = np.broadcast_to(route[at], (last - at, 3))
            room = self._spare(begins, route[at + 1 :])
            good = room >= np.maximum(np.minimum.accumulate(own[at:]), 0.0)
            kept.append(at + 1 + int(np.flatnonzero(good).max(initial=0)))
        return route[kept]

    def _refined(self, route: FloatArray) -> FloatArray:
        """A way with points so close, where it is narrow, that an arm can follow it.

        A way that bends as much as the arm can bows between two points at a distance h
        by h^2 / 8 R.

        Args:
            route: Shape (k, 3); [m].
        """
        spare = np.maximum(self._spare(route), LEAST * self.arm.most_radius)
        radius = self.arm.link_lengths.max() / (
            2.0 * np.sin(self.arm.max_link_angle / 2.0)
        )
        step = np.sqrt(8.0 * radius * BOW * np.minimum(spare[:-1], spare[1:]))
        sides = np.linalg.norm(np.diff(route, axis=0), axis=1)
        counts = np.maximum(1, np.ceil(sides / step).astype(np.int64))
        if (counts == 1).all():
            return route
        at = np.repeat(np.arange(len(counts)), counts)
        part = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        part = (part / counts[at])[:, None]
        finer = (1.0 - part) * route[at] + part * route[at + 1]
        return self._pulled(np.vstack([finer, route[-1:]]), FINER)

    def _pulled(self, route: FloatArray, sizes: tuple[float, ...]) -> FloatArray:
        """A way straightened, and in the middle where it is narrow (elastic band).

        Args:
            route: Shape (k, 3), its ends stay; [m].
            sizes: How far away places are tried, over the body's radius; [-].
        """
        rng, route = np.random.default_rng(len(route)), route.copy()
        for round_ in range(PULLS):
            size = self.arm.most_radius * sizes[round_ % len(sizes)]
            for parity in (1, 2):
                inner = np.arange(parity, len(route) - 1, 2)
                if len(inner):
                    shifts = rng.normal(size=(len(inner), SHIFTS, 3)) * size
                    route[inner] = self._better(route, inner, shifts)
        return route

    def _better(
        self, route: FloatArray, inner: IntArray, shifts: FloatArray
    ) -> FloatArray:
        """The best of some places for every other point of a way, shape (n, 3).

        An arm that follows a way lays its links as chords on it, which bow to the
        inside of a bend: a place is the better the more room the chords have that end
        there, and the less one turns against the other.
        """
        middle = (route[inner - 1] + route[inner + 1])[:, None] / 2.0
        own, radius = route[inner][:, None], self.arm.most_radius
        tried = np.concatenate([own, (own + middle) / 2.0, middle, own + shifts], 1)
        shape, places = tried.shape[:2], tried.reshape(-1, 3)
        back, ahead = (
            np.repeat(ends, shape[1], axis=0) for ends in self._chords(route, inner)
        )
        spare = self._spare(places).reshape(shape)
        wide = np.minimum(spare / (NARROW * radius), 1.0)
        score = np.where(spare > 0.0, 2.0 * wide, 10.0 * (wide - 1.0))
        room = np.minimum(self._spare(places, back), self._spare(places, ahead))
        room = np.clip(room.reshape(shape) / (NARROW * radius), -1.0, 1.0)
        turn = angles_between(places - back, ahead - places).reshape(shape)
        steep = np.maximum(0.0, turn / self.arm.max_link_angle - STEEP)
        bow = np.linalg.norm(tried - middle, axis=2) / radius
        score += CHORDS * room - bow - STEEP_COST * steep
        return np.asarray(tried[np.arange(len(inner)), score.argmax(axis=1)])

    def _chords(
        self, route: FloatArray, inner: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Points of a way a link before and behind others, shape (n, 3) each; [m].

        The link is the longest that passes there on the way.
        """
        sides = np.linalg.norm(np.diff(route, axis=0), axis=1)
        along = np.append(0.0, np.cumsum(sides))
        back = self.arm.link_lengths[::-1]
        behind = np.append(0.0, np.cumsum(back)[:-1])
        at = along[inner]
        passing = np.searchsorted(behind, along[-1] - at, side="right") - 1
        link = np.maximum.accumulate(back)[passing]
        first = np.minimum(np.searchsorted(along, at - link), inner - 1)
        last = np.clip(np.searchsorted(along, at + link), inner + 1, len(route) - 1)
        return route[first], route[last]


def resampled(route: FloatArray, spacing: float) -> FloatArray:
    """Points along a polyline, evenly at most `spacing` apart, ends kept; [m]."""
    route = route[np.append(True, np.linalg.norm(np.diff(route, axis=0), axis=1) > 0.0)]
    if len(route) < 2:
        return route
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(route, axis=0), axis=1)))
    marks = np.linspace(0.0, along[-1], 1 + max(1, int(np.ceil(along[-1] / spacing))))
    return np.stack([np.interp(marks, along, column) for column in route.T], axis=1)
