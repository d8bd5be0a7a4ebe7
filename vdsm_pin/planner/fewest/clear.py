"""Whether a motion in the chart keeps clearance and limits, asked as rarely as can be.

Clearance changes no faster than the body moves: an interval whose ends are clear by
more than half the way between them needs no further look. The rest is halved. This is a
planner's check; the proof over continuous time is the verifier's.
"""

from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.motion import Intervals
from vdsm_pin.planner.fewest.poses import (
    bends_of,
    farthest_moved,
    least_of,
    pieces_of,
)
from vdsm_pin.planner.fewest.roadmap import link_limit
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

HALVINGS: Final = 16
"""Halvings of an interval; the body moves 65,536 times less in what is left then."""
LONG_WAY: Final = 0.2
"""Way of the body above which the middle is looked at whatever the clearance; [m]."""


class Judge:
    """Asks the clearance function about places of a motion.

    Args:
        problem: Arm and limits.
        clearance: The clearance function.
        margin: Kept beyond the required clearance; [m].
        slack: Kept for what happens between two rows; [m].
        finest: Way of the body below which an interval between two clear
            configurations counts as clear; [m].
        ease: Part of the largest link angle that may be used; [-].
        rough: For single configurations, where less exactness will do; None: the same.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        clearance: LinkClearance,
        margin: float,
        slack: float,
        finest: float,
        ease: float = 1.0,
        rough: LinkClearance | None = None,
    ) -> None:
        self.problem, self.clearance = problem, clearance
        self.rough = clearance if rough is None else rough
        self.required = problem.required_clearance + margin + slack
        self.slack, self.finest = slack, finest
        self.limit = ease * link_limit(problem)

    def look(
        self, tips: FloatArray, offsets: FloatArray
    ) -> tuple[FloatArray, IntArray, FloatArray]:
        """Clearance, changed angles and largest angle of configurations.

        Args:
            tips: Shape (n, 3); [m].
            offsets: Shape (n, N + 1, 2); [m].

        Returns:
            Least clearance, -inf where a limit is broken, shape (n,) [m]; number of
            changed link angles, (n,); largest link angle, (n,) [rad].
        """
        still = Intervals(tips, tips, offsets, offsets)
        knees = still.knees(self.problem.manipulator)
        number, share = np.arange(len(tips)), np.zeros(len(tips))
        most = np.full(len(tips), self.limit)
        centres, room = self._states(still, knees, number, share, most, self.rough)
        angles = bends_of(centres)
        changed = (angles > TOLERANCES.changed_angle).sum(axis=1)
        return room, changed, angles.max(axis=1)

    def bends(self, tips: FloatArray, offsets: FloatArray) -> FloatArray:
        """Link angles of configurations, shape (n, N); [rad]."""
        still = Intervals(tips, tips, offsets, offsets)
        number, share = np.arange(len(tips)), np.zeros(len(tips))
        return bends_of(still.centres(self.problem.manipulator, number, share))

    def _states(
        self,
        intervals: Intervals,
        knees: BoolArray,
        interval: IntArray,
        share: FloatArray,
        most: FloatArray,
        clearance: LinkClearance,
    ) -> tuple[FloatArray, FloatArray]:
        """Joint centres and clearance, -inf where a limit is broken.

        Links in line between two knees are measured as one.
        """
        manipulator = self.problem.manipulator
        centres = intervals.centres(manipulator, interval, share)
        peak = bends_of(centres).max(axis=1)
        base = centres[:, 0, 0]
        low, high = manipulator.base_range
        fine = (peak <= most) & (base >= low) & (base <= high)
        pieces, first = pieces_of(centres, knees, interval, fine)
        room = clearance(pieces)[:, 0] if len(pieces) else np.zeros(0)
        return centres, least_of(room, first, -np.inf)

    def clear(
        self,
        intervals: Intervals,
        required: FloatArray | None = None,
        bend: FloatArray | None = None,
    ) -> BoolArray:
        """Which intervals are clear, shape (n,); see `measured`."""
        return self.measured(intervals, required, bend)[0]

    def measured(
        self,
        intervals: Intervals,
        required: FloatArray | None = None,
        bend: FloatArray | None = None,
    ) -> tuple[BoolArray, FloatArray]:
        """Which intervals are clear, and the clearance where they begin.

        Args:
            intervals: Straight lines in the chart.
            required: Clearance to keep in each interval; [m].
            bend: Largest link angle in each interval; [rad].

        Returns:
            Shape (n,) each; the clearance is -inf where a limit is broken; [m].
        """
        count, tol = len(intervals.tips), TOLERANCES.on_boundary
        ask = self.clearance
        need = np.full(count, self.required) if required is None else required
        most = np.full(count, self.limit)
        if bend is not None:
            most = np.minimum(most, bend + tol)
        knees = intervals.knees(self.problem.manipulator)
        number, low, high = np.arange(count), np.zeros(count), np.ones(count)
        c0, begin = self._states(intervals, knees, number, low, most, ask)
        c1, r1 = np.roll(c0, -1, axis=0), np.roll(begin, -1)
        ends = np.flatnonzero(~intervals.continued())
        c1[ends], r1[ends] = self._states(
            intervals, knees, ends, high[ends], most[ends], ask
        )
        good = (begin >= need - tol) & (r1 >= need - tol)
        halves = _Halves(number, low, high, c0, c1, begin, r1)
        for _ in range(HALVINGS):
            halves = halves.take(good[halves.interval])
            halves = halves.take(halves.open(need, self.finest))
            if not len(halves.interval):
                return good, begin
            where, middle = halves.interval, (halves.low + halves.high) / 2.0
            cm, rm = self._states(intervals, knees, where, middle, most[where], ask)
            good[where[~(rm >= need[where] - tol)]] = False
            halves = halves.cut(middle, cm, rm)
        # What is not settled after all halvings is not known to be clear.
        good[halves.interval] = False
        return good, begin


@dataclass(frozen=True)
class _Halves:
    """Parts of intervals with both ends looked at: where, joint centres, clearance."""

    interval: IntArray
    low: FloatArray
    high: FloatArray
    centres: FloatArray
    next_centres: FloatArray
    room: FloatArray
    next_room: FloatArray

    def open(self, need: FloatArray, finest: float) -> BoolArray:
        """Which parts may not be clear between their ends."""
        way = farthest_moved(self.centres, self.next_centres)
        least = (self.room + self.next_room - way) / 2.0
        doubtful = (least < need[self.interval]) & (way > finest)
        # A long part may hide a bend or a curve: look at its middle anyway.
        return np.asarray(doubtful | (way > LONG_WAY))

    def take(self, kept: BoolArray) -> "_Halves":
        """Some of the parts."""
        return _Halves(*(getattr(self, one.name)[kept] for one in fields(self)))

    def cut(
        self, middle: FloatArray, centres: FloatArray, room: FloatArray
    ) -> "_Halves":
        """Every part in two."""
        return _Halves(
            np.concatenate([self.interval, self.interval]),
            np.concatenate([self.low, middle]),
            np.concatenate([middle, self.high]),
            np.concatenate([self.centres, centres]),
            np.concatenate([centres, self.next_centres]),
            np.concatenate([self.room, room]),
            np.concatenate([room, self.next_room]),
        )
