"""What a clearance proof comes to: a row for the obstacles and one for the links."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, isnan, nan

import numpy as np

from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.proof.terms import REFUTED, UNDECIDED
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.first_contact import FirstContact
from vdsm_pin.verification.inside import surfaces
from vdsm_pin.verification.records import (
    Check,
    CheckKind,
    Counterexample,
    Pair,
    Verdict,
)


@dataclass(frozen=True)
class Evidence:
    """What is proved of an arm's or a robot's motion within the error box.

    Args:
        pairs: Every pair.
        outer: Which of them are with an obstacle, shape (n_pairs,).
        least: Their least clearances.
        counts: What was judged of each by verdict, shape (n_pairs, 3).
        deepest: Whether a pair, by its number, is found as deep as is measured.
        counterexamples: Motions that refute what the proof left undecided.
        nominal: Whether the motion without errors is proved clear.
        contacts: Where the clearance is first lost.
    """

    pairs: Sequence[Pair]
    outer: BoolArray
    least: LeastClearances
    counts: IntArray
    deepest: Callable[[int, float], bool]
    counterexamples: tuple[Counterexample, ...]
    nominal: bool
    contacts: tuple[FirstContact, ...]


def clearance_checks(
    problem: AnyProblem, evidence: Evidence, late: Deadline | None = None
) -> tuple[Check, ...]:
    """One row for the obstacles, one for the links among themselves.

    Args:
        problem: Required clearances.
        evidence: What is proved.
        late: When the proof had to end, where it did not in time.
    """
    rows = []
    for kind, one, needed in (
        (True, CheckKind.OBSTACLES, problem.required_clearance),
        (False, CheckKind.LINKS, problem.required_self_clearance),
    ):
        mine = np.flatnonzero(evidence.outer == kind)
        if not mine.size:
            continue
        row = Check(one.value, Verdict.CERTIFIED, 0, nan, needed, "m")
        row = _row(row, evidence, mine)
        if late is not None and row.verdict is Verdict.UNDECIDED:
            row = replace(row, where=f"{row.where}: {OutOfTime(late.limit)}")
        for contact in evidence.contacts:
            if bool(contact.pair.obstacle) == kind:
                row = _first(row, contact)
        for found in evidence.counterexamples:
            if bool(found.pair.obstacle) == kind:
                row = _refuted_by(row, found, nominal=evidence.nominal)
        for mesh in surfaces(problem) if kind else ():
            row = replace(row, where=f"{row.where}; {mesh!r} as a surface only")
        rows.append(row)
    return tuple(rows)


def _row(row: Check, evidence: Evidence, mine: IntArray) -> Check:
    """A row with what is proved of some pairs."""
    least, counts = evidence.least, evidence.counts[mine].sum(axis=0)
    values, verdict = least.lower[mine], Verdict.CERTIFIED
    if counts[REFUTED]:
        # A refuted motion is as bad as its witness, another one as good as its proof.
        verdict, lost = Verdict.REFUTED, least.verdict[mine] == REFUTED
        values = np.where(lost, least.upper[mine], np.inf)
    elif counts[UNDECIDED]:
        verdict = Verdict.UNDECIDED
    # Of pairs with the same bound, as rough ones of far pairs, the nearest is named.
    k = int(mine[np.lexsort((least.upper[mine], values))[0]])
    worst = float(values.min())
    where = str(evidence.pairs[k])
    if verdict is Verdict.UNDECIDED:
        where += f"; {int(counts[UNDECIDED])} of {int(counts.sum())} undecided"
    seen = np.isfinite(least.upper[k])
    return replace(
        row,
        verdict=verdict,
        count=int(counts.sum()),
        worst=worst,
        where=where,
        moment=float(least.interval[k] + least.share[k]) if seen else nan,
        # Of what is undecided the worst is a bound, and no depth that was found.
        deeper=verdict is not Verdict.UNDECIDED and evidence.deepest(k, worst),
    )


def _first(row: Check, contact: FirstContact) -> Check:
    """The row with the beginning of what it names at its worst."""
    found = "first too close" if contact.clear_before else "first found too close"
    pair = f"{contact.pair.own} and {contact.pair.label}"
    moment = _told(contact.moment, contact.time, floor)
    named = "" if row.where == pair else f": {pair}"
    where = f"{row.where}; {found} at waypoint {moment}{named}"
    if contact.intervals:
        last = _told(contact.last, contact.last_time, ceil)
        runs = "" if contact.stretches == 1 else f" in {contact.stretches} stretches"
        many = f"{contact.intervals} interval{'s' if contact.intervals > 1 else ''}"
        where += f"; last at waypoint {last}; {many}{runs}"
    return replace(
        row,
        where=where,
        first_moment=contact.moment,
        last_moment=contact.last,
        too_close_intervals=contact.intervals,
        too_close_stretches=contact.stretches,
    )


def _told(moment: float, time: float, whole: Callable[[float], int]) -> str:
    """A moment in waypoints, and its time where that is known.

    Rounded down where the motion is clear before it, up where it is clear after it.
    """
    text = _thousandths(moment, whole).rstrip("0").rstrip(".")
    return text if isnan(time) else f"{text} ({_thousandths(time, whole)} s)"


def _thousandths(value: float, whole: Callable[[float], int]) -> str:
    return f"{whole(round(1e3 * value, 6)) / 1e3:.3f}"


def _refuted_by(row: Check, found: Counterexample, *, nominal: bool) -> Check:
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
