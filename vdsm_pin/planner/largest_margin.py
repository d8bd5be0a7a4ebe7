"""The largest reserve for which there is still a plan, by bisection."""

from collections.abc import Callable
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible
from vdsm_pin.planner.records import Plan
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

ROUNDS: Final = 6
"""Halvings of the reserve; the last tells it to 1/64 of where it was sought."""


def drawn_length(plan: Plan) -> float:
    """Length that the tip draws; [m]."""
    on = plan.trajectory.on_path
    step = np.linalg.norm(np.diff(plan.tip_path.points, axis=0), axis=1)
    return float(step[on[:-1] & on[1:]].sum())


def told(kept: float) -> str:
    """What was found out, by the clearance that the last plan was to keep; [m]."""
    return f"of the plans that were to keep more than {in_mm(kept)} none draws as much"


def widest(
    plan_with: Callable[[float], Plan],
    first: Plan,
    low: float,
    high: float,
    rounds: int = ROUNDS,
    until: float = 0.0,
) -> tuple[list[Plan], float]:
    """Plans with more and more in reserve that draw as much as the first one.

    Args:
        plan_with: A plan that keeps a reserve; raises `Infeasible` where it has none.
        first: What there is without any search.
        low: A reserve it has.
        high: A reserve that nothing has.
        rounds: Most halvings.
        until: Width of what is left at which to stop, in the unit of the reserves.

    Returns:
        The plans, the first one included, and the reserve of the last.
    """
    plans, whole = [first], drawn_length(first) - TOLERANCES.joint_centre
    for _ in range(rounds):
        if not until < high - low < np.inf:
            break
        middle = (low + high) / 2.0
        try:
            plan = plan_with(middle)
        except Infeasible:
            high = middle
            continue
        if drawn_length(plan) < whole:
            high = middle
        else:
            plans.append(plan)
            low = middle
    return plans, low
