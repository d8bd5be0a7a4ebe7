"""Strategies by name: the one place where a new way of planning is added.

A strategy is imported when it is asked for, so that its name costs nothing.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeAlias, cast

from vdsm_pin.errors import UnknownName

if TYPE_CHECKING:
    from vdsm_pin.planner.records import LinkClearance, Margin, Measure, Plan
    from vdsm_pin.problem.planning_problem import PlanningProblem

Strategy: TypeAlias = (
    "Callable[[PlanningProblem, LinkClearance, Margin, Measure], Plan]"
)
"""(problem, clearance, margin, measure) -> plan. `margin` is what the strategy shall
keep beyond the required clearance, of each link and obstacle [m]; the refinement raises
it where Coal or the proof asks for it. `measure` is Coal's, for who moves joints by
it."""

STRATEGIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "fewest": "vdsm_pin.planner.fewest.strategy:plan_fewest",
        "clearest": "vdsm_pin.planner.fewest.strategy:plan_clearest",
        "sturdiest": "vdsm_pin.planner.fewest.strategy:plan_sturdiest",
        "follow-the-leader": "vdsm_pin.planner.leader:plan_follow_the_leader",
        "paper": "vdsm_pin.planner.paper.pipeline:plan_paper",
        "paper-clearest": "vdsm_pin.planner.paper.clearest:plan_paper_clearest",
    }
)
"""Module and function of every strategy a user may name; the first is the default."""

ANY_WAY: Final = frozenset({"fewest", "clearest", "sturdiest"})
"""Strategies that do not say how the arm comes to the path: any way will do."""

DEFAULT_STRATEGY: Final = next(iter(STRATEGIES))
"""What plans where no strategy is named."""


def strategy(name: str) -> Strategy:
    """The strategy of that name.

    Raises:
        UnknownName: If there is none.
    """
    if name not in STRATEGIES:
        raise UnknownName(kind="strategy", name=name, known=tuple(STRATEGIES))
    module, function = STRATEGIES[name].split(":")
    return cast("Strategy", getattr(import_module(module), function))
