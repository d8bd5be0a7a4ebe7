"""Whether a motion in the chart keeps clearance and limits, asked as rarely as can be.

Clearance changes no faster than the body moves: an interval whose ends are clear by
more than half the way between them needs no further look. The rest is halved. This is a
planner's check; the proof over continuous time is the verifier's.
"""

from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.motion import Intervals, link_angles_at
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
    """

    def __init__(
        self,
        problem: PlanningProblem,
        clearance: LinkClearance,
        margin: float,
        slack: float,
        finest: float,
        ease: float = 1.0,
    ) -> None:
        self.problem, self.clearance = problem, clearance
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
        number = np.arange(len(tips))
        centres, room = self._states(
            still, number, np.zeros(len(tips)), np.full(len(tips), np.inf)
        )
        angles = link_angles_at(centres)
        changed = (angles > TOLERANCES.changed_angle).sum(axis=1)
        return room, changed, angles.max(axis=1)

    def bends(self, tips: FloatArray, offsets: FloatArray) -> FloatArray:
        """Link angles of configurations, shape (n, N); [rad]."""
        still = Intervals(tips, tips, offsets, offsets)
        number = np.arange(len(tips))
        manipulator = self.problem.manipulator
        centres = still.centres(manipulator, number, np.zeros(len(tips)))
        return link_angles_at(centres)

    def _states(
        self,
        intervals: Intervals,
        interval: IntArray,
        share: FloatArray,
        bend: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Joint centres and clearance, -inf where a limit is broken."""
        manipulator = self.problem.manipulator
        centres = intervals.centres(manipulator, interval, share)
        peak = link_angles_at(centres).max(axis=1)
        base = centres[:, 0, 0]
        low, high = manipulator.base_range
        fine = (peak <= np.minimum(self.limit, bend)) & (base >= low) & (base <= high)
        room = np.full(len(fine), -np.inf)
        kept = np.flatnonzero(fine)
        knees = intervals.knees(manipulator)
        room[kept] = self._room(centres[kept], knees[interval[kept]])
        return centres, room

    def _room(self, centres: FloatArray, knees: BoolArray) -> FloatArray:
        """Least clearance; links in line between two knees are measured as one."""
        room = np.full(len(centres), np.inf)
        counts = knees.sum(axis=1)
        for count in np.unique(counts):
            rows = np.flatnonzero(counts == count)
            joints = np.nonzero(knees[rows])[1].reshape(len(rows), count)
            pieces = centres[rows[:, None], joints]
            room[rows] = self.clearance(np.ascontiguousarray(pieces)).min(axis=1)
        return room

    def clear(
        self,
        intervals: Intervals,
        required: FloatArray | None = None,
        bend: FloatArray | None = None,
    ) -> BoolArray:
        """Which intervals are clear, shape (n,).

        Args:
            intervals: Straight lines in the chart.
            required: Clearance to keep in each interval; [m].
            bend: Largest link angle in each interval; [rad].
        """
        count = len(intervals.tips)
        need = np.full(count, self.required) if required is None else required
        most = np.full(count, np.inf) if bend is None else bend
        number = np.arange(count)
        low, high = np.zeros(count), np.ones(count)
        good = np.ones(count, dtype=np.bool_)
        tol = TOLERANCES.on_boundary
        c0, r0 = self._states(intervals, number, low, most + tol)
        c1, r1 = np.roll(c0, -1, axis=0), np.roll(r0, -1)
        ends = np.flatnonzero(~intervals.continued())
        c1[ends], r1[ends] = self._states(intervals, ends, high[ends], most[ends] + tol)
        good &= (r0 >= need - tol) & (r1 >= need - tol)
        number, low, high = number[good], low[good], high[good]
        c0, c1, r0, r1 = c0[good], c1[good], r0[good], r1[good]
        for _ in range(HALVINGS):
            way = np.linalg.norm(c1 - c0, axis=2).max(axis=1)
            need_here = need[number]
            least = (r0 + r1 - way) / 2.0
            open_ = (least < need_here) & (way > self.finest)
            # A long interval may hide a bend or a curve: look at its middle anyway.
            open_ |= way > LONG_WAY
            open_ &= good[number]
            if not open_.any():
                return good
            number, low, high = number[open_], low[open_], high[open_]
            c0, c1, r0, r1 = c0[open_], c1[open_], r0[open_], r1[open_]
            middle = (low + high) / 2.0
            cm, rm = self._states(intervals, number, middle, most[number] + tol)
            bad = ~(rm >= need[number] - tol)
            good[number[bad]] = False
            number = np.concatenate([number, number])
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
            c0, c1 = np.concatenate([c0, cm]), np.concatenate([cm, c1])
            r0, r1 = np.concatenate([r0, rm]), np.concatenate([rm, r1])
        good[number] = False  # not settled after all halvings: not known to be clear
        return good
