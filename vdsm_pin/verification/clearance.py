"""Clearance of a motion, proved over continuous time (docs/certificate.md).

The compiled sweep judges every pair over every interval; what may hold the least
clearance is subdivided further until its bracket is narrow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.error_boxes import ErrorBox
from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.problem import PlanningProblem
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
from vdsm_pin.proof.proving import Proving, dense_rows, room_for
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.terms import (
    CERTIFIED,
    LINKS,
    OBSTACLES,
    REFUTED,
    UNDECIDED,
)
from vdsm_pin.scene import Scene
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.proving import prove_problem
from vdsm_pin.verification.records import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    LeastClearances,
    Pair,
)
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
        counts: Intervals certified, refuted and undecided, shape (n_pairs, 3).
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


def _chunk(
    proving: Proving, first: int, count: int, least: FloatArray, pairs: IntArray
) -> ClearanceChunk:
    dense = proving.results.dense
    own, other = dense.own[:count], dense.other[:count]
    # In a pair of links the sweep moves the second one against the first.
    swapped = (proving.task.pairs.group == LINKS)[None, :, None]
    return ClearanceChunk(
        first_interval=first,
        # No interval is worse than what narrowing proved of all of them.
        lower=frozen(np.maximum(dense.lower[:count], least)),
        upper=frozen(dense.upper[:count]),
        time=frozen(dense.time[:count]),
        verdict=frozen(dense.verdict[:count], np.int64),
        link_point=frozen(np.where(swapped, other, own)),
        other_point=frozen(np.where(swapped, own, other)),
        pairs=pairs,
    )


def _profile(problem: PlanningProblem, results: Results) -> ClearanceProfile:
    n_links, profile = problem.manipulator.n_links, results.profile
    profile.setflags(write=False)
    first = np.arange(profile.shape[2]) * results.stride
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
    pieces: PackedPieces | None = None,
    deadline: Deadline = NO_LIMIT,
    reach: float = math.inf,
) -> ClearanceProof:
    """Bracket the clearance of every pair over every interval.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        errors: The proof covers every motion within it.
        sinks: Receive the brackets in chunks, in order, once all is proved.
        pieces: `pack_scene(problem)`, where it is known already.
        deadline: What is not judged by then is undecided.
        reach: Obstacles that no link is proved nearer to than this, at any time, are
            left out of what the sinks receive; [m].

    Returns:
        The proof, its least brackets narrowed unless the time ended before.
    """
    budget = Budget(until=deadline.end)
    proving = prove_problem(problem, trajectory, errors, pieces, budget)
    late, results, sent = not proving.run(), proving.results, 0
    if sinks:
        sent = _send(problem, trajectory, errors, proving, sinks, reach)
    return ClearanceProof(
        pairs=all_pairs(problem),
        counts=frozen(results.counts, np.int64),
        best=frozen(results.best),
        profile=_profile(problem, results),
        slices=int(results.tally[SLICES]),
        n_intervals=proving.n_intervals,
        late=late,
        sent=sent,
    )


def _send(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    proving: Proving,
    sinks: Sequence[ClearanceSink],
    reach: float,
) -> int:
    """Sweep the near obstacles once more, closely and for the sinks.

    Returns:
        Number of intervals sent.
    """
    known, obstacles = proving.results, problem.scene.obstacles
    outer, obstacle = proving.task.pairs.group == OBSTACLES, proving.task.pairs.obstacle
    # numpy.unique imports numpy.ma, for which every process would wait.
    near = np.flatnonzero(np.bincount(obstacle[outer & (known.best[:, LOW] <= reach)]))
    pairs = frozen(np.flatnonzero(~outer | np.isin(obstacle, near)), np.int64)
    if near.size < len(obstacles):
        scene = Scene(tuple(obstacles[k] for k in near))
        near_problem = replace(problem, scene=scene)
        budget = proving.budget
        proving = prove_problem(near_problem, trajectory, errors, budget=budget)
    length = CHUNK_VALUES // max(1, pairs.size) // BLOCK * BLOCK
    length = min(CHUNK, proving.n_intervals, max(BLOCK, length))
    results = proving.results._replace(
        best=known.best[pairs],
        counts=np.zeros((pairs.size, 3), np.int64),
        profile=np.full_like(proving.results.profile, np.inf),
        limit=known.limit,
        candidates=room_for(0),
        tally=np.zeros(TALLY, np.int64),
        dense=dense_rows(length, pairs.size),
    )
    again = replace(proving, results=results)
    for first in range(0, proving.n_intervals, length):
        last = min(first + length, proving.n_intervals)
        if not again.sweep(first, last):
            return first
        chunk = _chunk(again, first, last - first, known.best[pairs, LOW], pairs)
        for sink in sinks:
            sink(chunk)
    return proving.n_intervals


def least_clearances(proof: ClearanceProof) -> LeastClearances:
    """The least bounds of every pair, with their witnesses."""
    best, counts = proof.best, proof.counts
    verdict = np.where(counts[:, UNDECIDED] > 0, UNDECIDED, CERTIFIED)
    verdict[counts[:, REFUTED] > 0] = REFUTED
    own, other = best[:, OWN:OTHER], best[:, OTHER : OTHER + 3]
    # In a pair of links the sweep moves the second one against the first.
    swapped = np.array([not pair.obstacle for pair in proof.pairs], bool)[:, None]
    return LeastClearances(
        interval=frozen(best[:, AT_UPPER], np.int64),
        time=frozen(best[:, TIME]),
        lower=frozen(best[:, LOW]),
        upper=frozen(best[:, UP]),
        verdict=frozen(verdict, np.int64),
        link_point=frozen(np.where(swapped, other, own)),
        other_point=frozen(np.where(swapped, own, other)),
    )
