"""The joint error that a motion's clearance survives, as far as meshes allow it."""

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import with_hulls
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import LOW
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.clearance import ClearanceProof
from vdsm_pin.verification.robust import largest_joint_error, refuted_joint_error
from vdsm_pin.verification.task import ArmPairs


class Survival:
    """The joint error that the clearance survives, from both sides."""

    def __init__(
        self,
        problem: PlanningProblem,
        trajectory: Trajectory,
        errors: ErrorBox,
        proof: ClearanceProof,
        deadline: Deadline,
        hulls: Collection[str],
    ) -> None:
        self._asked, self._deadline = (problem, trajectory, errors), deadline
        # Nothing is refuted by a hull, and nothing survives that may enter it.
        hulled = problem  # with what it keeps packed
        if hulls:
            hulled = replace(problem, scene=with_hulls(problem.scene, hulls))
        self._with_hulls = hulled, trajectory, errors
        number = ArmPairs(problem).number
        lower = np.append(proof.best[:, LOW], np.inf)  # -1 is no pair
        self._least = lower[number].min(axis=0)
        near = np.array([name in hulls for name in problem.scene.names], np.bool_)
        self._least[near] = -math.inf

    def largest(self) -> float:
        """The largest that is proved; [rad]."""
        return largest_joint_error(*self._with_hulls, self._deadline, self._least)

    def refuted(self, largest: float) -> float:
        """One that is lost, the smallest found; [rad]."""
        known = self._deadline, self._least
        return refuted_joint_error(*self._asked, largest, *known)
