"""Clearance of a motion, proved over continuous time (docs/certificate.md).

The compiled sweep judges every pair over every interval; what may hold the least
clearance is subdivided further until its bracket is narrow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.progress import step, watched
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import (
    AT_UPPER,
    LOW,
    OTHER,
    OWN,
    SLICES,
    TALLY,
    TIME,
    UP,
)
from vdsm_pin.proof.prover import RANK, verdicts_of
from vdsm_pin.proof.proving import dense_rows, room_for
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.terms import (
    ACROSS,
    WITHIN,
)
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.brackets import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    LeastClearances,
)
from vdsm_pin.verification.moving import Knots
from vdsm_pin.verification.proving import ProblemProof, prove_problem
from vdsm_pin.verification.records import Pair
from vdsm_pin.verification.task import all_pairs

CHUNK_VALUES: Final = 1_000_000
"""Most (interval, pair) values held at once for the sinks."""

CHUNK: Final = 4096
"""Most intervals between two chunks."""


@dataclass(frozen=True)
class ClearanceProof:
    """What the sweep proved.

    Args:
        pairs: Every pair.
        counts: Intervals certified, refuted and undecided, shape (n_pairs, 3); knots of
            what carries obstacles end intervals too.
        best: Least bounds of each pair, as `proof.layouts` lays them out,
            shape (n_pairs, BEST); [m].
        profile: Brackets along the motion.
        slices: Slices tried beyond one per interval and pair.
        n_intervals: Of the motion.
        late: Whether the time was over before all was judged.
        sent: Intervals whose brackets the sinks received: all, if there was time.
    """

    pairs: tuple[Pair, ...]
    counts: IntArray
    best: FloatArray
    profile: ClearanceProfile
    slices: int
    n_intervals: int
    late: bool
    sent: int

    @cached_property
    def least(self) -> LeastClearances:
        """The least bounds of every pair, with their witnesses."""
        best = self.best
        own, other = best[:, OWN:OTHER], best[:, OTHER : OTHER + 3]
        # In a pair of links the sweep moves the second one against the first.
        swapped = np.array([not pair.obstacle for pair in self.pairs], bool)[:, None]
        return LeastClearances(
            interval=frozen(best[:, AT_UPPER], np.int64),
            share=frozen(best[:, TIME]),
            lower=frozen(best[:, LOW]),
            upper=frozen(best[:, UP]),
            verdict=verdicts_of(self.counts),
            link_point=frozen(np.where(swapped, other, own)),
            other_point=frozen(np.where(swapped, own, other)),
        )


def _chunk(
    proof: ProblemProof, first: int, last: int, least: FloatArray, pairs: IntArray
) -> ClearanceChunk:
    """A chunk of the trajectory's intervals from `first` to below `last`."""
    proving, knots = proof.proving, proof.knots
    dense, count = proving.results.dense, int(knots.first[last] - knots.first[first])
    own, other = dense.own[:count], dense.other[:count]
    # In a pair of links the sweep moves the second one against the first.
    swapped = (proving.task.pairs.group == WITHIN)[None, :, None]
    chunk = ClearanceChunk(
        first_interval=first,
        # No interval is worse than what narrowing proved of all of them.
        lower=frozen(np.maximum(dense.lower[:count], least)),
        upper=frozen(dense.upper[:count]),
        share=frozen(dense.time[:count]),
        verdict=frozen(dense.verdict[:count], np.int64),
        link_point=frozen(np.where(swapped, other, own)),
        other_point=frozen(np.where(swapped, own, other)),
        pairs=pairs,
    )
    return chunk if knots.are_rows else _merged(chunk, knots, last)


def _merged(chunk: ClearanceChunk, knots: Knots, last: int) -> ClearanceChunk:
    """A chunk of intervals of the joint path as one of those of the trajectory."""
    starts = knots.first[chunk.first_interval : last]
    inner, begins = starts[0] + np.arange(len(chunk.lower)), starts - starts[0]
    least = np.minimum.reduceat(chunk.upper, begins)
    groups = np.repeat(np.arange(len(starts)), np.diff(np.append(begins, len(inner))))
    # The last of those that are least, of which there is one at least.
    numbers = np.arange(len(inner))[:, None]
    at = np.maximum.reduceat(np.where(chunk.upper == least[groups], numbers, 0), begins)
    columns = np.arange(at.shape[1])
    shares = [knots.share(inner[a], chunk.share[a, columns]) for a in at]
    worst = np.maximum.reduceat(RANK[chunk.verdict], begins)
    return replace(
        chunk,
        lower=frozen(np.minimum.reduceat(chunk.lower, begins)),
        upper=frozen(least),
        share=frozen(np.array(shares).reshape(at.shape)),
        verdict=frozen(RANK[worst], np.int64),
        link_point=frozen(chunk.link_point[at, columns]),
        other_point=frozen(chunk.other_point[at, columns]),
    )


def profile_of(
    profile: FloatArray, stride: int, knots: Knots, n_links: int
) -> ClearanceProfile:
    """Brackets along a motion, by intervals of its trajectory.

    Args:
        profile: By column in bins of intervals of the joint path, those of links first,
            shape (2, n_columns, n_bins); [m].
        stride: Intervals of a bin.
        knots: Of the trajectory.
        n_links: Columns of links.
    """
    first = np.arange(profile.shape[2]) * stride
    if not knots.are_rows:
        first, begins = np.unique(knots.interval(first), return_index=True)
        profile = np.minimum.reduceat(profile, begins, axis=2)
    profile.setflags(write=False)
    return ClearanceProfile(
        link_lower=profile[0, :n_links].T,
        link_upper=profile[1, :n_links].T,
        obstacle_lower=profile[0, n_links:].T,
        obstacle_upper=profile[1, n_links:].T,
        first_interval=frozen(first, np.int64),
    )


def prove_clearance(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    sinks: Sequence[ClearanceSink] = (),
    deadline: Deadline = NO_LIMIT,
    reach: float = math.inf,
) -> ClearanceProof:
    """Bracket the clearance of every pair over every interval.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        errors: The proof covers every motion within this box.
        sinks: Receive the brackets in chunks, in order, once all is proved.
        deadline: What is not judged by then is undecided.
        reach: Obstacles that no link is proved nearer to than this, at any time, are
            left out of what the sinks receive; [m].

    Returns:
        The proof, its least brackets narrowed unless the time ended before.
    """
    budget = Budget(until=deadline.end)
    proof = prove_problem(problem, trajectory, errors, budget)
    step("proving the clearance of %d pairs", len(proof.best))
    with watched(lambda: proof.proving.share):
        late = not proof.proving.run()
    results, sent = proof.proving.results, 0
    n_links = problem.manipulator.n_links
    if sinks:
        sent = _send(problem, trajectory, errors, proof, sinks, reach)
    return ClearanceProof(
        pairs=all_pairs(problem),
        counts=frozen(results.counts, np.int64),
        best=frozen(proof.best),
        profile=profile_of(results.profile, results.stride, proof.knots, n_links),
        slices=int(results.tally[SLICES]),
        n_intervals=len(proof.knots.first) - 1,
        late=late,
        sent=sent,
    )


def _send(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    proof: ProblemProof,
    sinks: Sequence[ClearanceSink],
    reach: float,
) -> int:
    """Sweep the near obstacles once more, closely and for the sinks.

    Returns:
        Number of intervals sent.
    """
    proving = proof.proving
    known, obstacles = proving.results, problem.scene.obstacles
    outer, obstacle = proving.task.pairs.group == ACROSS, proving.task.pairs.obstacle
    # numpy.unique imports numpy.ma, for which every process would wait.
    near = np.flatnonzero(np.bincount(obstacle[outer & (known.best[:, LOW] <= reach)]))
    pairs = frozen(np.flatnonzero(~outer | np.isin(obstacle, near)), np.int64)
    if near.size < len(obstacles):
        near_problem = problem.among(np.isin(np.arange(len(obstacles)), near))
        budget = proving.budget
        proof = prove_problem(near_problem, trajectory, errors, budget)
        proving = proof.proving
    length = CHUNK_VALUES // max(1, pairs.size) // BLOCK * BLOCK
    length = min(CHUNK, proving.n_intervals, max(BLOCK, length))
    steps = _steps(proof.knots.first, length)
    length = max(int(np.diff(proof.knots.first[steps]).max()), 1)
    results = proving.results._replace(
        best=known.best[pairs],
        counts=np.zeros((pairs.size, 3), np.int64),
        profile=np.full_like(proving.results.profile, np.inf),
        limit=known.limit,
        candidates=room_for(0),
        tally=np.zeros(TALLY, np.int64),
        dense=dense_rows(length, pairs.size),
    )
    again = replace(proof, proving=replace(proving, results=results))
    step("clearances of every interval")
    with watched(lambda: again.proving.share):
        for begin, end in pairwise(steps):
            first, last = (int(proof.knots.first[k]) for k in (begin, end))
            if not again.proving.sweep(first, last):
                return begin
            chunk = _chunk(again, begin, end, known.best[pairs, LOW], pairs)
            for sink in sinks:
                sink(chunk)
    return steps[-1]


def _steps(first: IntArray, length: int) -> list[int]:
    """Numbers of intervals of a trajectory between which chunks end.

    Args:
        first: As `Knots` has it.
        length: Most intervals of the joint path in a chunk, unless one interval of the
            trajectory alone has more.
    """
    steps, last = [0], len(first) - 1
    while steps[-1] < last:
        reach = int(np.searchsorted(first, first[steps[-1]] + length, side="right"))
        steps.append(min(last, max(reach - 1, steps[-1] + 1)))
    return steps
