"""The largest joint error that a motion's clearance survives, by bisection."""

from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.clearance import is_certified
from vdsm_pin.verification.records import ErrorBox

LARGEST: Final = float(np.deg2rad(45.0))
"""Errors beyond this are not looked at; [rad]."""


def largest_joint_error(
    problem: PlanningProblem, trajectory: Trajectory, errors: ErrorBox
) -> float:
    """The largest joint error for which the clearance proof still goes through.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion.
        errors: Base and obstacle errors to assume besides; its joint error is ignored.

    Returns:
        A joint error that was proved, within `TOLERANCES.joint_error` of one that was
        not; 0 where not even the nominal motion is certified; [rad].
    """

    def holds(joint: float) -> bool:
        return is_certified(problem, trajectory, replace(errors, joint=joint))

    if not holds(0.0):
        return 0.0
    low, high = 0.0, TOLERANCES.joint_error
    while high < LARGEST and holds(high):
        low, high = high, 4.0 * high
    while high - low > TOLERANCES.joint_error:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
