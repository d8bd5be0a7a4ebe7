"""What users would plan with instead, all called in the same way.

    follow(problem, robot, clearance) -> Trajectory

`clearance` ends them when their time is over; who has no motion raises `NoPlanFound`.
Pink and OMPL need the extra `references`: pip install 'vdsm-pin[references]'.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final, TypeAlias, cast

from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.pinocchio_arm import PinocchioArm

Follow: TypeAlias = Callable[[PlanningProblem, PinocchioArm, LinkClearance], Trajectory]

REFERENCES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "pseudo-inverse": "jacobian:pseudo_inverse",
        "gradient-projection": "jacobian:gradient_projection",
        "damped-least-squares": "jacobian:damped_least_squares",
        "differential-evolution": "intelligent:differential_evolution",
        "vlv-de": "intelligent:variable_length_evolution",
        "particle-swarm": "intelligent:particle_swarm",
        "genetic": "intelligent:genetic",
        "simulated-annealing": "intelligent:simulated_annealing",
        "fireflies": "intelligent:fireflies",
        "bee-colony": "intelligent:bee_colony",
        "spiral": "spiral:reach",
        "neural-network": "neural_network:follow",
        "follow-the-leader": "follow_the_leader:follow",
        "mda-rrt": "multi_directional:follow",
        "pink-barriers": "pink_barriers:follow",
        "ompl-rrt-connect": "rrt_connect:follow",
    }
)
"""Module and function of each: `follow`, or what finds one row from the one before."""


def reference(name: str) -> Follow:
    """The reference of that name."""
    file, function = REFERENCES[name].split(":")
    found: Any = getattr(import_module(f"{__name__}.{file}"), function)
    return cast(Follow, found) if function == "follow" else row_by_row(found)


def row_by_row(reach: Any) -> Follow:
    """The motion of a `Reach` along the whole path; see `arm.along`."""
    from benchmarks.hrm2000.references.arm import Arm, along

    return lambda problem, robot, clearance: along(
        Arm(problem, robot, clearance), reach
    )
