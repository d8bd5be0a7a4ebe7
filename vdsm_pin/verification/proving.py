"""A clearance proof of a problem and a trajectory, ready to work."""

from dataclasses import dataclass

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import Proof, summed
from vdsm_pin.proof.proving import Proving
from vdsm_pin.proof.question import Question
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.moving import Knots, whole_path
from vdsm_pin.verification.task import arm_assembly

BUDGET = Budget()


@dataclass(frozen=True)
class ProblemProof:
    """A proof at work, and where its intervals lie in the trajectory.

    Args:
        asked: What is held apart.
        question: The same under errors.
        path: The motion of all that moves.
        knots: Where its intervals lie in the trajectory.
        proving: Numbers the intervals of the path.
    """

    asked: Assembly
    question: Question
    path: Path
    knots: Knots
    proving: Proving

    def rows(self, moments: FloatArray) -> FloatArray:
        """Rows of all columns at moments in waypoints, (m,) to (m, n_columns)."""
        return self.path.at_moments(self.knots.inner(moments))

    def told(self, *, in_time: bool = True) -> Proof:
        """What was proved so far, in intervals of the path."""
        asked = self.question.plan, self.question.n_pairs
        return summed(self.proving.results, *asked, in_time)


def prove_problem(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    budget: Budget = BUDGET,
) -> ProblemProof:
    """A proof that is ready to run; nothing is judged yet.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        errors: The proof covers every motion within this box.
        budget: Sizes and when to stop.
    """
    path, knots = whole_path(problem, trajectory)
    asked = arm_assembly(problem)
    question = asked.question.under(asked.box(errors))
    return ProblemProof(asked, question, path, knots, question.about(path, budget))
