"""Single postures of an arm, as motions of one row."""

import numpy as np

from vdsm_pin.arm.kinematics import straight_joints
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory


def one_row(joints: FloatArray) -> Trajectory:
    """The motion that stays at q = (x0, alpha1, theta1, ..), shape (1 + 2N,)."""
    return Trajectory.of_joints(joints[None])


def at_start(problem: PlanningProblem) -> Trajectory:
    """The arm where it begins.

    A start known by its tip is the straight arm's; where any start will do the arm is
    straight along its rail.
    """
    arm, begin = problem.manipulator, problem.begin
    if begin is None:
        low, high = arm.base_range
        joints = np.zeros(1 + 2 * arm.n_links)
        joints[0] = min(max(low, 0.0), high)
        return one_row(joints)
    if begin.joints is None:
        return one_row(straight_joints(arm, begin.tip))
    return one_row(begin.joints)
