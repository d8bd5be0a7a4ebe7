"""A proof at work: what is asked, its working space, where it writes.

`Proving.prove` is the one way to a proof, whoever asks.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.proof.blocks import judge, run_sweep
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.far_pairs import BroadPhase, new_broad_phase
from vdsm_pin.proof.layouts import AT_LOWER, AT_UPPER, BEST, TALLY, TIME
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.parts import PartPlan
from vdsm_pin.proof.proofs import Proof, summed
from vdsm_pin.proof.results import Candidates, Dense, Results
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.sweep import Sweep
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.workspace import Workspace, new_workspace

SIDES: Final = 2
"""Sides of a profile: lower and upper bounds."""


def new_results(
    n_pairs: int, columns: int, n_intervals: int, budget: Budget
) -> Results:
    """Where a sweep writes, with nothing found yet and no dense rows.

    Args:
        n_pairs: Number of pairs.
        columns: Of its profile.
        n_intervals: Of the motion.
        budget: Sizes.
    """
    stride = max(1, -(-n_intervals * columns * SIDES // budget.profile))
    n_bins = -(-n_intervals // stride)
    best = np.full((n_pairs, BEST), np.inf)
    best[:, [AT_LOWER, AT_UPPER, TIME]] = 0.0
    return Results(
        best=best,
        counts=np.zeros((n_pairs, 3), np.int64),
        profile=np.full((SIDES, columns, n_bins), np.inf),
        stride=stride,
        limit=np.full(2, np.inf),
        candidates=room_for(min(budget.candidates, n_pairs * n_intervals)),
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
    """One question and motion, and the working space of their proof.

    What was proved so far stays: planes that served are tried first when stretches or
    other errors are asked next.
    """

    plan: PartPlan
    task: Task
    motion: Motion
    work: Workspace
    results: Results
    broad: BroadPhase
    budget: Budget

    @property
    def n_intervals(self) -> int:
        """Intervals of the motion; one row counts as an interval without motion."""
        return max(1, len(self.motion.knots) - 1)

    @property
    def n_pairs(self) -> int:
        """Number of pairs, each part of a body with several by itself."""
        return len(self.results.best)

    @property
    def share(self) -> float:
        """How much is judged, 0 to 1; may be asked while it is."""
        settled = self.broad.settled[self.broad.number >= 0].sum()
        judged = float(self.results.counts.sum() + settled)
        total = self.results.counts.shape[0] * self.n_intervals
        return judged / float(max(1, total))

    @property
    def sweeping(self) -> Sweep:
        """What compiled code judges intervals with."""
        return Sweep(self.task, self.motion, self.work, self.results, self.broad)

    def sweep(self, first: int, last: int) -> bool:
        """Judge some intervals; whether there was time for all."""
        return bool(run_sweep(self.sweeping, (first, last), False))

    def prove(self) -> Proof:
        """Bracket the clearance of every pair over the whole path.

        Returns:
            The proof, its least brackets refined unless the time ended before; what
            is not judged is undecided.
        """
        return self.found(bool(judge(self.sweeping, (0, self.n_intervals), True)))

    def judge(self, first: int, last: int) -> Proof:
        """The same of some intervals, no bracket narrowed."""
        return self.found(bool(judge(self.sweeping, (first, last), False)))

    def found(self, in_time: bool) -> Proof:
        """What was proved so far."""
        return summed(self.results, self.plan, in_time)

    def new_results(self) -> Results:
        """Where to write what is asked again."""
        columns = self.results.profile.shape[1]
        return new_results(self.n_pairs, columns, self.n_intervals, self.budget)

    def fresh(self, results: Results) -> "Proving":
        """The same question with nothing found yet; the planes are carried on."""
        broad = new_broad_phase(self.task, self.broad.number.shape[1])
        return replace(self, results=results, broad=broad)


def new_proving(
    plan: PartPlan, task: Task, motion: Motion, columns: int, budget: Budget
) -> Proving:
    """Everything ready, nothing judged.

    Args:
        plan: How the pairs are asked.
        task: What is asked.
        motion: The motion; one row counts as an interval without motion.
        columns: Columns of the profile.
        budget: Sizes.
    """
    pad, n_intervals = task.rules.pad, max(1, len(motion.knots) - 1)
    # What is packed for no motion yet would be proved without its rounding.
    padded = pad > 0.0 and bool((task.pairs.lost >= pad).all())
    assert padded, "the task is of no motion: see Question.about"
    return Proving(
        plan=plan,
        task=task,
        motion=motion,
        work=new_workspace(
            task,
            motion.knots.shape[1],
            budget.slices,
            min(BLOCK, n_intervals),
            budget.candidates,
        ),
        results=new_results(len(task.pairs.rough), columns, n_intervals, budget),
        broad=new_broad_phase(task, plan.n_obstacles),
        budget=budget,
    )
