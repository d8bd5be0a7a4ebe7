"""Clearance of a motion, proved over continuous time (docs/certificate.md).

The compiled sweep judges every pair over every interval; what may hold the least
clearance is subdivided further until its bracket is narrow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.proof.layouts import (
    AT_LOWER,
    AT_UPPER,
    HELD,
    KEY,
    LOW,
    OTHER,
    OWN,
    PAIR,
    SLICE,
    SLICES,
    TALLY,
    TIME,
    UP,
)
from vdsm_pin.proof.least_bracket import narrow
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.search import Witnesses
from vdsm_pin.proof.terms import (
    CERTIFIED,
    LINKS,
    OBSTACLES,
    REFUTED,
    UNDECIDED,
)
from vdsm_pin.proof.witnesses import place_best, place_points
from vdsm_pin.scene import Scene
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.proving import (
    BUDGET,
    CANDIDATES,
    Proving,
    dense_rows,
    new_proving,
    room_for,
)
from vdsm_pin.verification.records import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    ErrorBox,
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
    proving = new_proving(problem, trajectory, errors, pieces, deadline=deadline)
    results = proving.results
    proving.sweep(results, 0, proving.n_intervals)
    late = proving.deadline.passed
    _merge_far(proving)
    _own_up(proving)
    for group in (OBSTACLES, LINKS):
        _narrow(proving, group)
    sent = 0
    if sinks:
        sent = _send(problem, trajectory, errors, proving, sinks, reach)
    order = np.lexsort((results.best[:, TIME], results.best[:, AT_UPPER]))
    place_best(proving.task, proving.motion, proving.desk.ends, results.best, order)
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


def _own_up(proving: Proving) -> None:
    """Call undecided what the time did not allow to judge."""
    results = proving.results
    left = proving.n_intervals - results.counts.sum(axis=1)
    if left.any():
        results.counts[:, UNDECIDED] += left
        results.best[left > 0, LOW] = -np.inf
        results.profile[0] = -np.inf


def _merge_far(proving: Proving) -> None:
    """Bring what culling settled to the results of the pairs."""
    far, task = proving.broad, proving.task
    body, obstacle = np.nonzero(far.number >= 0)
    pair, at = far.number[body, obstacle], (body, obstacle)
    best = proving.results.best
    proving.results.counts[pair, CERTIFIED] += far.settled[at]
    better = far.lower[at] < best[pair, LOW]
    best[pair[better], LOW] = far.lower[at][better]
    best[pair[better], AT_LOWER] = far.at_lower[at][better]
    found = np.flatnonzero(far.upper[at] < best[pair, UP])
    body, pair, rows = body[found], pair[found], far.at_upper[at][found]
    corner = task.bodies.corners[task.bodies.first[body]]
    place = _places(proving, rows, task.bodies.frame[body], corner)
    point = far.point.T[obstacle[found]]
    gap = np.linalg.norm(point - place, axis=1)
    best[pair, UP] = gap - task.bodies.radius[body] + task.rules.pad
    best[pair, AT_UPPER], best[pair, TIME] = rows, 0.0
    best[pair, OWN:OTHER], best[pair, OTHER:] = corner, point


def _places(
    proving: Proving, rows: IntArray, frames: IntArray, at: FloatArray
) -> FloatArray:
    """Points of frames, shape (n, 3), at rows, in the base frame, (n, 3); [m]."""
    task, motion = proving.task, proving.motion
    return place_points(task.tree, motion, rows, frames, np.ascontiguousarray(at))


def _narrow(proving: Proving, group: int) -> None:
    """Narrow the least bracket over the obstacles or over the links."""
    if proving.deadline.passed:
        return
    task, results = proving.task, proving.results
    mine = task.pairs.group == group
    held, n = results.candidates, results.tally[HELD]
    near = np.flatnonzero(mine[held.pair[:n]])
    near = near[held.lower[near] < results.limit[group] - task.rules.gap]
    if not near.size:
        return
    # The least first, since it lowers the limit most; then block by block.
    order = near[np.lexsort((held.pair[near], held.first[near]))]
    least = np.argmin(held.lower[order])
    order = np.concatenate([order[[least]], np.delete(order, least)])
    n_pairs = len(mine)
    found = Witnesses(
        upper=np.full(n_pairs, np.inf),
        interval=np.zeros(n_pairs, np.int64),
        time=np.zeros(n_pairs),
        points=np.zeros((n_pairs, 6)),
        instant=np.full(n_pairs, np.inf),
        limit=np.inf,
    )
    heap = np.zeros((CANDIDATES + BUDGET, SLICE))
    again = results._replace(counts=np.zeros_like(results.counts))
    count = narrow(task, proving.motion, proving.desk, again, order, heap, found)
    if proving.deadline.passed:
        return  # not all was looked at again: what was proved before holds
    proved = np.full(n_pairs, results.limit[group] - task.rules.gap)
    np.minimum.at(proved, heap[:count, PAIR].astype(np.int64), heap[:count, KEY])
    proved = np.minimum(proved, results.overflow[group])[mine]
    results.best[mine, LOW] = np.maximum(results.best[mine, LOW], proved)
    if group == OBSTACLES:
        # Every interval keeps what the narrowing proved of all of them.
        lower = results.profile[0]
        np.maximum(lower, proved.min(), out=lower)


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
        proving = new_proving(
            near_problem, trajectory, errors, deadline=proving.deadline
        )
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
        again.sweep(results, first, last)
        if again.deadline.passed:
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
