"""A clearance proof at work: its task, its working space, where it writes."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.proof.blocks import sweep
from vdsm_pin.proof.broad_phase import BroadPhase, new_broad_phase
from vdsm_pin.proof.layouts import AT_LOWER, AT_UPPER, BEST, TALLY, TIME
from vdsm_pin.proof.packed_tree import Motion, straight_motion
from vdsm_pin.proof.results import Candidates, Dense, Results
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.workspace import Workspace, new_workspace
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.records import ErrorBox
from vdsm_pin.verification.task import make_task

BUDGET: Final = 20_000
"""Most slices of one interval and pair."""

CANDIDATES: Final = 65_536
"""Most blocks, and then intervals, kept for narrowing the least bracket."""

PROFILE_VALUES: Final = 4_000_000
"""Most values of a profile; beyond it intervals share a bin."""


def new_results(
    n_pairs: int, columns: int, n_intervals: int, values: int = PROFILE_VALUES
) -> Results:
    """Where a sweep writes, with nothing found yet and no dense rows.

    Args:
        n_pairs: Number of pairs.
        columns: Links and obstacles.
        n_intervals: Of the motion.
        values: Most values of its profile.
    """
    stride = -(-n_intervals * columns * 2 // values)
    n_bins = -(-n_intervals // stride)
    best = np.full((n_pairs, BEST), np.inf)
    best[:, [AT_LOWER, AT_UPPER, TIME]] = 0.0
    return Results(
        best=best,
        counts=np.zeros((n_pairs, 3), np.int64),
        profile=np.full((2, columns, n_bins), np.inf),
        stride=stride,
        limit=np.full(2, np.inf),
        candidates=room_for(CANDIDATES),
        overflow=np.full(2, np.inf),
        tally=np.zeros(TALLY, np.int64),
        dense=dense_rows(0, n_pairs),
    )


def room_for(size: int) -> Candidates:
    """Room for so many candidates."""
    numbers = (np.zeros(size, np.int64) for _ in range(3))
    return Candidates(np.zeros(size), *numbers)


def dense_rows(size: int, n_pairs: int) -> Dense:
    """Room for the brackets of so many intervals."""
    shape = (size, n_pairs)
    return Dense(
        lower=np.zeros(shape),
        upper=np.zeros(shape),
        time=np.zeros(shape),
        verdict=np.zeros(shape, np.int64),
        own=np.zeros((*shape, 3)),
        other=np.zeros((*shape, 3)),
    )


@dataclass(frozen=True)
class Proving:
    """One problem and motion, and the working space of their proof."""

    task: Task
    motion: Motion
    desk: Workspace
    results: Results
    broad: BroadPhase
    n_intervals: int
    deadline: Deadline

    def sweep(self, results: Results, first: int, last: int) -> None:
        """Judge some intervals, all of them unless the time is over."""
        sweep(
            self.task,
            self.motion,
            self.desk,
            results,
            self.broad,
            (first, last),
            False,
        )


def new_proving(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    pieces: PackedPieces | None = None,
    values: int = PROFILE_VALUES,
    budget: int = BUDGET,
    deadline: Deadline = NO_LIMIT,
) -> Proving:
    """Everything ready, nothing judged.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        errors: The proof covers every motion within it.
        pieces: `pack_scene(problem)`, where it is known already.
        values: Most values of the profile.
        budget: Most slices of one interval and pair.
        deadline: When to stop; who sweeps asks it afterwards.
    """
    reach = float(np.abs(trajectory.x0).max())
    task = make_task(problem, errors, pieces, deadline, reach)
    n_pairs, n_links = task.pairs.body.size, problem.manipulator.n_links
    n_intervals = max(1, trajectory.n_samples - 1)
    n_obstacles, motion = (
        len(problem.scene.obstacles),
        straight_motion(trajectory.joints),
    )
    return Proving(
        task=task,
        motion=motion,
        desk=new_workspace(task, motion.knots.shape[1], budget),
        results=new_results(n_pairs, n_links + n_obstacles, n_intervals, values),
        broad=new_broad_phase(task, n_obstacles),
        n_intervals=n_intervals,
        deadline=deadline,
    )
