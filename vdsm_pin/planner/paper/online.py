"""The paper's rule one tip position at a time: where the arm goes, and its cables.

What a plan has settled (danger region, auxiliary line, side) stays; Steps 2, 3, 5, 6
and 7 are carried out for each position as it comes.
"""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import joint_angles
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.avoidance import Avoidance
from vdsm_pin.planner.paper.lift import lift
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.scale import scale
from vdsm_pin.planner.paper.solve import check_limits
from vdsm_pin.planner.paper.tip_path import Route
from vdsm_pin.planner.records import Plan, TipPath
from vdsm_pin.problem.planning_problem import PlanningProblem


@dataclass(frozen=True)
class Command:
    """What the motors are told for one tip position.

    Args:
        joints: x0, alpha1, theta1, .., shape (1 + 2N,); [m], [rad].
        cables: Lengths of the cables, shape (N, 3); [m].
    """

    joints: FloatArray
    cables: FloatArray


class OnlineRule:
    """Answers tip positions by what a plan of the strategy `paper` has settled.

    Nothing is proved of what lies between two answers.

    Args:
        problem: Whose arm moves.
        avoidance: How Steps 4 and 5 were settled.
    """

    def __init__(self, problem: PlanningProblem, avoidance: Avoidance) -> None:
        self._arm, self._avoidance = problem.manipulator, avoidance

    @classmethod
    def of(cls, plan: Plan) -> "OnlineRule":
        """The rule of a plan of the strategy `paper`.

        Raises:
            ValueError: If it is of another strategy, or with other ratios, which the
                arm takes on by and by.
        """
        if plan.steps is None:
            message = f"the strategy is {plan.strategy!r}, expected 'paper'"
            raise ValueError(message)
        if plan.problem.scaling is not None:
            message = "the plan has ratios of its own, expected those of the arm"
            raise ValueError(message)
        return cls(plan.problem, plan.steps.avoidance)

    def step(self, tip: FloatArray, side: int = 0) -> Command:
        """Joint values and cable lengths for one tip position.

        Args:
            tip: Shape (3,), base frame; [m].
            side: On which side an obstacle along the rail is passed, as in `Route`; 0
                where the straight arm is clear of it.

        Raises:
            Infeasible: If a link is too short for it or a limit is broken.
        """
        points = tip[None]
        here = TipPath(points, np.zeros(1, np.bool_), np.zeros(1))
        route = Route(here, np.array([side]), np.zeros((0, 2)))
        reference = scale(self._arm, project(points))
        planar = self._avoidance.joints(route, reference)
        centres = lift(self._arm, planar, points[:, 0])
        alpha, theta = joint_angles(self._arm, centres)
        x0 = centres[:, 0, 0]
        check_limits(self._arm, x0, alpha, theta)
        angles = np.stack([alpha[0], theta[0]], axis=1).ravel()
        cables = cable_lengths(self._arm, alpha, theta)[0]
        return Command(np.concatenate([x0, angles]), cables)
