"""The largest reserve for which there is still a plan, by bisection."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible, OutOfTime
from vdsm_pin.planner.records import Plan
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import at_most_mm

ROUNDS: Final = 6
"""Halvings of the reserve; the last tells it to 1/64 of where it was sought."""

IMPROVE_SHARE: Final = 0.5
"""Part of the time left for making a plan better; the rest is for its proof; [-]."""


def drawn_length(plan: Plan) -> float:
    """Length that the tip draws; [m]."""
    on = plan.trajectory.on_path
    step = np.linalg.norm(np.diff(plan.tip_path.points, axis=0), axis=1)
    return float(step[on[:-1] & on[1:]].sum())


@dataclass(frozen=True)
class Widest:
    """Plans with more and more in reserve.

    Args:
        plans: In the order of their reserves.
        beyond: The least reserve that was tried in vain, else one that nothing has.
        reserve: What the last plan was to keep; 0 for the first, which is given.
        tried: Whether it was tried.
        in_time: Whether the search came to its end before the time was over.
    """

    plans: list[Plan]
    beyond: float
    reserve: float = 0.0
    tried: bool = False
    in_time: bool = True

    def told(self, kept: float) -> str:
        """What was found out, by the clearance kept without a reserve; [m]."""
        most = at_most_mm(kept + self.beyond)
        if not self.in_time:
            return "the time was over before all plans that keep more were tried"
        if self.tried:
            return f"of the plans that were to keep {most} none draws as much"
        return f"no plan keeps more than {most}, which the start or a tip leaves"


def widest(
    plan_with: Callable[[float], Plan],
    first: Plan,
    low: float,
    high: float,
    rounds: int = ROUNDS,
    until: float = 0.0,
) -> Widest:
    """Plans with more and more in reserve that draw as much as the first one.

    Args:
        plan_with: A plan that keeps a reserve; raises `Infeasible` where it has none,
            `OutOfTime` where the search has to end.
        first: What there is without any search.
        low: A reserve it has.
        high: A reserve that nothing has.
        rounds: Most halvings.
        until: Width of what is left at which to stop, in the unit of the reserves.

    Returns:
        The plans, the first one included.
    """
    plans, whole = [first], drawn_length(first) - TOLERANCES.joint_centre
    reserve, tried = 0.0, False
    for _ in range(rounds):
        if not until < high - low < np.inf:
            break
        middle = (low + high) / 2.0
        try:
            plan = plan_with(middle)
        except OutOfTime:
            return Widest(plans, high, reserve, tried, in_time=False)
        except Infeasible:
            plan = None
        if plan is not None and drawn_length(plan) >= whole:
            plans.append(plan)
            low = reserve = middle
        else:
            high, tried = middle, True
    return Widest(plans, high, reserve, tried)
