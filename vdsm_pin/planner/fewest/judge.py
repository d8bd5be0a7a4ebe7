"""Whether a motion in the chart keeps clearance and limits, asked as rarely as can be.

Clearance changes no faster than the body moves: a straight piece of the arm that is
clear at both ends of an interval by more than half its way in between needs no further
look. For the other pieces the interval is cut into as many parts as that seems to take.
This is a planner's check; the proof over continuous time is the verifier's.
"""

from copy import copy
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.broad_phase import BroadPhase, cuts_of
from vdsm_pin.planner.fewest.charts import Intervals, standing
from vdsm_pin.planner.fewest.interval_parts import LONG_TRAVEL, Parts, parts_of_pieces
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.offset_kernels import bends_of, clearances_along, pieces_of
from vdsm_pin.planner.fewest.own_clearance import OwnClearance
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import ANYWHERE, AimError, LastLinkCone
from vdsm_pin.time_limit import Deadline
from vdsm_pin.tolerances import TOLERANCES

CUTS: Final = 16
"""Times an interval is cut; the body moves 65,536 times less in what is left then."""
NEAR_LIMIT: Final = 0.9
"""An interval is looked at for its link angles if an end has so much of the largest."""
SHARES: Final = (0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0)
"""Places of an interval at which it is seen where the last link looks and whether the
base is on its rail; [-]."""
STEPS: Final = tuple(0.5 ** (2 + k) for k in range(10))
"""Steps to the place of an interval where a link bends most, one after the other; [-].
"""
STEADY: Final = 2e-4
"""More of its cone that is kept in reserve; [rad]."""
BLOCK: Final = 512
"""Intervals judged at once, which bounds the memory for their parts."""
THIRDS: Final = 40
"""Times the place where the base is farthest back is looked for in two thirds."""


def levers(arm: Manipulator) -> FloatArray:
    """How far the end of each link of the straight arm moves as all joints turn alike.

    It is the sum of its distances to the joints before it; the second axis of a joint
    adds a factor that is much the same for all links.

    Returns:
        Shape (N,), ascending; [m/rad].
    """
    joints = np.arange(1, arm.n_links + 1)
    return np.asarray(np.cumsum(arm.link_lengths * joints))


def link_margins(arm: Manipulator, error: float) -> FloatArray | None:
    """What each link keeps for an error of all joints, None for no error.

    Args:
        arm: The arm.
        error: Of every joint; [rad].

    Returns:
        Shape (N,), ascending; [m].
    """
    return error * levers(arm) if error > 0.0 else None


def link_limit(problem: PlanningProblem) -> float:
    """Largest link angle that keeps cone and box: |theta|, |alpha| <= psi; [rad]."""
    arm = problem.manipulator
    return min(arm.max_link_angle, arm.max_joint_angle)


def _cone(problem: PlanningProblem, slack: float) -> LastLinkCone:
    """What a plan uses of the cone in which the last link looks.

    The rest is for what happens between two rows, where joint centres stray by up to
    `slack` [m]: half of what errors leave of the cone at most.
    """
    pointing, arm = problem.path.pointing, problem.manipulator
    if pointing is None:
        return ANYWHERE
    error = AimError.of(pointing, arm, problem.errors)
    left = max(pointing.cone - error.axis, 0.0)
    reserve = 2.0 * slack / float(arm.link_lengths[-1]) + STEADY
    return LastLinkCone(pointing.cone - min(reserve, left / 2.0), error)


def check_cone(problem: PlanningProblem) -> None:
    """Refuse a cone that errors leave nothing of, wherever the tip is on the path.

    Raises:
        NoPlanFound: With what errors may turn the last link by.
    """
    pointing, path = problem.path.pointing, problem.path
    if pointing is None:
        return
    aims = path.aims(path.corners, path.corner_stations)
    sizes = np.linalg.norm(aims, axis=1)
    error = AimError.of(pointing, problem.manipulator, problem.errors)
    least = float(error.widening(sizes, np.zeros(1)).min())
    if least >= pointing.cone:
        message = (
            f"errors may turn the last link by {np.rad2deg(least):.3f}° against "
            f"where it shall look, and its cone has {np.rad2deg(pointing.cone):.3f}°"
            ": no motion can be proved to look there; try smaller errors or a "
            "wider cone"
        )
        raise NoPlanFound(message)


class Looks(NamedTuple):
    """What configurations come to."""

    clearances: FloatArray
    """Least clearance beyond what links keep, -inf where a limit is broken, shape
    (n,); [m]."""

    changed: IntArray
    """Number of changed link angles, shape (n,)."""

    largest: FloatArray
    """Largest link angle, shape (n,); [rad]."""


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
        link_margins: What each link keeps besides, shape (N,); None for nothing; [m].
    """

    def __init__(
        self,
        problem: PlanningProblem,
        clearance: LinkClearance,
        margin: float,
        slack: float,
        finest: float,
        ease: float = 1.0,
        link_margins: FloatArray | None = None,
    ) -> None:
        self.problem, self.clearance = problem, clearance
        self.link_margins, self.cuts = link_margins, cuts_of(problem, clearance)
        self.rough = clearance
        self.required = problem.required_clearance + margin + slack
        self.slack, self.finest = slack, finest
        self.limit = ease * link_limit(problem)
        self.own = OwnClearance(problem, slack, finest)
        self.cone = _cone(problem, slack)

    def with_rough(self, rough: LinkClearance) -> "Judge":
        """The same, which asks a cheaper function of single configurations."""
        other = copy(self)
        other.rough = rough
        return other

    def until(self, deadline: Deadline) -> "Judge":
        """The same, which answers up to another time."""
        other = copy(self)
        for name in ("clearance", "rough"):
            if isinstance(one := getattr(self, name), BroadPhase):
                setattr(other, name, replace(one, deadline=deadline))
        return other

    def lines(self, corners: Corners, intervals: IntArray) -> Intervals:
        """Some intervals of a motion, with where the last link shall look on the path.

        Args:
            corners: The motion.
            intervals: Numbers, shape (n,).
        """
        lines, path = corners.pick(intervals), self.problem.path
        if path.pointing is None:
            return lines
        aims = path.aims(corners.tips, corners.stations)
        both = np.stack([aims[intervals], aims[intervals + 1]], axis=1)
        both[~corners.drawn[intervals]] = np.nan
        return replace(lines, aims=both)

    def look(
        self, tips: FloatArray, offsets: FloatArray, aims: FloatArray | None = None
    ) -> Looks:
        """Clearance, changed angles and largest angle of configurations.

        Args:
            tips: Shape (n, 3); [m].
            offsets: Shape (n, N + 1, 2); [m].
            aims: Where the last link shall look, shape (n, 3); None for anywhere.
        """
        still = Intervals(tips, tips, offsets, offsets)
        knees = self._cuts(still)
        number, share = np.arange(len(tips)), np.zeros(len(tips))
        most = np.full(len(tips), self.limit)
        centres, clearances = self._states(
            still, number, share, most, self.rough, knees, knees[:, 1:]
        )
        if aims is not None:
            clearances[~self._aimed(centres, aims)] = -np.inf
        angles = bends_of(centres)
        least = clearances.min(axis=1)
        least[self.own.too_near(centres, angles)] = -np.inf
        changed = (angles > TOLERANCES.changed_angle).sum(axis=1)
        return Looks(least, changed, angles.max(axis=1))

    def _aimed(self, centres: FloatArray, aims: FloatArray) -> BoolArray:
        """Whether last links look where they shall, shape (n,)."""
        axes = centres[:, -1] - centres[:, -2]
        return self.cone.holds(centres[:, 0, 0], axes, aims)

    def bends(self, tips: FloatArray, offsets: FloatArray) -> FloatArray:
        """Link angles of configurations, shape (n, N); [rad]."""
        return bends_of(standing(self.problem.manipulator, tips, offsets))

    def _cuts(self, intervals: Intervals) -> BoolArray:
        """Joints at which arms are cut into straight pieces, shape (n, N + 1).

        Links in line between two knees are one piece, unless each keeps its own, they
        are not equally thick, or are held apart from different obstacles.
        """
        knees = intervals.knees(self.problem.manipulator)
        if self.link_margins is not None:
            return np.ones_like(knees)
        return knees if self.cuts is None else knees | self.cuts

    def _states(
        self,
        intervals: Intervals,
        interval: IntArray,
        share: FloatArray,
        most: FloatArray,
        clearance: LinkClearance,
        knees: BoolArray,
        asked: BoolArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Joint centres and the clearance of pieces, each by the joint it ends at.

        Args:
            intervals: Straight lines in the chart.
            interval: Interval of each place, shape (r,).
            share: Where in its interval, 0 to 1, shape (r,).
            most: Largest link angle at each place, shape (r,); [rad].
            clearance: The clearance function.
            knees: Of each interval, shape (n, N + 1).
            asked: Which pieces of each place are asked for, shape (r, N).

        Returns:
            Shape (r, N + 1, 3) [m]; clearance beyond what links keep, inf where none is
            asked for, -inf in rows where a limit is broken, shape (r, N) [m].
        """
        manipulator = self.problem.manipulator
        centres = intervals.centres(manipulator, interval, share)
        peak = bends_of(centres).max(axis=1)
        base = centres[:, 0, 0]
        low, high = manipulator.base_range
        rounding = TOLERANCES.planned_limit
        fine = (peak <= most + rounding) & (base >= low - rounding)
        fine &= base <= high + rounding
        clearances = np.full(asked.shape, np.inf)
        clearances[~fine] = -np.inf
        pieces, place = pieces_of(centres, knees, interval, asked & fine[:, None])
        if len(pieces):
            links = (place % asked.shape[1])[:, None]
            clearances.ravel()[place] = clearance(pieces, links)[:, 0]
        if self.link_margins is not None:
            clearances -= self.link_margins
        return centres, clearances

    def needed_from(self, clearances: FloatArray) -> FloatArray:
        """Clearance that ways keep from where there is so much, shape (n,); [m].

        The start may be closer than the margin asks for; the way out only gets better.
        Where a limit is broken, -inf, all is asked for.
        """
        needed = np.minimum(self.required, clearances)
        return np.where(clearances > -np.inf, needed, self.required)

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
        count = len(intervals.tips)
        need = np.full(count, self.required) if required is None else required
        most = np.full(count, self.limit)
        if bend is not None:
            most = np.minimum(most, bend + TOLERANCES.on_boundary)
        found = [
            self._measured(intervals.part(rows), need[rows], most[rows])
            for rows in (slice(k, k + BLOCK) for k in range(0, max(count, 1), BLOCK))
        ]
        good, begin = (np.concatenate(both) for both in zip(*found, strict=True))
        return good, begin

    def _measured(
        self, intervals: Intervals, need: FloatArray, most: FloatArray
    ) -> tuple[BoolArray, FloatArray]:
        """`measured` of a block, with the largest link angles in each interval."""
        count, tol = len(intervals.tips), TOLERANCES.on_boundary
        ask = self.clearance
        knees = self._cuts(intervals)
        long_way = LONG_TRAVEL * self.problem.manipulator.total_length
        number, low, high = np.arange(count), np.zeros(count), np.ones(count)
        every = knees[:, 1:]
        c0, r0 = self._states(intervals, number, low, most, ask, knees, every)
        # Most intervals end where the next one begins.
        c1 = np.roll(c0, -1, axis=0)
        r1 = clearances_along(
            np.roll(r0, -1, axis=0), np.roll(knees, -1, axis=0), knees
        )
        ends = np.flatnonzero(~intervals.continued())
        c1[ends], r1[ends] = self._states(
            intervals, ends, high[ends], most[ends], ask, knees, every[ends]
        )
        begin = r0.min(axis=1)
        good = (begin >= need - tol) & (r1.min(axis=1) >= need - tol)
        bends = np.maximum(bends_of(c0), bends_of(c1))
        good &= self._within(intervals, (c0, c1), bends, most)
        good &= self.own.apart(intervals, (c0, c1), bends, good)
        parts = Parts(number, low, high, c0, c1, r0, r1)
        for _ in range(CUTS):
            counts = parts_of_pieces(parts, knees, need, self.finest, long_way)
            doubtful = (counts > 0).any(axis=1) & good[parts.interval]
            if not doubtful.any():
                return good, begin
            parts, counts = parts.take(doubtful), counts[doubtful]
            part, share = parts.inner(counts.max(axis=1))
            where = parts.interval[part]
            centres, clearances = self._states(
                intervals, where, share, most[where], ask,
                knees, counts[part] > 0,
            )  # fmt: skip
            good[where[~(clearances.min(axis=1) >= need[where] - tol)]] = False
            parts = parts.cut(part, share, centres, clearances)
        # What is not settled after all cuts is not known to be clear.
        good[parts.interval] = False
        return good, begin

    def _within(
        self,
        intervals: Intervals,
        ends: tuple[FloatArray, FloatArray],
        bends: FloatArray,
        most: FloatArray,
    ) -> BoolArray:
        """Whether intervals whose ends keep rail and cone keep them in between.

        The base runs convexly, so it is farthest ahead at an end, and where it is
        farthest back can be found. The cone is looked at where an end comes near it.

        Args:
            intervals: Straight lines in the chart.
            ends: Joint centres where they begin and end, shape (n, N + 1, 3); [m].
            bends: The larger link angles of both, shape (n, N); [rad].
            most: Largest link angle in each interval, shape (n,); [rad].

        Returns:
            Shape (n,).
        """
        arm, kept = self.problem.manipulator, np.ones(len(most), dtype=np.bool_)
        near = np.flatnonzero(bends.max(axis=1) > NEAR_LIMIT * most)
        if near.size:
            kept[near] = self._most_bent(intervals, near, most[near])
        kept &= self._looking(intervals)
        ahead = np.minimum(ends[0][:, -1, 0], ends[1][:, -1, 0])
        near = np.flatnonzero(kept & (ahead - arm.total_length < arm.base_range[0]))
        if near.size and intervals.chart.keeps_rail:
            kept[near] = self._on_rail(intervals, near)
        elif near.size:
            least = arm.base_range[0] - TOLERANCES.planned_limit
            kept[near] = self._farthest_back(intervals, near) >= least
        return kept

    def _most_bent(
        self, intervals: Intervals, number: IntArray, most: FloatArray
    ) -> BoolArray:
        """Whether link angles keep a limit [rad] where intervals bend most, (r,).

        That place is sought about the middle, in ever smaller steps to the more bent
        side, until it is found or the limit is passed.
        """
        arm, at = self.problem.manipulator, np.full(len(number), 0.5)
        kept = np.ones(len(number), dtype=np.bool_)
        best = bends_of(intervals.centres(arm, number, at)).max(axis=1)
        for step in STEPS:
            near = kept & ((best > NEAR_LIMIT * most) | (step == STEPS[0]))
            some = np.flatnonzero(near)
            middle = at[some]
            for share in (middle - step, middle + step) if some.size else ():
                inner = intervals.centres(arm, number[some], share)
                bent = bends_of(inner).max(axis=1)
                more = bent > best[some]
                at[some[more]], best[some[more]] = share[more], bent[more]
            kept[best > most + TOLERANCES.planned_limit] = False
        return kept

    def _looking(self, intervals: Intervals) -> BoolArray:
        """Whether last links look where they shall at some places, shape (n,)."""
        kept = np.ones(len(intervals.tips), dtype=np.bool_)
        if intervals.aims is None:
            return kept
        asked = np.flatnonzero(np.isfinite(intervals.aims).all(axis=(1, 2)))
        begin, end = intervals.aims[asked, 0], intervals.aims[asked, 1]
        arm = self.problem.manipulator
        for share in SHARES if asked.size else ():
            inner = intervals.centres(arm, asked, np.full(len(asked), share))
            kept[asked] &= self._aimed(inner, (1.0 - share) * begin + share * end)
        return kept

    def _on_rail(self, intervals: Intervals, number: IntArray) -> BoolArray:
        """Whether there is an arm at some places of intervals of directions, (r,).

        Where there is none whose base is on its rail, joint centres are NaN. Between
        these places nobody looks: the verification judges the whole motion.
        """
        arm, kept = self.problem.manipulator, np.ones(len(number), dtype=np.bool_)
        for share in SHARES:
            inner = intervals.centres(arm, number, np.full(len(number), share))
            kept &= np.isfinite(inner).all(axis=(1, 2))
        return kept

    def _farthest_back(self, intervals: Intervals, number: IntArray) -> FloatArray:
        """Least x0 in intervals, found as in any convex function, shape (r,); [m]."""
        arm = self.problem.manipulator
        low, high = np.zeros(len(number)), np.ones(len(number))
        least = np.full(len(number), np.inf)
        for _ in range(THIRDS):
            a, b = (2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0
            left, right = (
                intervals.centres(arm, number, share)[:, 0, 0] for share in (a, b)
            )
            least = np.minimum(least, np.minimum(left, right))
            ahead = left < right
            low, high = np.where(ahead, low, a), np.where(ahead, b, high)
        return least
