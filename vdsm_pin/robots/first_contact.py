"""When a robot is first and last too close to something, and in which intervals."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray
from vdsm_pin.proof.bodies import Pair as BodyPair
from vdsm_pin.proof.bodies import PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.error_box import ErrorBox
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import start_proof, summed
from vdsm_pin.proof.stretches import Stretches
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.clearances import least_clearances
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.contacts import MEETING
from vdsm_pin.verification.first_contact import (
    FirstContact,
    Judged,
    Noted,
    first_contacts,
)
from vdsm_pin.verification.moving import in_short_parts, joined_path
from vdsm_pin.verification.records import Pair

ENOUGH: Final = 1e-6
"""How deep a ball in both bodies need lie to tell that they meet; [m]."""

SHALLOW: Final = 1e-7
"""Of a contact no deeper than this nothing more is told; [m]."""

MOST_MEETINGS: Final = 32
"""Intervals in which a ball in both bodies is looked for; of more none are counted."""


def robot_contacts(
    cell: Cell,
    path: Path,
    pairs: tuple[Pair, ...],
    least: LeastClearances,
    box: ErrorBox | None,
    deadline: Deadline,
) -> tuple[FirstContact, ...]:
    """Where the clearance is first lost, from obstacles and between links.

    Args:
        cell: The robot and its scene.
        path: The robot's motion.
        pairs: As the cell's, by their names.
        least: Their least clearances over the whole motion.
        box: The errors of the proof.
        deadline: When to give up.

    Raises:
        OutOfTime: If the time is over.
    """
    if not (least.verdict == REFUTED).any():
        return ()
    # What is proved of the whole motion holds for its stretches.
    left = np.flatnonzero(least.verdict != CERTIFIED)
    judge = _Judge(cell, path, [cell.pairs[k] for k in left], box, deadline)
    named, noted = [pairs[k] for k in left], judge.noted()
    return first_contacts(cell, named, least.of(left), path, judge, noted, SHALLOW)


class _Judge:
    """Proves stretches of a motion between moments in waypoints, of some pairs."""

    def __init__(
        self,
        cell: Cell,
        path: Path,
        pairs: Sequence[BodyPair],
        box: ErrorBox | None,
        deadline: Deadline,
    ) -> None:
        self._cell, self._pairs, self._deadline = cell, pairs, deadline
        self._path, self._knots = in_short_parts(*joined_path(path, cell.scene))
        asked = self._path, PairTable.of(pairs), box, Budget(until=deadline.end)
        proving, self._plan = start_proof(cell.tree, cell.bodies, *asked)
        self._stretches = Stretches(proving, np.arange(proving.n_pairs))

    def __call__(self, low: float, high: float) -> Judged:
        """What is proved, balls in both bodies included."""
        self._deadline.check()
        span = self._knots.inner(np.array([low, high]))
        results, in_time = self._stretches.over(*span.tolist())
        proof = summed(results, self._plan, len(self._pairs), in_time)
        return least_clearances(
            self._cell, self._pairs, self._path, proof, ENOUGH, span
        )

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
        n = len(self._cell.robot.bodies)
        outer = np.array([pair.one >= n for pair in self._pairs], bool)
        of_kind = (
            np.asarray(refuted[:, outer == k].any(axis=1)) for k in (False, True)
        )
        return dict(zip((False, True), of_kind, strict=True))

    def _by_pair(self, parts: BoolArray) -> BoolArray:
        """Whether it is so of any part of each pair, of each interval."""
        first = np.searchsorted(self._plan.owner, np.arange(len(self._pairs)))
        return np.asarray(np.logical_or.reduceat(parts, first, axis=1))
