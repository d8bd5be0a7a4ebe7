"""When a robot is first and last too close to something, and in which intervals."""

from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.error_box import ErrorBox
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import summed
from vdsm_pin.proof.stretches import Stretches
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.robots.cell import Cell
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.clearances import least_clearances, with_depths
from vdsm_pin.verification.contacts import MEETING
from vdsm_pin.verification.first_contact import (
    FirstContact,
    Judged,
    Noted,
    first_contacts,
)
from vdsm_pin.verification.moving import in_short_parts, joined_path

ENOUGH: Final = 1e-6
"""How deep a ball in both bodies need lie to tell that they meet; [m]."""

SHALLOW: Final = 1e-7
"""Of a contact no deeper than this nothing more is told; [m]."""

MOST_MEETINGS: Final = 32
"""Intervals in which a ball in both bodies is looked for; of more none are counted."""


def robot_contacts(
    cell: Cell,
    path: Path,
    least: LeastClearances,
    deadline: Deadline,
) -> tuple[FirstContact, ...]:
    """Where the clearance is first lost, from obstacles and between links.

    Args:
        cell: The robot and its scene.
        path: The robot's motion.
        least: Least clearances of its pairs over the whole motion.
        deadline: When to give up.

    Raises:
        OutOfTime: If the time is over.
    """
    if not (least.verdict == REFUTED).any():
        return ()
    # What is proved of the whole motion holds for its stretches.
    left = np.flatnonzero(least.verdict != CERTIFIED)
    asked = cell.asked.among(left)
    judge = _Judge(asked, path, asked.box(cell.errors), deadline)
    about = cell, asked.pairs, least.of(left), path, judge
    return first_contacts(*about, judge.noted(), SHALLOW)


class _Judge:
    """Proves stretches of a motion between moments in waypoints, of some pairs."""

    def __init__(
        self, asked: Assembly, path: Path, box: ErrorBox, deadline: Deadline
    ) -> None:
        self._asked, self._deadline = asked, deadline
        self._path, self._knots = in_short_parts(*joined_path(path, asked.scene))
        question = asked.question.under(box)
        self._plan = question.plan
        proving = question.about(self._path, Budget(until=deadline.end))
        self._stretches = Stretches(proving, np.arange(proving.n_pairs))

    def __call__(self, low: float, high: float) -> Judged:
        """What is proved, balls in both bodies included."""
        self._deadline.check()
        span = self._knots.inner(np.array([low, high]))
        results, in_time = self._stretches.over(*span.tolist())
        proof = summed(results, self._plan, self._asked.table.size, in_time)
        least = least_clearances(self._asked, proof)
        return with_depths(self._asked, self._path, least, ENOUGH, span)

    def noted(self) -> Noted | None:
        """The intervals in which some pair is too close; None where too many."""
        found = self._stretches.each()
        if found is None:
            return None
        refuted, near = (
            np.logical_or.reduceat(self._by_pair(one), self._knots.first[:-1])
            for one in (found[0] == REFUTED, found[1] <= MEETING)
        )
        meeting = np.flatnonzero((near & ~refuted).any(axis=1))
        if meeting.size > MOST_MEETINGS:
            return None
        for k in meeting.tolist():
            refuted[k] |= self(k, k + 1).verdict == REFUTED
        outer = self._asked.outer
        of_kind = (
            np.asarray(refuted[:, outer == k].any(axis=1)) for k in (False, True)
        )
        return dict(zip((False, True), of_kind, strict=True))

    def _by_pair(self, parts: BoolArray) -> BoolArray:
        """Whether it is so of any part of each pair, of each interval."""
        first = np.searchsorted(self._plan.owner, np.arange(self._asked.table.size))
        return np.asarray(np.logical_or.reduceat(parts, first, axis=1))
