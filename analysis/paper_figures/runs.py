"""The plans that the figures show: the paper's scenes, planned and verified once."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import Infeasible
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import Refinement, plan_and_verify
from vdsm_pin.verification.records import ArmVerification

SCENES: Final = ("obs1", "obs2", "obs2-small", "obs3", "free")
"""The paper's environments; obs2 in both readings."""

STRATEGIES: Final = ("paper", "fewest")
"""What is shown side by side."""

SCENE_TITLES: Final = {
    "obs1": "obs1: cylinder along X",
    "obs2": "obs2: prism along X",
    "obs2-small": "obs2-small: prism along X",
    "obs3": "obs3: cylinder along Z",
    "free": "without obstacles",
}


@dataclass(frozen=True)
class Run:
    """One certified plan.

    Args:
        scene: Name of the scene.
        strategy: Name of the strategy.
        refinement: The certified plan and how it came about.
    """

    scene: str
    strategy: str
    refinement: Refinement

    @property
    def plan(self) -> Plan:
        """What was planned."""
        return self.refinement.plan

    @property
    def verification(self) -> ArmVerification:
        """How it was certified."""
        return self.refinement.verification

    @property
    def problem(self) -> PlanningProblem:
        """What was asked."""
        return self.plan.problem

    @property
    def trajectory(self) -> Trajectory:
        """The motion."""
        return self.plan.trajectory

    @property
    def centres(self) -> FloatArray:
        """Joint centres, shape (n_samples, N + 1, 3); [m]."""
        return self.plan.centres

    @property
    def psi(self) -> FloatArray:
        """Link angles, shape (n_samples, N); [rad]."""
        return link_angles(self.trajectory.alpha, self.trajectory.theta)

    @property
    def title(self) -> str:
        """Scene and strategy in words."""
        return f"{SCENE_TITLES[self.scene]}, strategy ‘{self.strategy}’"


class Runs:
    """Plans by scene and strategy, each made when first asked for."""

    def __init__(self, spacing: float | None = None) -> None:
        """Use the problem files' spacing of waypoints, or another one [m]."""
        self._spacing = spacing
        self._made: dict[tuple[str, str], Run] = {}

    def problem(self, scene: str) -> PlanningProblem:
        """The problem of a scene."""
        problem = read_problem(f"paper/{scene}")
        if self._spacing is None:
            return problem
        return replace(problem, tip_path=replace(problem.path, spacing=self._spacing))

    def __call__(self, scene: str, strategy: str) -> Run:
        """The certified plan of a scene by a strategy.

        Raises:
            Infeasible: If there is none.
        """
        key = (scene, strategy)
        if key not in self._made:
            problem = self.problem(scene)
            found = plan_and_verify(problem, strategy)
            self._made[key] = Run(scene, strategy, found)
        return self._made[key]

    def both(self, scene: str) -> tuple[Run, ...]:
        """The certified plans of a scene, by every strategy that has one."""
        found = []
        for strategy in STRATEGIES:
            try:
                found.append(self(scene, strategy))
            except Infeasible:
                continue
        return tuple(found)


def degrees(angles: FloatArray) -> FloatArray:
    """Angles in degrees."""
    return np.asarray(np.rad2deg(angles))
