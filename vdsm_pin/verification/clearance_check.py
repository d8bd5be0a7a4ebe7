"""What the clearance proof comes to: a row for the obstacles and one for the links."""

from dataclasses import replace
from math import isnan, nan

import numpy as np

from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.proof.layouts import AT_UPPER, LOW, TIME, UP
from vdsm_pin.proof.terms import REFUTED, UNDECIDED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.clearance import ClearanceProof
from vdsm_pin.verification.first_contact import FirstContact
from vdsm_pin.verification.inside import surfaces
from vdsm_pin.verification.records import Check, Counterexample, Verdict, is_deepest
from vdsm_pin.verification.task import ball_of


def check_clearance(
    problem: PlanningProblem,
    proof: ClearanceProof,
    counterexamples: tuple[Counterexample, ...],
    contacts: tuple[FirstContact, ...] = (),
    deadline: Deadline = NO_LIMIT,
    *,
    nominal: bool = False,
) -> tuple[Check, ...]:
    """One row for the obstacles, one for the links among themselves.

    Args:
        problem: Required clearances.
        proof: Of every motion within the error box.
        counterexamples: Motions within it that refute what the proof left undecided.
        contacts: Where the clearance is first lost.
        deadline: When the proof had to end.
        nominal: Whether the motion without errors is proved clear.
    """
    late = f": {OutOfTime(deadline.limit)}" if proof.late else ""
    of_obstacles = np.array([bool(pair.obstacle) for pair in proof.pairs], dtype=bool)
    rows = []
    for mine, name, needed in (
        (of_obstacles, "clearance from obstacles", problem.required_clearance),
        (~of_obstacles, "clearance between links", problem.required_self_clearance),
    ):
        if mine.any():
            row = _row(problem, proof, np.flatnonzero(mine), (name, needed, late))
            against = [
                found
                for found in counterexamples
                if bool(found.pair.obstacle) == bool(of_obstacles[mine][0])
            ]
            for contact in contacts:
                if bool(contact.pair.obstacle) == bool(of_obstacles[mine][0]):
                    row = _first(row, contact)
            if against:
                row = refuted_by(row, against[0], nominal=nominal)
            rows.append(row)
    said = "".join(f"; {name!r} as a surface only" for name in surfaces(problem))
    if said:
        rows[0] = replace(rows[0], where=rows[0].where + said)
    return tuple(rows)


def _row(
    problem: PlanningProblem,
    proof: ClearanceProof,
    mine: IntArray,
    asked: tuple[str, float, str],
) -> Check:
    name, needed, late = asked
    counts = proof.counts[mine].sum(axis=0)
    verdict = Verdict.CERTIFIED
    if counts[REFUTED]:
        verdict = Verdict.REFUTED
    elif counts[UNDECIDED]:
        verdict = Verdict.UNDECIDED
    # A refuted motion is as bad as its witness, another one as good as its proof.
    column = UP if verdict is Verdict.REFUTED else LOW
    pair = int(mine[np.argmin(proof.best[mine, column])])
    row = proof.best[pair]
    where = f"{proof.pairs[pair].own} and {proof.pairs[pair].label}"
    if verdict is Verdict.UNDECIDED:
        where += f"; {int(counts[UNDECIDED])} of {int(counts.sum())} undecided{late}"
    return Check(
        name=name,
        verdict=verdict,
        count=int(counts.sum()),
        worst=float(row[column]),
        limit=needed,
        unit="m",
        where=where,
        moment=float(row[AT_UPPER] + row[TIME]) if np.isfinite(row[UP]) else nan,
        deeper=is_deepest(float(row[column]), ball_of(problem, proof.pairs[pair])),
    )


def _first(row: Check, contact: FirstContact) -> Check:
    """The row with the beginning of what it names at its worst."""
    found = "first too close" if contact.clear_before else "first found too close"
    pair = f"{contact.pair.own} and {contact.pair.label}"
    moment = _told(contact.moment, contact.time)
    where = f"{row.where}; {found} at waypoint {moment}: {pair}"
    if contact.intervals:
        last = _told(contact.last, contact.last_time)
        runs = "" if contact.stretches == 1 else f" in {contact.stretches} stretches"
        where += f"; last at waypoint {last}; {contact.intervals} intervals{runs}"
    return replace(
        row,
        where=where,
        first=contact.moment,
        last=contact.last,
        too_close=contact.intervals,
        stretches=contact.stretches,
    )


def _told(moment: float, time: float) -> str:
    """A moment in waypoints, and its time where that is known."""
    text = f"{moment:.6f}".rstrip("0").rstrip(".")
    return text if isnan(time) else f"{text} ({time:.4f} s)"


def refuted_by(row: Check, found: Counterexample, *, nominal: bool) -> Check:
    """The row of an undecided proof that a counterexample decides."""
    pair = f"{found.pair.own} and {found.pair.label}"
    clear = "; the nominal motion is clear" if nominal else ""
    return replace(
        row,
        verdict=Verdict.REFUTED,
        worst=found.clearance,
        where=f"{pair}, with errors within the error box{clear}",
        moment=found.moment,
        deeper=found.deeper,
    )
