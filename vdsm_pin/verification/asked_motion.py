"""A motion and what is asked of it: pairs held apart along its path, under errors."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proving import Proving
from vdsm_pin.proof.question import Question
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.moving import Knots, in_short_parts, joined_path
from vdsm_pin.verification.task import arm_assembly

BUDGET = Budget()


@dataclass(frozen=True, eq=False)
class AskedMotion:
    """A motion of an arm or a robot and all that moves beside it.

    Args:
        asked: What is held apart.
        path: How all columns of its tree move.
        knots: Where the intervals of the path lie in those of the trajectory.
        errors: What is proved holds for every motion within this box.
    """

    asked: Assembly
    path: Path
    knots: Knots
    errors: ErrorBox

    @classmethod
    def of_arm(
        cls, problem: PlanningProblem, trajectory: Trajectory, errors: ErrorBox
    ) -> "AskedMotion":
        """A snake arm's; one row counts as an interval without motion.

        Raises:
            InvalidInput: If obstacles move and the trajectory has no times.
        """
        whole = joined_path(trajectory.path, problem.scene)
        return cls(arm_assembly(problem), *whole, errors)

    @classmethod
    def of_robot(cls, asked: Assembly, path: Path, errors: ErrorBox) -> "AskedMotion":
        """Any other robot's, its long intervals cut.

        Raises:
            InvalidInput: If obstacles move and the path has no times.
        """
        whole = in_short_parts(*joined_path(path, asked.scene))
        return cls(asked, *whole, errors)

    @cached_property
    def question(self) -> Question:
        """All pairs under the errors, packed for any motion."""
        return self.asked.question.under(self.asked.box(self.errors))

    @property
    def n_trajectory_intervals(self) -> int:
        """Intervals of the trajectory."""
        return len(self.knots.first) - 1

    @property
    def span_on_path(self) -> FloatArray:
        """From when to when it goes, in knots of the path."""
        return np.array([0.0, self.path.n_intervals])

    def under(self, errors: ErrorBox) -> "AskedMotion":
        """The same motion under other errors."""
        return replace(self, errors=errors)

    @property
    def in_itself(self) -> "AskedMotion":
        """The same, its moments in knots of the path."""
        return replace(self, knots=Knots.of(self.path, None))

    def among(self, pairs: IntArray) -> "AskedMotion":
        """The same motion with some of its pairs, whose numbers have shape (m,)."""
        return replace(self, asked=self.asked.among(pairs))

    def rows(self, moments: FloatArray) -> FloatArray:
        """Rows of all columns at moments in waypoints, (m,) to (m, n_columns)."""
        return self.path.at_moments(self.knots.inner(moments))

    def proving(self, budget: Budget = BUDGET) -> Proving:
        """A proof that is ready to run; nothing is judged yet."""
        return self.question.about(self.path, budget)
