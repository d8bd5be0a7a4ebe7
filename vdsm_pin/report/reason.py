"""The verdict in one sentence, and what it rests on."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

from vdsm_pin.arm.bodies import MEET
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.report.rows import LeftOutRow
from vdsm_pin.report.words import at_least, check_cells, finite, place, rounding
from vdsm_pin.text import listed
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import percent, quantity
from vdsm_pin.verification.inside import surfaces
from vdsm_pin.verification.records import (
    ArmVerification,
    Check,
    CheckKind,
    Verdict,
    Verification,
)
from vdsm_pin.verification.task import ignored_pairs

_PASSED: Final = Verdict.CERTIFIED


def nearest_to_obstacle(verification: Verification) -> int | None:
    """Index of the closest approach to an obstacle; None without obstacles.

    Under errors that is the one proved to keep the least, unless the nearest is found
    to be too near.
    """
    rows = verification.approaches
    near = [i for i, row in enumerate(rows) if row.pair.obstacle]
    if not near or rows[near[0]].upper < verification.problem.required_clearance:
        return near[0] if near else None
    weakest, gap = min(near, key=lambda i: rows[i].lower), TOLERANCES.least_bracket
    weaker = rows[weakest].lower < rows[near[0]].lower - 2.0 * gap
    return weakest if weaker else near[0]


def failing(verification: Verification) -> tuple[Check, ...]:
    """The checks that did not pass: what decides the verdict first."""
    bad = [check for check in verification.checks if check.verdict is not _PASSED]
    return tuple(sorted(bad, key=lambda one: one.verdict is not verification.verdict))


def reason(verification: Verification) -> str:
    """The verdict in one sentence."""
    if verification.verdict is Verdict.CERTIFIED:
        return _certified_sentence(verification)
    if isinstance(verification, ArmVerification) and (
        verification.verdict is Verdict.INCOMPLETE
    ):
        return _incomplete_sentence(verification, _left_out(verification))
    bad = [c for c in verification.checks if c.verdict is verification.verdict]
    if not bad:
        return "No check was carried out, so nothing is proved."
    first = bad[0]
    worst, asked = check_cells(first)
    found = f"{first.name} is {_bound(first)}{worst}"
    inside = first.name in (CheckKind.ARM_OUTSIDE, CheckKind.LINKS_OUTSIDE)
    if inside:
        found = first.where
    elif not math.isfinite(first.worst):
        found = f'there is no evidence for "{first.name}"'
    elif not math.isnan(first.limit):
        found += f" against a limit of {asked}"
    where = "" if inside else first.where
    at = place(finite(first.moment), where, verification.time_at(first.moment))
    if at:
        found += f" ({at})"
    share = f"{len(bad)} of {len(verification.checks)} checks"
    first_of = ", the first: " if len(bad) > 1 else ": "
    if verification.verdict is Verdict.REFUTED:
        return f"The motion breaks {share}{first_of}{found}."
    undecided = f"The proof is not complete, {share} undecided{first_of}{found}."
    return f"{undecided} This counts as not passed."


def _bound(check: Check) -> str:
    """What the worst value of a check that did not pass is of the true one, in words.

    A clearance that is refuted is as small as two points are apart, perhaps smaller;
    where it is told rounded down, lest it reads as its limit, it is not at most that.
    """
    whole = rounding(check)
    if whole is None or check.deeper:
        return ""
    if check.verdict is Verdict.REFUTED:
        return "at most " if whole is math.ceil else ""
    return "proved to be at least "


def plan_reason(plan: Plan, verification: ArmVerification) -> str:
    """The verdict on a plan in one sentence, with what the strategy knows of it."""
    if verification.verdict is not Verdict.INCOMPLETE or not plan.undrawn:
        return reason(verification)
    why = f"the path is not drawn {'; '.join(plan.undrawn)}"
    return _incomplete_sentence(verification, why)


def _incomplete_sentence(verification: ArmVerification, why: str) -> str:
    drawn = percent(verification.coverage)
    required = percent(verification.problem.path.required_coverage)
    drew = f"The motion draws {drawn} of the desired path, {required} is required"
    return f"{drew}: {why}."


def _left_out(verification: ArmVerification) -> str:
    """What the motion leaves out of the desired path, in words."""
    gaps = verification.undrawn
    if not len(gaps):
        return "no waypoint draws the desired path"
    first = " to ".join(quantity(float(station), "m") for station in gaps[0])
    stretches = "1 stretch, from" if len(gaps) == 1 else f"{len(gaps)} stretches, from"
    return f"it leaves out {stretches} {first} along the path"


def _certified_sentence(verification: Verification) -> str:
    count = len(verification.checks)
    smallest, drawn, who = verification.min_clearance, "", "robot"
    if isinstance(verification, ArmVerification):
        who, drawn = "arm", "; no desired path is asked for"
        if verification.problem.tip_path is not None:
            share = percent(verification.coverage)
            drawn = f"; {share} of the desired path is drawn"
    problem, but = verification.problem, _not_held(verification)
    if smallest == math.inf:
        none = "held apart" if problem.scene.obstacles else "there"
        return (
            f"All {count} checks passed over the whole motion; no obstacle is {none}"
            f"{but}{drawn}."
        )
    required = at_least(problem.required_clearance)
    box = asdict(verification.errors)
    errors = ", with any error of the error box," if any(box.values()) else ""
    return (
        f"All {count} checks passed; at every instant of the motion{errors} the {who} "
        f"keeps at least {at_least(smallest)} from every obstacle{but}, "
        f"{required} are required{drawn}."
        + "".join(f" {name!r} is a surface only." for name in surfaces(problem))
    )


def _not_held(verification: Verification) -> str:
    """Which obstacles some part of the arm is not held apart from, by its problem."""
    problem = verification.problem
    if not isinstance(problem, PlanningProblem) or not problem.manipulator.ignore_pairs:
        return ""
    if not (ignored := ignored_pairs(problem)):
        return ""
    names = listed([f"{one.body} and {one.other}" for one in ignored])
    return f" (the problem leaves out {names})"


def left_out_words(rows: Sequence[LeftOutRow]) -> str:
    """The same in one sentence, each reason of links next to each other once."""
    words, joints = [], 0
    for row in rows:
        if row.reason.startswith(MEET) and row.other.startswith("link"):
            joints += 1
        else:
            words.append(f"{row.body} and {row.other} ({row.reason})")
    if joints:
        meet = "links next to each other, which meet at their joint in every pose"
        words.insert(0, meet)
    return "; ".join(words)
