"""Damped least squares on Pinocchio, with clearance gradients and the cone of psi."""

import numpy as np

from benchmarks.hrm2000.references.arm import Arm, along
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import RobotModel
from vdsm_pin.trajectory import Trajectory

DAMPING = 1e-8
CLOSE_ENOUGH = 2e-8  # m
MOST_STEPS = 30
PUSHES = 6
GAIN = 0.5


def reach(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """Joint values near q whose tip is there and that are valid, or None."""
    for step in range(MOST_STEPS):
        error, turn = arm.tip(q, tip)
        close = float(np.linalg.norm(error)) < CLOSE_ENOUGH
        if close and (step >= PUSHES or arm.valid(q)):
            return q if arm.valid(q) else None
        square = turn @ turn.T + DAMPING * np.eye(3)
        push = GAIN * arm.push(q) if step < PUSHES else np.zeros(arm.nq)
        rest = push - turn.T @ np.linalg.solve(square, turn @ push)
        q = arm.bounded(q + turn.T @ np.linalg.solve(square, error) + rest)
    return None


def follow(
    problem: PlanningProblem, robot: RobotModel, clearance: LinkClearance
) -> Trajectory:
    """Along the desired path, row after row from the one before.

    Raises:
        NoPlanFound: Where a row is not reached.
    """
    return along(Arm(problem, robot, clearance), reach)
