"""What users would plan with instead, one module each, all called in the same way.

    follow(problem, robot, clearance) -> Trajectory

`clearance` ends them when their time is over; who has no motion raises `NoPlanFound`.
Pink and OMPL need the extra `references`: pip install 'vdsm-pin[references]'.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Final, TypeAlias, cast

from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import RobotModel
from vdsm_pin.trajectory import Trajectory

Follow: TypeAlias = Callable[[PlanningProblem, RobotModel, LinkClearance], Trajectory]

REFERENCES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "pseudo-inverse": "pseudo_inverse",
        "gradient-projection": "gradient_projection",
        "damped-least-squares": "damped_least_squares",
        "follow-the-leader": "follow_the_leader",
        "mda-rrt": "multi_directional",
        "differential-evolution": "differential_evolution",
        "pink-barriers": "pink_barriers",
        "ompl-rrt-connect": "rrt_connect",
    }
)
"""Module of each reference by its name."""


def reference(name: str) -> Follow:
    """The reference of that name."""
    module = import_module(f"{__name__}.{REFERENCES[name]}")
    return cast(Follow, module.follow)
