"""Plan, measure, verify, plan again with larger margins, until the proof goes through.

Coal measures every plan at its waypoints: what it finds missing between a link and an
obstacle is added to their margin, and the plan is made again, by a strategy that is
told the largest margin of each link. Between waypoints the arm swings, and only the
verification (proved brackets over continuous time) knows by how much; what it finds
missing is added in the same way. Coal proposes, the bracket proves: a motion with a
failed check is never handed out as a plan.
"""

from dataclasses import dataclass, replace
from math import ceil, floor
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.margins import (
    CoalMeasure,
    Margins,
    by_coal,
    by_proof,
    of_pairs,
    raised_margins,
)
from vdsm_pin.planner.feed import within_feed
from vdsm_pin.planner.goals import with_ends, with_path
from vdsm_pin.planner.records import Adjustment, Plan
from vdsm_pin.planner.start import with_known_insides
from vdsm_pin.planner.strategies import ANY_WAY, strategy
from vdsm_pin.planner.time_limit import within_time
from vdsm_pin.planner.waiting import waited
from vdsm_pin.problem.desired_path import Approach
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.progress import say
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm, quantity
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import ArmVerification, Verdict
from vdsm_pin.verification.robust import (
    largest_joint_error,
    refuted_joint_error,
    sturdiest,
)
from vdsm_pin.verification.start_links import check_links_at_start
from vdsm_pin.verification.verify import verify

MAX_ROUNDS: Final = 8
"""Times that a strategy is asked before giving up."""

HANDED_OUT: Final = (Verdict.CERTIFIED, Verdict.INCOMPLETE)
"""Verdicts of motions that are clear and within their limits at every instant."""

UNPROVED: Final = "a motion was found, but not proved"


@dataclass(frozen=True)
class Round:
    """One round of planning, measuring and verifying.

    Args:
        margin: The largest that a link was asked to keep from an obstacle beyond the
            required clearance; [m].
        verdict: What the verification said; None where Coal found clearance missing
            and nothing was proved.
        clearance: Smallest clearance to obstacles, proved, or measured where nothing
            was proved; infinite without any; [m].
        reason: Why the round ended as it did, one sentence.
        adjustments: The margins that were raised after it, or the joints that were
            moved on.
    """

    margin: float
    verdict: Verdict | None
    clearance: float
    reason: str
    adjustments: tuple[Adjustment, ...] = ()


@dataclass(frozen=True)
class Refinement:
    """A plan and how it came about.

    Args:
        plan: The plan, its notes extended by the rounds.
        verification: Its verification: certified, or incomplete.
        rounds: Every round; the last one has the same verdict, of the scene at rest
            where obstacles move.
    """

    plan: Plan
    verification: ArmVerification
    rounds: tuple[Round, ...]


def plan_and_verify(
    problem: PlanningProblem, strategy_name: str, *, deadline: Deadline = NO_LIMIT
) -> Refinement:
    """Plan by a strategy until the verification has nothing against the plan.

    Where obstacles move, the plan stands at its start until all have come to rest.

    Args:
        problem: What is asked.
        strategy_name: A name in `STRATEGIES`.
        deadline: When planning and proving must have ended.

    Returns:
        The plan; incomplete where it draws less of the path than required.

    Raises:
        UnknownName: If there is no such strategy.
        Infeasible: If the strategy has no plan, or none that is proved.
        OutOfTime: If the time is over.
        InvalidInput: If the last link shall look nowhere somewhere on the path.
    """
    scene, path = problem.scene, problem.tip_path
    if path is not None and path.pointing is not None:
        path.pointing.check_aims(path.corners)
    if not scene.moving:
        return _plan_at_rest(problem, strategy_name, deadline)
    still = replace(problem, scene=scene.at_time(scene.rest_time))
    found = _plan_at_rest(still, strategy_name, deadline)
    plan = waited(found.plan, problem)
    verification = verify(
        _promised(problem), plan.trajectory, deadline=deadline, centres=plan.centres
    )
    if verification.verdict not in HANDED_OUT:
        deadline.check(UNPROVED)
        why = _worst(verification)
        message = f"a plan was found for where all comes to rest, but not proved: {why}"
        raise NoPlanFound(message)
    return Refinement(plan, verification, found.rounds)


def _plan_at_rest(
    problem: PlanningProblem, strategy_name: str, deadline: Deadline
) -> Refinement:
    """`plan_and_verify` of a problem in which no obstacle moves."""
    plan_with = with_ends(
        problem, strategy(strategy_name), any_way=strategy_name in ANY_WAY
    )
    if problem.scaling is not None and strategy_name != "paper":
        message = f"strategy {strategy_name!r} does not read ratios, which 'paper' does"
        raise NoPlanFound(message)
    known = within_feed(with_known_insides(with_path(problem)))
    check_links_at_start(known.problem, deadline)
    clearance = within_time(link_clearance(known.problem), deadline)
    rounds: list[Round] = []
    margins: Margins = {}
    promised, measure = _promised(problem), CoalMeasure(problem, deadline)
    for asked in range(1, MAX_ROUNDS + 1):
        try:
            kept = of_pairs(margins, known.problem)
            found = plan_with(known.problem, clearance, kept, measure)
            plan = _chosen(problem, found, deadline)
        except (Infeasible, OutOfTime) as error:
            error.notes = known.notes
            error.more = (f"before that {_story(rounds)}",) if rounds else ()
            raise
        rounds += [_measured(margins, ended) for ended in plan.rounds]
        adjustments = by_coal(plan, measure, margins)
        if adjustments:
            rounds.append(_measured(margins, adjustments))
        else:
            verification = verify(
                promised, plan.trajectory, deadline=deadline, centres=plan.centres
            )
            if verification.verdict not in HANDED_OUT:
                deadline.check(UNPROVED)
            adjustments = by_proof(verification, margins)
            rounds.append(_proved(margins, verification, adjustments))
        widest = in_mm(rounds[-1].margin)
        say("planned with a margin of %s; %s", widest, rounds[-1].reason)
        if rounds[-1].verdict in HANDED_OUT:
            story = (_story(rounds),) if len(rounds) > 1 else ()
            told = (*plan.notes, *_unread_scheme(plan), *known.notes, *story)
            plan = replace(plan, notes=told)
            return Refinement(plan, verification, tuple(rounds))
        if not adjustments or asked == MAX_ROUNDS:
            break
        margins = raised_margins(margins, adjustments)
    raise NoPlanFound("; ".join([*known.notes, _story(rounds)]))


def _unread_scheme(plan: Plan) -> tuple[str, ...]:
    """A note where the problem states an `approach` that this plan did not use."""
    path = with_path(plan.problem).path
    if path.approach is Approach.SHORTEST:
        return ()
    why = "the path is open"
    if path.closed:
        if plan.steps is not None and plan.steps.reads_approach:
            return ()
        why = "no obstacle along the rail is passed"
        if plan.steps is None:
            why = f"strategy {plan.strategy!r} chooses its way by itself"
    return (
        f"approach {path.approach.value!r} is not read: {why}; the path begins "
        f"{'nearest to the start' if path.closed else 'at its first corner'}",
    )


def _promised(problem: PlanningProblem) -> PlanningProblem:
    """The problem with the limit of the change per row that every plan keeps."""
    limit = min(problem.max_row_change or np.inf, TOLERANCES.row_change)
    return replace(problem, max_row_change=limit)


def _chosen(problem: PlanningProblem, plan: Plan, deadline: Deadline) -> Plan:
    """The plan that is proved to survive the largest joint error, of it and its rivals.

    Args:
        problem: The problem as asked; that of the plan may have hulls for meshes.
        plan: The plan, with its rivals.
        deadline: When to give up.

    Raises:
        OutOfTime: If the time is over.
    """
    if not plan.rivals:
        return replace(plan, problem=problem)
    plans, planned, none = (plan, *plan.rivals), plan.problem, ErrorBox()
    motions = [one.trajectory for one in plans]
    best, error = sturdiest(planned, motions, deadline)
    kept = quantity(error, "rad", floor)
    note = (
        f"every joint may be off by ±{kept} at once (proved); of "
        f"{len(plans)} plans that draw as much none was proved to survive 0.001° more"
    )
    start = plan.trajectory.part(0, 1)
    survived = largest_joint_error(planned, start, none, deadline)
    lost = refuted_joint_error(problem, start, none, survived, deadline)
    if np.isfinite(lost):
        more = quantity(lost, "rad", ceil)
        note += f"; the start itself does not survive ±{more} (proved)"
    chosen = plans[best]
    return replace(chosen, problem=problem, notes=(*chosen.notes, note), rivals=())


def _measured(margins: Margins, adjustments: tuple[Adjustment, ...]) -> Round:
    """A round that Coal ended."""
    worst = min(adjustments, key=lambda one: one.distance)
    reason = (
        f"Coal measures {in_mm(worst.distance)} between link {worst.link} and "
        f"{worst.obstacle} at waypoint {worst.moment:.0f}"
    )
    return Round(_largest(margins), None, worst.distance, reason, adjustments)


def _proved(
    margins: Margins,
    verification: ArmVerification,
    adjustments: tuple[Adjustment, ...],
) -> Round:
    """A round that was verified."""
    verdict, clearance = verification.verdict, verification.min_clearance
    why = _worst(verification)
    return Round(_largest(margins), verdict, clearance, why, adjustments)


def _worst(verification: ArmVerification) -> str:
    """The worst check that failed, in words."""
    failed = [
        check for check in verification.checks if check.verdict is not Verdict.CERTIFIED
    ]
    failed.sort(key=lambda check: check.verdict is not Verdict.REFUTED)
    if not failed:
        return "every check passed"
    check = failed[0]
    worst, limit = (quantity(value, check.unit) for value in (check.worst, check.limit))
    where = f" ({check.where})" if check.where else ""
    return f"{check.name}: {check.verdict} with {worst} against {limit}{where}"


def _largest(margins: Margins) -> float:
    return max(margins.values(), default=0.0)


def _story(rounds: list[Round]) -> str:
    """All rounds in one sentence, for notes and messages."""
    parts = [
        f"round {k} with a margin of {in_mm(one.margin)} was "
        f"{one.verdict or 'too near'} ({one.reason})"
        for k, one in enumerate(rounds, start=1)
    ]
    return "; ".join(parts)
