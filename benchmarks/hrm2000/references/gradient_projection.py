"""Gradient projection: the pseudo-inverse, and a push off obstacles in its null space.

The push never moves the tip. That of the damped least squares beside is given up after
a few steps, and a row that is not clear ends them; here the judge is told all rows.
"""

import numpy as np

from benchmarks.hrm2000.references.arm import Arm, along
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import RobotModel
from vdsm_pin.trajectory import Trajectory

CLOSE_ENOUGH = 2e-8  # m
MOST_STEPS = 30
PUSHES = 10
GAIN = 0.5


def reach(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """Joint values near q whose tip is there, pushed off what is near, or None."""
    for step in range(MOST_STEPS):
        error, turn = arm.tip(q, tip)
        if float(np.linalg.norm(error)) < CLOSE_ENOUGH and step >= PUSHES:
            return q
        back = np.linalg.pinv(turn)
        push = GAIN * arm.push(q) if step < PUSHES else np.zeros(arm.nq)
        q = arm.bounded(q + back @ error + push - back @ (turn @ push))
    return None


def follow(
    problem: PlanningProblem, robot: RobotModel, clearance: LinkClearance
) -> Trajectory:
    """Along the desired path; whether it is clear is left to the judge.

    Raises:
        NoPlanFound: Where a row is not reached.
    """
    return along(Arm(problem, robot, clearance), reach)
