"""Clearance of a motion, proved over continuous time (docs/certificate.md).

The compiled sweep judges every pair over every interval; what may hold the least
clearance is subdivided further until its bracket is narrow.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.kinematics import joint_centres
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.link_clearance import arithmetic_pad
from vdsm_pin.verification.proof.blocks import Desk, forget, new_desk, sweep
from vdsm_pin.verification.proof.culling import Culling, new_culling
from vdsm_pin.verification.proof.heaps import KEY, PAIR, SLICE
from vdsm_pin.verification.proof.narrowing import narrow
from vdsm_pin.verification.proof.results import (
    AT_LOWER,
    AT_UPPER,
    BEST,
    HELD,
    LOW,
    OTHER,
    SLICES,
    TALLY,
    TIME,
    UP,
    Candidates,
    Dense,
    Results,
)
from vdsm_pin.verification.proof.rows import BLOCK
from vdsm_pin.verification.proof.search import Witnesses
from vdsm_pin.verification.proof.terms import (
    BASE,
    LINKS,
    OBSTACLES,
    Motion,
    Pairs,
    Rules,
    Task,
)
from vdsm_pin.verification.proof.witnesses import place_best
from vdsm_pin.verification.records import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    ErrorBox,
    Pair,
)

BUDGET: Final = 20_000
"""Most slices of one interval and pair."""

CANDIDATES: Final = 65_536
"""Most blocks, and then intervals, kept for narrowing the least bracket."""

SLACK: Final = 0.02
"""How wide a bracket may be, as a part of the clearance."""

CHUNK_VALUES: Final = 1_000_000
"""Most (interval, pair) values held at once for the sinks."""

CHUNK: Final = 4096
"""Most intervals between two chunks."""

PROFILE_VALUES: Final = 4_000_000
"""Most values of a profile; beyond it intervals share a bin."""


def all_pairs(problem: PlanningProblem) -> tuple[Pair, ...]:
    """Every pair that is judged, in the order of the certificate."""
    links = range(1, problem.manipulator.n_links + 1)
    names = problem.scene.names
    pairs = [Pair(link, obstacle=name) for name in names for link in links]
    pairs += [Pair(i, other_link=k) for i in links for k in links if k >= i + 2]
    return tuple(pairs)


def _packed_pairs(problem: PlanningProblem) -> Pairs:
    """The same for the kernels: the axis of link i is obstacle n_obstacles + i."""
    n_links, n_obstacles = problem.manipulator.n_links, len(problem.scene.obstacles)
    first, second = np.triu_indices(n_links, k=2)
    n_outer = n_links * n_obstacles
    return Pairs(
        link=np.concatenate([np.tile(np.arange(n_links), n_obstacles), second]),
        obstacle=np.concatenate(
            [np.repeat(np.arange(n_obstacles), n_links), n_obstacles + first]
        ),
        frame=np.concatenate([np.full(n_outer, BASE), first]),
        required=np.concatenate(
            [
                np.full(n_outer, problem.required_clearance),
                np.full(len(first), problem.required_self_clearance),
            ]
        ),
    )


def pack_scene(problem: PlanningProblem) -> PackedPieces:
    """The obstacles, then the axes of the links along x, grown by their radius."""
    arm = problem.manipulator
    axes = [
        Hull(np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]), arm.link_radius)
        for length in arm.link_lengths
    ]
    groups = [obstacle.pieces for obstacle in problem.scene.obstacles]
    return pack_pieces([*groups, *([axis] for axis in axes)])


def make_task(
    problem: PlanningProblem, errors: ErrorBox, pieces: PackedPieces | None = None
) -> Task:
    """What the kernels need to know of a problem."""
    arm, packed = problem.manipulator, pieces or pack_scene(problem)
    rules = Rules(
        lengths=np.array(arm.link_lengths),
        radius=float(arm.link_radius),
        joint_error=float(errors.joint),
        base_error=float(errors.base),
        obstacle_error=float(errors.obstacle),
        pad=arithmetic_pad(problem, packed),
        goal=TOLERANCES.bracket_gap,
        gap=TOLERANCES.least_bracket,
        slack=SLACK,
    )
    return Task(packed, _packed_pairs(problem), rules)


@dataclass(frozen=True)
class ClearanceProof:
    """What the sweep proved.

    Args:
        pairs: Every pair.
        counts: Intervals by verdict, shape (n_pairs, 3).
        best: Least bounds of each pair, in the layout of `results`, (n_pairs, BEST).
        profile: Brackets along the motion.
        slices: Slices tried beyond one per interval and pair.
    """

    pairs: tuple[Pair, ...]
    counts: IntArray
    best: FloatArray
    profile: ClearanceProfile
    slices: int


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
        candidates=_room(CANDIDATES),
        overflow=np.full(2, np.inf),
        tally=np.zeros(TALLY, np.int64),
        dense=_dense_rows(0, n_pairs),
    )


def _room(size: int) -> Candidates:
    numbers = (np.zeros(size, np.int64) for _ in range(3))
    return Candidates(np.zeros(size), *numbers)


def _dense_rows(size: int, n_pairs: int) -> Dense:
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
class _Proving:
    """One problem and motion, and the working space of their proof."""

    task: Task
    motion: Motion
    desk: Desk
    results: Results
    culling: Culling
    n_intervals: int

    def sweep(self, results: Results, first: int, last: int) -> None:
        """Judge some intervals."""
        sweep(
            self.task,
            self.motion,
            self.desk,
            results,
            self.culling,
            first,
            last,
            False,
        )


def _chunk(proving: _Proving, dense: Dense, first: int, count: int) -> ClearanceChunk:
    own, other = dense.own[:count], dense.other[:count]
    # In a pair of links the sweep moves the second one against the first.
    swapped = (proving.task.pairs.frame != BASE)[None, :, None]
    return ClearanceChunk(
        first_interval=first,
        # No interval is worse than what narrowing proved of all of them.
        lower=frozen(np.maximum(dense.lower[:count], proving.results.best[:, LOW])),
        upper=frozen(dense.upper[:count]),
        time=frozen(dense.time[:count]),
        verdict=frozen(dense.verdict[:count], np.int64),
        link_point=frozen(np.where(swapped, other, own)),
        other_point=frozen(np.where(swapped, own, other)),
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


def _proving(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    pieces: PackedPieces | None = None,
    values: int = PROFILE_VALUES,
) -> _Proving:
    task = make_task(problem, errors, pieces)
    n_pairs, n_links = task.pairs.link.size, problem.manipulator.n_links
    n_intervals = max(1, trajectory.n_samples - 1)
    n_obstacles = len(problem.scene.obstacles)
    return _Proving(
        task=task,
        motion=Motion(trajectory.x0, trajectory.alpha, trajectory.theta),
        desk=new_desk(n_links, n_pairs, BUDGET),
        results=new_results(n_pairs, n_links + n_obstacles, n_intervals, values),
        culling=new_culling(task.pieces, n_links, n_obstacles, n_pairs),
        n_intervals=n_intervals,
    )


def prove_clearance(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    sinks: Sequence[ClearanceSink] = (),
    pieces: PackedPieces | None = None,
) -> ClearanceProof:
    """Bracket the clearance of every pair over every interval.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        errors: The proof covers every motion within it.
        sinks: Receive the brackets in chunks, in order, once all is proved.
        pieces: `pack_scene(problem)`, where it is known already.

    Returns:
        The proof, its least brackets narrowed.
    """
    proving = _proving(problem, trajectory, errors, pieces)
    results = proving.results
    proving.sweep(results, 0, proving.n_intervals)
    _merge_far(problem, trajectory, proving)
    for group in (OBSTACLES, LINKS):
        _narrow(proving, group)
    if sinks:
        _send(proving, sinks)
    order = np.lexsort((results.best[:, TIME], results.best[:, AT_UPPER]))
    place_best(proving.task, proving.motion, proving.desk.ends, results.best, order)
    return ClearanceProof(
        pairs=all_pairs(problem),
        counts=frozen(results.counts, np.int64),
        best=frozen(results.best),
        profile=_profile(problem, results),
        slices=int(results.tally[SLICES]),
    )


def _merge_far(
    problem: PlanningProblem, trajectory: Trajectory, proving: _Proving
) -> None:
    """Bring what culling settled to the results of the pairs."""
    far, best, arm = proving.culling, proving.results.best, problem.manipulator
    size = far.settled.size
    proving.results.counts[:size, 0] += far.settled.T.ravel()
    mine, lower, upper = best[:size], far.lower.T.ravel(), far.upper.T.ravel()
    better = lower < mine[:, LOW]
    mine[better, LOW] = lower[better]
    mine[better, AT_LOWER] = far.at_lower.T.ravel()[better]
    found = np.flatnonzero(upper < mine[:, UP])
    at, link = far.at_upper.T.ravel()[found], found % arm.n_links
    rows = (trajectory.x0[at], trajectory.alpha[at], trajectory.theta[at])
    start = joint_centres(arm, *rows)[np.arange(len(at)), link]
    point = far.point.T[found // arm.n_links]
    gap = np.linalg.norm(point - start, axis=1)
    mine[found, UP] = gap - arm.link_radius + proving.task.rules.pad
    mine[found, AT_UPPER], mine[found, TIME] = at, 0.0
    mine[found, OTHER:] = point


def _narrow(proving: _Proving, group: int) -> None:
    """Narrow the least bracket over the obstacles or over the links."""
    task, results = proving.task, proving.results
    mine = (task.pairs.frame == BASE) == (group == OBSTACLES)
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
    )
    heap = np.zeros((CANDIDATES + BUDGET, SLICE))
    again = results._replace(counts=np.zeros_like(results.counts))
    count = narrow(task, proving.motion, proving.desk, again, group, order, heap, found)
    proved = np.full(n_pairs, results.limit[group] - task.rules.gap)
    np.minimum.at(proved, heap[:count, PAIR].astype(np.int64), heap[:count, KEY])
    proved = np.minimum(proved, results.overflow[group])[mine]
    results.best[mine, LOW] = np.maximum(results.best[mine, LOW], proved)
    if group == OBSTACLES:
        # Every interval keeps what the narrowing proved of all of them.
        lower = results.profile[0]
        np.maximum(lower, proved.min(), out=lower)


def _send(proving: _Proving, sinks: Sequence[ClearanceSink]) -> None:
    """Sweep once more, closely and for the sinks, now that the least is known."""
    n_intervals, n_pairs = proving.n_intervals, proving.task.pairs.link.size
    length = CHUNK_VALUES // max(1, n_pairs) // BLOCK * BLOCK
    length = min(CHUNK, n_intervals, max(BLOCK, length))
    again = proving.results._replace(
        best=proving.results.best.copy(),
        counts=np.zeros((n_pairs, 3), np.int64),
        profile=np.full_like(proving.results.profile, np.inf),
        candidates=_room(0),
        tally=np.zeros(TALLY, np.int64),
        dense=_dense_rows(length, n_pairs),
    )
    for first in range(0, n_intervals, length):
        last = min(first + length, n_intervals)
        proving.sweep(again, first, last)
        chunk = _chunk(proving, again.dense, first, last - first)
        for sink in sinks:
            sink(chunk)


class HastyProof:
    """Asks whether the proof goes through, for stretches of a motion and error boxes.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
    """

    def __init__(self, problem: PlanningProblem, trajectory: Trajectory) -> None:
        # Nobody asks for a profile: all intervals share its one bin.
        self._proving = _proving(problem, trajectory, ErrorBox(), values=1)
        self._problem = problem
        self.n_intervals = self._proving.n_intervals

    def holds(self, errors: ErrorBox, first: int, last: int) -> bool:
        """Whether every interval from `first` to below `last` is proved.

        Stops at the first that is not.
        """
        known = self._proving
        task = make_task(self._problem, errors, known.task.pieces)
        # Pairs that remember nothing: the answer depends on the question alone.
        forget(known.desk.planes)
        known.results.limit[:] = np.inf
        args = task, known.motion, known.desk, known.results, known.culling
        return bool(sweep(*args, first, last, True))


def is_certified(
    problem: PlanningProblem, trajectory: Trajectory, errors: ErrorBox
) -> bool:
    """Whether the clearance proof goes through; stops at the first gap."""
    proof = HastyProof(problem, trajectory)
    return proof.holds(errors, 0, proof.n_intervals)
