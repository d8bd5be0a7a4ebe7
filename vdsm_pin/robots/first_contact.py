"""When a robot is first and last too close to something, and in which intervals."""

from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.error_box import ErrorBox
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import prove, prove_intervals
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.clearances import MEETING, least_clearances
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.first_contact import (
    FirstContact,
    Judge,
    Judged,
    Noted,
    first_contacts,
)
from vdsm_pin.verification.moving import path_beside
from vdsm_pin.verification.records import LeastClearances, Pair

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
    few, named = [cell.pairs[k] for k in left], [pairs[k] for k in left]
    budget = Budget(until=deadline.end)

    def judge(low: float, high: float) -> Judged:
        deadline.check()
        whole, _ = path_beside(path.between(low, high), cell.scene)
        proof = prove(cell.tree, cell.bodies, whole, few, box, budget)
        return least_clearances(cell, few, whole, proof, ENOUGH)

    noted = _noted(cell, path, left, box, judge, budget)
    return first_contacts(cell, named, least.of(left), path, judge, noted, SHALLOW)


def _noted(
    cell: Cell,
    path: Path,
    left: IntArray,
    box: ErrorBox | None,
    judge: Judge,
    budget: Budget,
) -> Noted | None:
    """The intervals in which some of the pairs are too close; None where too many."""
    whole, knots = path_beside(path, cell.scene)
    few = [cell.pairs[k] for k in left]
    found = prove_intervals(cell.tree, cell.bodies, whole, few, box, budget)
    if found is None:
        return None
    refuted, near = (
        np.logical_or.reduceat(one, knots.first[:-1])
        for one in (found[0] == REFUTED, found[1] <= MEETING)
    )
    meeting = np.flatnonzero((near & ~refuted).any(axis=1))
    if meeting.size > MOST_MEETINGS:
        return None
    for k in meeting.tolist():
        refuted[k] |= judge(k, k + 1).verdict == REFUTED
    outer = np.array([pair.one >= len(cell.robot.bodies) for pair in few], bool)
    of_kind = (np.asarray(refuted[:, outer == k].any(axis=1)) for k in (False, True))
    return dict(zip((False, True), of_kind, strict=True))
