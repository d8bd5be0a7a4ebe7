"""When a motion is too close: a collision's begin, end and intervals, not its depth."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray
from vdsm_pin.problem.any_problem import AnyMotion, AnyProblem
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.stretches import Stretches
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.clearances import least_clearances, with_depths
from vdsm_pin.verification.contacts import MEETING
from vdsm_pin.verification.records import Pair

STRETCH: Final = 64
"""Intervals of the first stretch; each later one is twice as long as that before."""

LEAST_SHARE: Final = 2.0**-24
"""Share of an interval down to which the moment of a contact is halved; [-]."""

FINE_SHARE: Final = 2.0**-14
"""Share of an interval at which halving ends where the contact is shallow; [-]."""

DIGITS: Final = 6
"""Decimals of a moment, in waypoints; coarser than what halving tells."""

ENOUGH: Final = 1e-6
"""How deep a ball in both bodies need lie to tell that they meet; [m]."""

SHALLOW: Final = 1e-7
"""Of a contact no deeper than this nothing more is told where balls prove it; [m]."""

MOST_MEETINGS: Final = 32
"""Intervals in which a ball in both bodies is looked for; of more none are counted."""


@dataclass(frozen=True)
class FirstContact:
    """The first moment at which a pair is proved to be too close.

    Args:
        pair: The pair.
        moment: In waypoints: 12.25 is a quarter of the way from 12 to 13.
        clear_before: Whether every pair of the same kind (with an obstacle, or of two
            bodies) is proved clear before.
        last: The last moment at which some pair of its kind is proved to be too close;
            NaN where nobody noted the intervals; in waypoints.
        intervals: How many intervals some pair of its kind is too close in; 0 where
            nobody noted them.
        stretches: How many runs of neighbours they make.
        time: Time of `moment`; NaN where rows have no times; [s].
        last_time: Time of `last`; [s].
    """

    pair: Pair
    moment: float
    clear_before: bool
    last: float = nan
    intervals: int = 0
    stretches: int = 0
    time: float = nan
    last_time: float = nan

    def timed(self, trajectory: AnyMotion) -> "FirstContact":
        """A copy with the times of its moments, where the trajectory has times."""
        times = trajectory.times_at(np.array([self.moment, self.last]))
        if times is None:
            return self
        return replace(self, time=float(times[0]), last_time=float(times[1]))


Judge: TypeAlias = Callable[[float, float], LeastClearances]
"""Proves a stretch between two moments in waypoints: rows, or both in one interval."""


Noted: TypeAlias = Mapping[bool, BoolArray]
"""True for pairs with obstacles, False for others: in which of the intervals some pair
is too close, shape (n_intervals,)."""


def first_contacts(
    problem: AnyProblem,
    pairs: Sequence[Pair],
    whole: LeastClearances,
    motion: AnyMotion,
    judge: Judge,
    noted: Noted | None = None,
    shallow: float = 0.0,
) -> tuple[FirstContact, ...]:
    """Where the clearance is first lost, from obstacles and between bodies.

    Args:
        problem: With the clearances that pairs have to keep.
        pairs: Every pair.
        whole: What is proved of the whole motion; a pair that it does not refute has
            no contact.
        motion: The motion.
        judge: Proves stretches of the motion.
        noted: The intervals that are too close; None where not all were seen.
        shallow: A contact no deeper than this is not told more finely; [m].

    Returns:
        At most one contact with an obstacle and one between bodies, in that order.

    Raises:
        OutOfTime: If `judge` says that the time is over.
    """
    of_obstacles = np.array([bool(pair.obstacle) for pair in pairs], dtype=bool)
    contacts = []
    for mine, kind, enough in (
        (of_obstacles, True, problem.required_clearance - shallow),
        (~of_obstacles, False, problem.required_self_clearance - shallow),
    ):
        if not (whole.verdict[mine] == REFUTED).any():
            continue
        search = _Search(pairs, motion, judge, mine, enough)
        found = search.first(None if noted is None else noted[kind])
        if found is not None and noted is not None:
            found = search.with_end(found, noted[kind])
        contacts += [] if found is None else [found.timed(motion)]
    return tuple(contacts)


class _Search:
    """Search for the first and the last moment at which pairs of one kind are refuted.

    Attributes:
        clear: Whether all stretches judged so far without refutation were certified.
        least: Upper bound of the clearance of the last pair that was refuted; [m].
    """

    def __init__(
        self,
        pairs: Sequence[Pair],
        motion: AnyMotion,
        judge: Judge,
        mine: BoolArray,
        enough: float,
    ) -> None:
        self.pairs, self.motion = pairs, motion
        self.judge, self.mine, self.enough = judge, mine, enough
        self.clear, self.least = True, -np.inf

    def first(self, noted: BoolArray | None) -> FirstContact | None:
        """The first pair that is refuted, and when; None if none is.

        Args:
            noted: The intervals known to be too close, if they are.
        """
        n_intervals = max(1, self.motion.n_samples - 1)
        first, last = 0, min(STRETCH, n_intervals)
        if noted is not None and noted.any():
            known = int(np.argmax(noted))
            if not known or self._refuted(0, known) is None:
                first, last = known, known + 1
        while (pair := self._refuted(first, last)) is None:
            if last == n_intervals:
                return None
            first, last = last, min(3 * last - 2 * first, n_intervals)
        while last - first > 1:
            middle = (first + last) // 2
            if self._refuted(first, middle):
                last = middle
            else:
                first = middle
        pair = self._refuted(first, last) or pair
        if at_once := self._refuted(0, 0) if first == 0 else None:
            return FirstContact(at_once, 0.0, self.clear)
        low, high = float(first), float(last)
        while self._can_halve(low, high):
            now = (low + high) / 2.0
            if sooner := self._refuted(low, now):
                pair, high = sooner, now
            else:
                low = now
        return FirstContact(pair, round(high, DIGITS), self.clear)

    def with_end(self, found: FirstContact, noted: BoolArray) -> FirstContact:
        """The contact with its end, and the intervals it is in."""
        intervals, rows = np.flatnonzero(noted), self.motion.n_samples
        if not intervals.size or rows == 1:
            return replace(found, last=found.moment, intervals=1, stretches=1)
        end = float(intervals[-1]) + 1.0
        to_the_end = end == rows - 1 and self._refuted(end, end)
        low, high = (end if to_the_end else end - 1.0), end
        self.least = -np.inf
        while self._can_halve(low, high):
            now = (low + high) / 2.0
            low, high = (now, high) if self._refuted(now, end) else (low, now)
        return replace(
            found,
            last=round(low, DIGITS),
            intervals=intervals.size,
            stretches=1 + int((np.diff(intervals) > 1).sum()),
        )

    def _can_halve(self, low: float, high: float) -> bool:
        """Whether halving tells more, and times differ where there are times."""
        least = FINE_SHARE if self.least >= self.enough else LEAST_SHARE
        if high - low <= least:
            return False
        times = self.motion.times_at(np.array([low, (low + high) / 2.0, high]))
        return times is None or bool((np.diff(times) > 0.0).all())

    def _refuted(self, low: float, high: float) -> Pair | None:
        """The refuted pair of least clearance in a stretch; None if none is refuted.

        Sets `least` to its clearance; where none is refuted, `clear` turns False unless
        all are certified.
        """
        found = self.judge(low, high)
        refuted = self.mine & (found.verdict == REFUTED)
        if not refuted.any():
            self.clear &= bool((found.verdict[self.mine] == CERTIFIED).all())
            return None
        worst = int(np.argmin(np.where(refuted, found.upper, np.inf)))
        self.least = float(found.upper[worst])
        return self.pairs[worst]


def contacts_of(
    problem: AnyProblem,
    trajectory: AnyMotion,
    motion: AskedMotion,
    least: LeastClearances,
    deadline: Deadline = NO_LIMIT,
) -> tuple[FirstContact, ...]:
    """Where the clearance is first lost, from obstacles and between bodies.

    Args:
        problem: With the clearances that pairs have to keep.
        trajectory: What was judged.
        motion: What is asked of it.
        least: What is proved of all of it.
        deadline: When to give up.

    Raises:
        OutOfTime: If the time is over.
    """
    if not (least.verdict == REFUTED).any():
        return ()
    # What is proved of the whole motion holds for its stretches.
    left = np.flatnonzero(least.verdict != CERTIFIED)
    some = motion.among(left)
    judge = _Judge(some, deadline)
    about = problem, some.asked.pairs, least.of(left), trajectory, judge
    grown = min(some.asked.balls, default=0.0) > 0.0
    return first_contacts(*about, judge.noted(), 0.0 if grown else SHALLOW)


class _Judge:
    """Proves stretches of a motion between moments in waypoints."""

    def __init__(self, motion: AskedMotion, deadline: Deadline) -> None:
        self._motion, self._deadline = motion, deadline
        proving = motion.proving(Budget(until=deadline.end))
        self._stretches = Stretches(proving, np.arange(proving.n_pairs))

    def __call__(self, low: float, high: float) -> LeastClearances:
        """What is proved of every pair."""
        self._deadline.check()
        motion = self._motion
        span = motion.knots.inner(np.array([low, high]))
        found = self._stretches.over(*span.tolist())
        least = least_clearances(motion.asked, found)
        return with_depths(motion, least, ENOUGH, span, self._deadline)

    def noted(self) -> Noted | None:
        """The intervals in which some pair is too close; None where too many."""
        found = self._stretches.each()
        if found is None:
            return None
        starts = self._motion.knots.first[:-1]
        refuted, near = (
            np.logical_or.reduceat(self._by_pair(one), starts)
            for one in (found[0] == REFUTED, found[1] <= MEETING)
        )
        meeting = np.flatnonzero((near & ~refuted).any(axis=1))
        if meeting.size > MOST_MEETINGS:
            return None
        for k in meeting.tolist():
            refuted[k] |= self(k, k + 1).verdict == REFUTED
        outer = self._motion.asked.outer
        of_kind = (
            np.asarray(refuted[:, outer == k].any(axis=1)) for k in (False, True)
        )
        return dict(zip((False, True), of_kind, strict=True))

    def _by_pair(self, parts: BoolArray) -> BoolArray:
        """Whether it is so of any part of each pair, of each interval."""
        plan = self._motion.question.plan
        first = np.searchsorted(plan.owner, np.arange(plan.n_pairs))
        return np.asarray(np.logical_or.reduceat(parts, first, axis=1))
