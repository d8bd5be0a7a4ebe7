"""The strategy `paper-clearest`: the paper's rule, as far from obstacles as it goes.

"The path is planned as far from the surface as possible" (section 4.2).
"""

from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible, OutOfTime
from vdsm_pin.planner.largest_margin import IMPROVE_SHARE, drawn_length, widest
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.planner.records import (
    UNMEASURED,
    LinkClearance,
    Margin,
    Measure,
    Plan,
)
from vdsm_pin.planner.time_limit import with_share
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

ROUNDS: Final = 20
"""Most halvings: as many as 50 m need."""


def plan_paper_clearest(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margin: Margin,
    measure: Measure = UNMEASURED,
) -> Plan:
    """The plan of the paper's rule with the widest danger region that draws as much.

    Arguments and errors are those of `plan_paper`.
    """
    first = replace(plan_paper(problem, clearance, margin), strategy="paper-clearest")
    if not problem.scene.obstacles:
        return first
    kept = problem.required_clearance + np.max(margin)
    try:
        low, high = (
            float(clearance(centres).min()) - kept
            for centres in (first.centres, first.centres[:1])
        )
    except OutOfTime:
        return first
    hurried = with_share(clearance, IMPROVE_SHARE)
    found = widest(
        lambda more: plan_paper(problem, hurried, margin + more),
        first,
        max(low, 0.0),
        high,
        rounds=ROUNDS,
        until=TOLERANCES.widest_region,
    )
    plan = found.plans[-1]
    if measure is not UNMEASURED:
        # The widest of them once more, Coal measuring; else it stays as it is.
        with suppress(Infeasible, OutOfTime):
            steered = plan_paper(problem, clearance, margin + found.reserve, measure)
            if drawn_length(steered) >= drawn_length(plan) - TOLERANCES.joint_centre:
                plan = steered
    notes = (*plan.notes, found.told(kept))
    return replace(plan, strategy=first.strategy, notes=notes)
