"""A clearance proof of a problem and a trajectory, ready to work."""

from dataclasses import dataclass

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.proving import Proving, new_proving
from vdsm_pin.verification.moving import Knots, whole_path
from vdsm_pin.verification.task import make_task

BUDGET = Budget()


@dataclass(frozen=True)
class ProblemProof:
    """A proof at work, and where its intervals lie in the trajectory.

    Args:
        proving: Numbers the intervals of the joint path.
        knots: Those of the trajectory.
    """

    proving: Proving
    knots: Knots

    @property
    def best(self) -> FloatArray:
        """Least bounds of each pair, told in intervals of the trajectory."""
        return self.knots.in_rows(self.proving.results.best)


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
    task = make_task(problem, errors, budget, path.reach)
    n_obstacles = len(problem.scene.obstacles)
    columns = problem.manipulator.n_links + n_obstacles
    proving = new_proving(task, path.packed(), columns, n_obstacles, budget)
    return ProblemProof(proving, knots)
