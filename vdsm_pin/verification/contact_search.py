"""The first contacts of a motion: stretches of it are proved until they are found."""

from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray
from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.stretches import Stretches
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.clearances import least_clearances, with_depths
from vdsm_pin.verification.contacts import MEETING
from vdsm_pin.verification.first_contact import FirstContact, Noted, first_contacts
from vdsm_pin.verification.protocols import AnyMotion

ENOUGH: Final = 1e-6
"""How deep a ball in both bodies need lie to tell that they meet; [m]."""

SHALLOW: Final = 1e-7
"""Of a contact no deeper than this nothing more is told where balls prove it; [m]."""

MOST_MEETINGS: Final = 32
"""Intervals in which a ball in both bodies is looked for; of more none are counted."""


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
        results, _ = self._stretches.over(*span.tolist())
        least = least_clearances(motion.asked, motion.told(results))
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
        owner, n_pairs = self._motion.question.plan.owner, self._motion.asked.table.size
        first = np.searchsorted(owner, np.arange(n_pairs))
        return np.asarray(np.logical_or.reduceat(parts, first, axis=1))
