"""Forward kinematics by two roads: Pinocchio on the URDF against the closed form."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.pinocchio_arm import PinocchioArm
from vdsm_pin.verification.records import Check, CheckKind, Verdict

CHUNK: Final = 4096
"""Rows held in memory at a time."""


NAME: Final = "joint centres by Pinocchio against the closed form"
"""Name of the row."""


def check_fk(
    model: PinocchioArm,
    problem: PlanningProblem,
    trajectory: Trajectory,
    centres: FloatArray | None = None,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Check, ...]:
    """Compare every joint centre of every row with the closed form and the plan.

    Args:
        model: The arm in Pinocchio.
        problem: Names the arm of the closed form.
        trajectory: What is judged.
        centres: Joint centres of Step 6 that the angles were solved from, shape
            (n_samples, N + 1, 3); None where they are not known; [m].
        deadline: When to give up.

    Returns:
        The largest distances from Pinocchio's, in metres. The closed form computes the
        same thing, so a difference refutes one of them and with it every other check.
        It is often 0 to the last bit, because both turn by yaw and pitch in the same
        order.

    Raises:
        OutOfTime: If the time is over.
    """
    planned = [] if centres is None else [_Worst(CheckKind.PLANNED.value)]
    found = [_Worst(NAME), *planned]
    for first in range(0, trajectory.n_samples, CHUNK):
        deadline.check()
        part = slice(first, first + CHUNK)
        joints = trajectory.x0[part], trajectory.alpha[part], trajectory.theta[part]
        theirs, ours = (
            model.joint_centres(*joints),
            [joint_centres(problem.manipulator, *joints)],
        )
        ours += [] if centres is None else [centres[part]]
        for one, expected in zip(found, ours, strict=True):
            one.see(first, np.linalg.norm(theirs - expected, axis=2))
    return tuple(one.check() for one in found)


@dataclass
class _Worst:
    """The joint centre that is farthest off so far.

    Args:
        name: Of the row.
        off: How far; [m].
        row: Where, from 0.
        joint: Which, from 0.
        count: How many were compared.
    """

    name: str
    off: float = -np.inf
    row: int = 0
    joint: int = 0
    count: int = 0

    def see(self, first: int, residual: FloatArray) -> None:
        """Compare more rows, from `first` on, shape (n, N + 1); [m]."""
        residual[np.isnan(residual)] = np.inf
        row, joint = np.unravel_index(int(np.argmax(residual)), residual.shape)
        self.count += residual.size
        if residual[row, joint] > self.off:
            self.off = float(residual[row, joint])
            self.row, self.joint = first + int(row), int(joint)

    def check(self) -> Check:
        """The row of evidence."""
        passed = self.off <= TOLERANCES.joint_centre
        return Check(
            name=self.name,
            verdict=Verdict.CERTIFIED if passed else Verdict.REFUTED,
            count=self.count,
            worst=self.off,
            limit=TOLERANCES.joint_centre,
            unit="m",
            where=f"joint centre O{self.joint + 1}",
            moment=self.row,
        )
