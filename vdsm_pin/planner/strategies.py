"""Strategies by name: the one place where a new way of planning is added."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, TypeAlias

from vdsm_pin.errors import UnknownName
from vdsm_pin.planner.fewest.strategy import plan_clearest, plan_fewest
from vdsm_pin.planner.pipeline import plan_paper
from vdsm_pin.planner.records import LinkClearance, Plan
from vdsm_pin.problem import PlanningProblem

Strategy: TypeAlias = Callable[[PlanningProblem, LinkClearance, float], Plan]
"""(problem, clearance, margin) -> plan. `margin` is what the strategy shall keep beyond
the required clearance [m]; the refinement raises it where verification asks for it."""

STRATEGIES: Final[Mapping[str, Strategy]] = MappingProxyType(
    {"fewest": plan_fewest, "clearest": plan_clearest, "paper": plan_paper}
)
"""Every strategy a user may name."""


def strategy(name: str) -> Strategy:
    """The strategy of that name.

    Raises:
        UnknownName: If there is none.
    """
    if name not in STRATEGIES:
        raise UnknownName(kind="strategy", name=name, known=tuple(STRATEGIES))
    return STRATEGIES[name]
