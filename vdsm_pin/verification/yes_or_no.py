"""Whether a clearance proof goes through, and nothing else."""

from typing import Final

import numpy as np

from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.blocks import run_sweep
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.packing import with_errors
from vdsm_pin.proof.workspace import forget
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.asked_motion import AskedMotion

BEYOND: Final = 4.0 * TOLERANCES.bracket_gap
"""Clearance asked for beyond the required one; [m].

The planes of the full proof are the best ones to within the width of a bracket, so that
it misses nothing that is held here by whichever plane.
"""


class YesOrNoProof:
    """Asks whether the proof goes through, for stretches of a motion and error boxes.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        deadline: When to give up.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        trajectory: Trajectory,
        deadline: Deadline = NO_LIMIT,
    ) -> None:
        # Nobody asks for a profile: all intervals share its one bin.
        budget = Budget(profile=1, until=deadline.end)
        self._motion = AskedMotion.of_arm(problem, trajectory, ErrorBox())
        self._proving = self._motion.proving(budget)
        self._first = self._motion.knots.first.tolist()
        self._deadline = deadline
        task = self._proving.task
        pairs = task.pairs._replace(required=task.pairs.required + BEYOND)
        self._task = task._replace(pairs=pairs)
        self.n_intervals = len(self._first) - 1

    def holds(self, errors: ErrorBox, first: int, last: int) -> bool:
        """Whether every interval from `first` to below `last` is proved.

        Stops at the first that is not.

        Raises:
            OutOfTime: If the time is over.
        """
        box = self._motion.under(errors).question.errors
        known, task = self._proving, with_errors(self._task, box)
        # Pairs that remember nothing: the answer depends on the question alone.
        forget(known.work.planes)
        # No least clearance is asked for: whatever is proved may be culled.
        known.results.limit[:] = -np.inf
        asked = known.sweeping._replace(task=task)
        proved = bool(run_sweep(asked, (self._first[first], self._first[last]), True))
        self._deadline.check()
        return proved


def is_certified(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    deadline: Deadline = NO_LIMIT,
) -> bool:
    """Whether the clearance proof goes through; stops at the first gap.

    Raises:
        OutOfTime: If the time is over.
    """
    proof = YesOrNoProof(problem, trajectory, deadline)
    return proof.holds(errors, 0, proof.n_intervals)
