"""Forward kinematics by two roads: Pinocchio on the URDF against the closed form."""

from collections.abc import Callable
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.records import Check, Verdict
from vdsm_pin.verification.robot_model import RobotModel

CHUNK: Final = 4096
"""Rows held in memory at a time."""


NAME: Final = "joint centres by Pinocchio against the closed form"
"""Name of the row."""

PLANNED: Final = "joint centres by Pinocchio against the planned ones"
"""Name of the row about the centres that the angles were solved from."""


def check_fk(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    deadline: Deadline = NO_LIMIT,
) -> Check:
    """Compare every joint centre of every row with the closed form.

    Args:
        robot: The arm in Pinocchio.
        problem: Names the arm of the closed form.
        trajectory: What is judged.
        deadline: When to give up.

    Returns:
        The largest distance between the two, in metres. They compute the same thing, so
        a difference refutes one of them and with it every other check. It is often 0 to
        the last bit, because both turn by yaw and pitch in the same order.

    Raises:
        OutOfTime: If the time is over.
    """
    arm = problem.manipulator

    def closed_form(rows: slice) -> FloatArray:
        values = trajectory.x0[rows], trajectory.alpha[rows], trajectory.theta[rows]
        return joint_centres(arm, *values)

    return _compared(NAME, robot, trajectory, closed_form, deadline)


def check_planned(
    robot: RobotModel,
    trajectory: Trajectory,
    centres: FloatArray,
    deadline: Deadline = NO_LIMIT,
) -> Check:
    """Compare every joint centre of every row with the one that was planned.

    Args:
        robot: The arm in Pinocchio.
        trajectory: The angles that were solved from the centres.
        centres: Joint centres of Step 6, shape (n_samples, N + 1, 3); [m].
        deadline: When to give up.

    Returns:
        The largest distance between the two, in metres.

    Raises:
        OutOfTime: If the time is over.
    """
    return _compared(PLANNED, robot, trajectory, lambda rows: centres[rows], deadline)


def _compared(
    name: str,
    robot: RobotModel,
    trajectory: Trajectory,
    expected: Callable[[slice], FloatArray],
    deadline: Deadline,
) -> Check:
    """Hold Pinocchio's joint centres against others, some rows at a time."""
    worst, row, joint = -np.inf, 0, 0
    for first in range(0, trajectory.n_samples, CHUNK):
        deadline.check()
        part = slice(first, first + CHUNK)
        joints = trajectory.x0[part], trajectory.alpha[part], trajectory.theta[part]
        found = robot.joint_centres(*joints)
        residual = np.linalg.norm(found - expected(part), axis=2)
        residual[np.isnan(residual)] = np.inf
        here, centre = np.unravel_index(int(np.argmax(residual)), residual.shape)
        if residual[here, centre] > worst:
            worst = float(residual[here, centre])
            row, joint = first + int(here), int(centre)
    passed = worst <= TOLERANCES.joint_centre
    return Check(
        name=name,
        verdict=Verdict.CERTIFIED if passed else Verdict.REFUTED,
        count=trajectory.n_samples * (trajectory.n_links + 1),
        worst=worst,
        limit=TOLERANCES.joint_centre,
        unit="m",
        where=f"joint centre O{joint + 1}",
        moment=row,
    )
