"""The desired path against the tip: how far it strays and how much it draws."""

from bisect import bisect_right
from itertools import pairwise

from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import column, norm
from vdsm_pin.problem.desired_path import DesiredPath


class Drawing:
    """The desired path, and what the tip has drawn of it so far.

    A station is an arc length. On a closed path stations go on past the seam, on an
    open one those beyond an end stand for the end.
    """

    def __init__(self, path: DesiredPath) -> None:
        self.closed = path.closed and len(path.points) > 1
        self.corners = [column(*point) for point in path.points.tolist()]
        self.corners += self.corners[:1] if self.closed else []
        self.stations = [arb(0)]
        for a, b in pairwise(self.corners):
            self.stations.append(self.stations[-1] + norm(b - a))
        self.length, self.deviation = self.stations[-1], arb(0)
        self.stretches: list[tuple[arb, arb]] = []
        self.last: arb | None = None  # station of the row before; None off the path
        self.here: arb | None = None  # station of the latest row on the path
        # How far drawn from the first row on the path; how far the latest lies behind.
        self.farthest = self.behind = arb(0)
        self.left = False  # whether rows off the path lie in between
        self.looks = looks = path.pointing
        self.target = None if looks is None else looks.target
        self.aims = list[arb_mat]()  # where the last link shall look at each corner
        if looks is not None and looks.directions is not None:
            self.aims = [column(*one) for one in looks.directions.tolist()]
            self.aims *= len(self.corners) if len(self.aims) == 1 else 1

    def laps(self, station: arb) -> int:
        """Whole laps in a station; the nearest number where that is not certain."""
        laps = station / self.length if self.closed else arb(0)
        whole = laps.floor().unique_fmpz()
        return round(float(laps)) if whole is None else int(whole)

    def local(self, station: arb) -> arb:
        """The station within [0, length]."""
        if self.closed:
            return station - self.laps(station) * self.length
        return station.max(arb(0)).min(self.length)

    def point(self, station: arb) -> arb_mat:
        """The point of the path at a station."""
        return self._blend(self.corners, station)

    def aim(self, station: arb, tip: arb_mat) -> arb_mat:
        """Along which the last link shall look there, of any length."""
        if self.target is None:
            return self._blend(self.aims, station)
        return column(*self.target.tolist()) - tip

    def _blend(self, values: list[arb_mat], station: arb) -> arb_mat:
        """Vectors given at the corners, straight from each to the next one."""
        s, last = self.local(station), len(self.corners) - 2
        if last < 0:
            return values[0]
        i = min(max(bisect_right(self.stations, s) - 1, 0), last)
        a, b = values[i : i + 2]
        return a + (b - a) * ((s - self.stations[i]) / self._side(i))

    def _side(self, i: int) -> arb:
        return norm(self.corners[i + 1] - self.corners[i])

    @property
    def steepest(self) -> arb:
        """How much the aim changes at most per length of path."""
        found = arb(0)
        for i, (a, b) in enumerate(pairwise(self.aims)):
            found = found.max(norm(b - a) / self._side(i))
        return found

    def step(self, a: arb, b: arb) -> arb:
        """How far an interval between two stations advances.

        The shorter way round; forwards where both are as long, as at an exact tie.
        """
        if not self.closed:
            return self.local(b) - self.local(a)
        return (b - a) + self.laps(self.length / 2 - (b - a)) * self.length

    def visit(self, station: arb, joined: bool, same: arb) -> arb:
        """Take in a row on the path; rows come in the order of the motion.

        Args:
            station: Its path_m; [m].
            joined: Whether the row before it is on the path as well.
            same: Stations no farther apart are the same place; [m].

        Returns:
            How far the row lies beyond all on the path before it; where the tip has
            left a closed path in between, on the way forward; [m].
        """
        last, self.here = self.here, station
        if last is None:
            return arb(0)
        advance = self.step(last, station)
        if self.closed and not joined:
            advance = self.local(station - last)
            if self.length - advance <= same:  # a hair backwards is not once round
                advance -= self.length
        self.left |= not joined
        ahead = advance - self.behind
        self.behind = (-ahead).max(arb(0))
        self.farthest += ahead + self.behind
        return ahead

    def draw(self, begin: arb, run: arb, tips: list[arb_mat], bend: arb) -> None:
        """Take in an interval with both rows on the path, or a part of one.

        Args:
            begin: Station where it begins if none was taken in just before; [m].
            run: How far it advances, as `step` has it; [m].
            tips: The tip at both ends.
            bend: How far it may lie off the chord in between; [m].
        """
        start = begin if self.last is None else self.last
        stop = start + run
        if self.last is None:
            self.stretches.append((start, start))
        low, high = self.stretches[-1]
        self.stretches[-1], self.last = (low.min(stop), high.max(stop)), stop
        worst = norm(tips[0] - self.point(start)).max(norm(tips[1] - self.point(stop)))
        for station, corner in self._corners(start.min(stop), start.max(stop)):
            part = (station - start) / (stop - start)
            worst = worst.max(norm(tips[0] + (tips[1] - tips[0]) * part - corner))
        self.deviation = self.deviation.max(worst + bend)

    def _corners(self, low: arb, high: arb) -> list[tuple[arb, arb_mat]]:
        """The corners between two stations."""
        found = []
        for lap in range(self.laps(low), self.laps(high) + 1):
            shift = lap * self.length
            for k in range(bisect_right(self.stations, low - shift), len(self.corners)):
                if not self.stations[k] + shift < high:
                    break
                found.append((self.stations[k] + shift, self.corners[k]))
        return found

    def coverage(self) -> arb:
        """Share of the path in the union of the stretches; never above the true one."""
        parts = []
        for low, high in self.stretches:
            start, size = self.local(low), high - low
            parts += [(start, start + size), (arb(0), start + size - self.length)]
        total, reached = arb(0), arb(0)
        for start, stop in sorted(parts, key=lambda part: float(part[0])):
            # Only what lies beyond everything before it is added: none counts twice.
            total += (stop.min(self.length) - start.max(reached)).max(arb(0))
            reached = reached.max(stop)
        return total / self.length if self.length > 0 else arb(self.here is not None)
