"""Plan, verify, plan again with a larger margin, until the proof goes through.

The planner looks at places of the motion; between them the arm swings, and only the
verification (proved brackets over continuous time, with Coal as second opinion) knows
by how much. What is missing is added to the margin of the next round. A motion that was
not certified is never handed out as a plan.
"""

import logging
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible, NoPlanFound
from vdsm_pin.planner.records import Plan
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.planner.time_limit import within_time
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import RobotModel
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import ErrorBox, Verdict, Verification
from vdsm_pin.verification.robust import (
    largest_joint_error,
    refuted_joint_error,
    sturdiest,
)
from vdsm_pin.verification.verify import verify

MAX_ROUNDS: Final = 6
"""Rounds before giving up."""

OVERSHOOT: Final = 1.25
"""The margin grows by this times what is missing, as a plan with a larger margin also
swings a little farther; [-]."""

HANDED_OUT: Final = (Verdict.CERTIFIED, Verdict.INCOMPLETE)
"""Verdicts of motions that are clear and within their limits at every instant."""

LOG: Final = logging.getLogger(__name__)


@dataclass(frozen=True)
class Round:
    """One round of planning and verifying.

    Args:
        margin: What the strategy was asked to keep beyond the required clearance; [m].
        verdict: What the verification said.
        clearance: Proved smallest clearance to obstacles; infinite without any; [m].
        reason: Why the round ended as it did, one sentence.
    """

    margin: float
    verdict: Verdict
    clearance: float
    reason: str


@dataclass(frozen=True)
class Refinement:
    """A plan and how it came about.

    Args:
        plan: The plan, its notes extended by the rounds.
        verification: Its verification: certified, or incomplete.
        rounds: Every round; the last one has the same verdict.
    """

    plan: Plan
    verification: Verification
    rounds: tuple[Round, ...]


def plan_and_verify(
    problem: PlanningProblem,
    strategy_name: str,
    robot: RobotModel,
    *,
    time_limit: float | None = None,
) -> Refinement:
    """Plan by a strategy until the verification has nothing against the plan.

    Args:
        problem: What is asked.
        strategy_name: A name in `STRATEGIES`.
        robot: The arm as Pinocchio and Coal see it.
        time_limit: For planning in all rounds, without the last proof; None for none;
            [s].

    Returns:
        The plan; incomplete where it draws less of the path than required.

    Raises:
        UnknownName: If there is no such strategy.
        Infeasible: If the strategy has no plan, or none that is proved;
            `OutOfTime` if the limit ended the planning.
    """
    plan_with = strategy(strategy_name)
    clearance = within_time(link_clearance(problem), time_limit)
    rounds: list[Round] = []
    margin = 0.0
    while True:
        try:
            plan = _chosen(plan_with(problem, clearance, margin))
        except Infeasible as error:
            if rounds:
                error.args = (f"{error}; before that {_story(rounds)}",)
            raise
        verification = verify(problem, plan.trajectory, robot)
        rounds.append(_round(margin, verification))
        LOG.info("margin %.6f m: %s", margin, rounds[-1].reason)
        if verification.verdict in HANDED_OUT:
            notes = plan.notes if len(rounds) == 1 else (*plan.notes, _story(rounds))
            return Refinement(replace(plan, notes=notes), verification, tuple(rounds))
        missing = problem.required_clearance - rounds[-1].clearance
        if not missing > 0.0 or len(rounds) == MAX_ROUNDS:
            raise NoPlanFound(_story(rounds))
        margin += OVERSHOOT * missing + TOLERANCES.planned_clearance


def _chosen(plan: Plan) -> Plan:
    """Of a plan and its rivals the one that is proved to survive the most."""
    if not plan.rivals:
        return plan
    plans, problem, none = (*plan.rivals, plan), plan.problem, ErrorBox()
    best, error = sturdiest(problem, [one.trajectory for one in plans])
    note = (
        f"every joint may be off by {np.rad2deg(error):.3f} deg at once (proved); of "
        f"{len(plans)} plans that draw as much none was proved to survive more"
    )
    start = plan.trajectory.part(0, 1)
    survived = largest_joint_error(problem, start, none)
    lost = refuted_joint_error(problem, start, none, survived)
    if np.isfinite(lost):
        note += (
            f"; the start itself does not survive {np.rad2deg(lost):.3f} deg (proved)"
        )
    return replace(plans[best], notes=(*plans[best].notes, note), rivals=())


def _round(margin: float, verification: Verification) -> Round:
    """The round in numbers and words; the worst check that failed is its reason."""
    failed = [
        check for check in verification.checks if check.verdict is not Verdict.CERTIFIED
    ]
    failed.sort(key=lambda check: check.verdict is not Verdict.REFUTED)
    reason = "every check passed"
    if failed:
        check = failed[0]
        reason = (
            f"{check.name}: {check.verdict} with {check.worst:.6g} {check.unit} "
            f"against {check.limit:.6g} {check.unit}"
        )
    return Round(margin, verification.verdict, verification.min_clearance, reason)


def _story(rounds: list[Round]) -> str:
    """The rounds in one sentence."""
    parts = [
        f"round {k} with a margin of {one.margin * 1e3:.3f} mm was {one.verdict} "
        f"({one.reason})"
        for k, one in enumerate(rounds, start=1)
    ]
    return "; ".join(parts)
