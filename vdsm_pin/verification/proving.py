"""A clearance proof of a problem and a trajectory, ready to work."""

import numpy as np

from vdsm_pin.error_boxes import ErrorBox
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.packed_tree import straight_motion
from vdsm_pin.proof.proving import Proving, new_proving
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.task import make_task

BUDGET = Budget()


def prove_problem(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    pieces: PackedPieces | None = None,
    budget: Budget = BUDGET,
) -> Proving:
    """Everything ready, nothing judged.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        errors: The proof covers every motion within it.
        pieces: `pack_scene(problem)`, where it is known already.
        budget: Sizes and when to stop.
    """
    reach = float(np.abs(trajectory.x0).max())
    task = make_task(problem, errors, pieces, budget, reach)
    n_obstacles = len(problem.scene.obstacles)
    columns = problem.manipulator.n_links + n_obstacles
    motion = straight_motion(trajectory.joints)
    return new_proving(task, motion, columns, n_obstacles, budget)
