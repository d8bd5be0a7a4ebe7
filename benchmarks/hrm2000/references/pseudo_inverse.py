"""The pseudo-inverse of the tip's Jacobian alone: no obstacle is looked at."""

import numpy as np

from benchmarks.hrm2000.references.arm import Arm, along
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import RobotModel
from vdsm_pin.trajectory import Trajectory

CLOSE_ENOUGH = 2e-8  # m
MOST_STEPS = 30


def reach(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """Joint values near q whose tip is there and that keep the limits, or None."""
    for _ in range(MOST_STEPS):
        error, turn = arm.tip(q, tip)
        if float(np.linalg.norm(error)) < CLOSE_ENOUGH:
            return q
        q = arm.bounded(q + np.linalg.pinv(turn) @ error)
    return None


def follow(
    problem: PlanningProblem, robot: RobotModel, clearance: LinkClearance
) -> Trajectory:
    """Along the desired path; whether it is clear is left to the judge.

    Raises:
        NoPlanFound: Where a row is not reached.
    """
    return along(Arm(problem, robot, clearance), reach)
