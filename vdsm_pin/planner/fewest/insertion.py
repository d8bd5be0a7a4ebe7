"""Motions in by the openings of a scene, along the path, and out again.

The tip's route from the start to the path is sought alone (`tip_routes`); the arm is
grown along it and on along the path (`growth`). Where it gets stuck, it draws back the
way it came, and goes in again to where it left the path, by another route or in another
posture. What cannot be drawn at all is skipped.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.fewest.added_nodes import checked_start
from vdsm_pin.planner.fewest.charts import DIRECTIONS, OFFSETS, standing
from vdsm_pin.planner.fewest.growth import Grown, Layers, Population
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.levels import Insert
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.route import TipRoute, tip_route
from vdsm_pin.planner.fewest.search import Found
from vdsm_pin.planner.fewest.stuck import Stuck
from vdsm_pin.planner.fewest.tip_routes import TipSpace
from vdsm_pin.planner.path_rows import PathRows
from vdsm_pin.planner.spacing import stepped
from vdsm_pin.planner.start import start_centres
from vdsm_pin.planner.tip_curve import led_along, way_back
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.time_limit import NO_LIMIT, Deadline

TIP_TOLERANCE: Final = 0.3
"""How far the tip may be from its way off the path, over the body's radius; [-]."""
LATER_LAYERS: Final = (3, 8, 20)
"""Layers ahead of a place of the path by way of which it is come to."""
TURNING: Final = 12
"""Layers before the path from which on the arm turns to where it shall look there."""
FAILURES: Final = 3
"""Places of the path at which the arm is not got in before the search gives up."""


@dataclass(frozen=True)
class _Visit:
    """A motion from the start to the path and along it.

    Args:
        first: Layer of the path at which it begins to draw.
        before: Layers of the chain that come before that one.
        chain: The motion.
        route: Of the tip to the path, shape (k, 3); [m].
    """

    first: int
    before: int
    chain: Grown
    route: FloatArray

    @property
    def come(self) -> tuple[int, float]:
        """How far it came: layer of the path, part of the way to the path."""
        reached = float(self.chain.layer[-1])
        return self.last, min(1.0, reached / max(self.before, 1))

    @property
    def last(self) -> int:
        """Layer of the path up to which it draws, -1 if it does not come there."""
        drawn = int(self.chain.layer[-1]) - self.before
        return self.first + drawn if drawn >= 0 else -1


def insert(
    judge: Judge,
    space: TipSpace,
    rows: PathRows,
    undrawable: BoolArray,
    level: Insert,
    soon: Deadline = NO_LIMIT,
) -> tuple[Found | None, Stuck | None]:
    """A motion that draws what it can, going in as often as it takes.

    Args:
        judge: Says what is clear.
        space: Has the ways of the tip.
        rows: The desired path row by row.
        undrawable: Rows that nobody can reach, shape (r,).
        level: How thoroughly to look.
        soon: From when on what is not drawn yet is skipped, if something is drawn.

    Returns:
        The motion, None if nothing is drawn, and where the visit that came farthest
        ended, None if there is no way for the tip.

    Raises:
        LimitExceeded: If the start breaks a limit.
    """
    step = level.step * judge.problem.manipulator.total_length
    route = tip_route(judge.problem, rows, undrawable, step, 0.0)
    search = _Visits(judge, space, route, level)
    return search.found(soon), search.stuck()


class _Visits:
    """The visits of one route."""

    def __init__(
        self, judge: Judge, space: TipSpace, route: TipRoute, level: Insert
    ) -> None:
        self.judge, self.space = judge, space
        self.route, self.level = route, level
        self.tips = route.tips[route.layers]
        chart = DIRECTIONS if level.directed else OFFSETS
        self.root = checked_start(judge, route.tips[:1], chart)
        self.back = way_back(start_centres(judge.problem))
        self.outside = space.begun_at(self.back[-1])
        self.rng = np.random.default_rng(level.seed)
        self.farthest: _Visit | None = None
        self.leans_back = False

    def found(self, soon: Deadline) -> Found | None:
        """Visits until the path's end is reached or too many are in vain."""
        visits: list[_Visit] = []
        skipped: list[int] = []
        k, failures, last, begin = 0, 0, len(self.tips) - 1, 0
        # Where a part of the path is no answer, nobody need look for one.
        most = 1 if self.judge.problem.path.blocked is Blocked.FAIL else FAILURES
        while k < last:
            over = failures == most or self.leans_back or (visits and soon.passed)
            if self.route.undrawable[k + 1] or over:
                k += 1
                skipped.append(k)
                begin = k
                continue
            visit = self._visit(k)
            if visit is None or visit.last <= k:
                failures += 1
                k += 1
                skipped.append(k)
                continue
            whole = self._back_to(visit, begin) if begin < k else None
            if whole is not None:
                visit, skipped = whole, skipped[: begin - k]
            visits.append(visit)
            k = begin = visit.last
        if not visits:
            return None
        return Found(self.route, self._corners(visits), tuple(skipped))

    def stuck(self) -> Stuck | None:
        """Where the visit that came farthest ended."""
        visit = self.farthest
        if visit is None:
            return None
        arm, last = self.judge.problem.manipulator, visit.chain
        centres = standing(arm, last.tips[-1:], last.offsets[-1:])[0]
        come = 1 + min(int(visit.chain.layer[-1]), visit.before)
        return Stuck(visit.route, come, centres)

    def _visit(self, k: int) -> _Visit | None:
        """The visit that draws most from layer k on."""
        best: _Visit | None = None
        path = self._path(k)
        for route in self._routes(path):
            if best is None and self._leans_back(route):
                self.leans_back = True
                return None
            visit = self._grown(k, route)
            if self.farthest is None or visit.come > self.farthest.come:
                self.farthest = visit
            if best is None or visit.last > best.last:
                best = visit
            if best.last == k + len(path) - 1:
                break
            if best.last < k:
                reached = int(visit.chain.layer[-1])
                self.space.avoid(route[min(reached + 1, visit.before)])
        return best

    def _leans_back(self, route: FloatArray) -> bool:
        """Whether links that follow a way in lean backwards: no projections say so.

        An insertion by directions comes next, which takes the same ways.
        """
        if self.level.directed:
            return False
        arm = self.judge.problem.manipulator
        laid = led_along(route, start_centres(self.judge.problem), arm.link_lengths)
        return bool((np.diff(laid[:, :, 0], axis=1) <= 0.0).any())

    def _back_to(self, visit: _Visit, first: int) -> _Visit | None:
        """A visit that draws as far, and from an earlier layer, come to by the later.

        An arm that got in at a later place draws back to where it did not get in.
        """
        back = self.tips[first : visit.first][::-1]
        whole = self._grown(first, np.vstack([visit.route, back]))
        return whole if whole.last >= visit.last else None

    def _path(self, k: int) -> FloatArray:
        """Tips from a layer on to the next that nobody can reach, shape (n, 3); [m]."""
        ends = np.flatnonzero(self.route.undrawable[k + 1 :])
        return self.tips[k : k + 1 + int(ends[0]) if len(ends) else len(self.tips)]

    def _grown(self, k: int, route: FloatArray) -> _Visit:
        """The visit by one way of the tip, shape (n, 3) [m], to layer k and on."""
        path, before = self._path(k), len(route) - 1
        tolerance = np.zeros(before + len(path))
        tolerance[1:before] = TIP_TOLERANCE * self.judge.problem.manipulator.most_radius
        tips = np.vstack([route, path[1:]])
        layers = Layers(tips, tolerance, *self._aims(k, before, tips))
        population = Population(
            self.judge, layers, self.rng, self.level.population, self.level.led
        )
        chain = population.grow(self.root[None], self.level.backtracks)
        return _Visit(k, before, chain, route)

    def _aims(
        self, k: int, before: int, tips: FloatArray
    ) -> tuple[FloatArray | None, FloatArray | None]:
        """Where the last link shall look at layers, and how much that counts.

        Args:
            k: Layer of the path that comes after those of the way in.
            before: Number of these.
            tips: Of all layers, shape (l, 3); [m].
        """
        path = self.judge.problem.path
        if path.pointing is None:
            return None, None
        number = np.arange(len(tips))
        stations = self.route.stations[k + np.maximum(number - before, 0)]
        weight = np.clip(1.0 + (number - before) / TURNING, 0.0, 1.0)
        return path.aims(tips, stations), weight

    def _routes(self, path: FloatArray) -> Iterator[FloatArray]:
        """Ways of the tip to a path's first point, first the one that is stated.

        The second one found comes from where the last link looks as it shall. Last
        those by way of points after it: who comes from there arrives in a posture that
        goes on to there. An arm that starts bent also draws back until it is straight,
        and goes in from there.
        """
        stated = self.judge.problem.path.insertion
        if len(stated) and (path[0] == self.tips[0]).all():
            way = np.vstack([self.back[-1:], stated, path[:1]])
            way = way[np.append(True, (np.diff(way, axis=0) != 0.0).any(axis=1))]
            points, _ = stepped(way, self.space.spacing)
            yield np.vstack([self.back, points[1:]])
        ways = self.space.routes(path[0], self.level.routes)
        yield from islice(ways, 1)
        yield from self._looking(path[0])
        yield from ways
        yield from self.space.swing(path[0])
        if len(self.back) > 1:
            for route in self.outside.routes(path[0], 1):
                yield np.vstack([self.back, route[1:]])
        for ahead in LATER_LAYERS:
            if ahead < len(path):
                for route in self.space.routes(path[ahead], 1):
                    yield np.vstack([route, path[ahead - 1 :: -1]])

    def _looking(self, goal: FloatArray) -> Iterator[FloatArray]:
        """A way to a point that ends along where the last link shall look there."""
        path = self.judge.problem.path
        if path.pointing is None:
            return
        station = self.route.stations[(self.tips == goal).all(axis=1)][:1]
        aim = path.aims(goal[None], station)[0]
        if not np.isfinite(aim).all():
            return
        length = float(self.judge.problem.manipulator.link_lengths[-1])
        before = goal - length / float(np.linalg.norm(aim)) * aim
        for route in self.space.routes(before, 1):
            points, _ = stepped(np.stack([before, goal]), self.space.spacing)
            yield np.vstack([route, points[1:]])

    def _corners(self, visits: list[_Visit]) -> Corners:
        """The visits one after the other, out by the way in after all but the last."""
        stations, first = self.route.stations, visits[0]
        tips, offsets = [first.chain.tips[:1]], [first.chain.offsets[:1]]
        at, drawn = [stations[first.first : first.first + 1]], [np.zeros(0, np.bool_)]
        left = first.first
        for visit in visits:
            chain = visit.chain
            place = visit.first + chain.layer - visit.before
            on = place >= visit.first
            tips.append(chain.tips[1:])
            offsets.append(chain.offsets[1:])
            at.append(stations[np.where(on, place, left)][1:])
            drawn.append(on[:-1] & on[1:])
            left = visit.last
            if visit is not visits[-1]:
                tips.append(chain.tips[-2::-1])
                offsets.append(chain.offsets[-2::-1])
                at.append(np.full(len(on) - 1, stations[left]))
                drawn.append(np.zeros(len(on) - 1, dtype=np.bool_))
        return Corners(
            np.concatenate(tips), np.concatenate(offsets), np.concatenate(at),
            np.concatenate(drawn),
        )  # fmt: skip
