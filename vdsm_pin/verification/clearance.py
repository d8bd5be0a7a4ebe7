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
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.blocks import sweep
from vdsm_pin.verification.link_clearance import arithmetic_pad
from vdsm_pin.verification.records import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    ErrorBox,
    Pair,
)
from vdsm_pin.verification.search import Motion, Task
from vdsm_pin.verification.slices import BASE, Pairs, Rules
from vdsm_pin.verification.sweep import (
    AT_LOWER,
    AT_UPPER,
    BEST,
    BLOCK,
    TIME,
    Desk,
    Results,
    narrow,
    new_desk,
)

BUDGET: Final = 20_000
"""Most slices of one interval and pair."""

CANDIDATES: Final = 65_536
"""Most intervals kept for narrowing the least bracket."""

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
    n_obstacles = len(problem.scene.obstacles)
    index = {name: k for k, name in enumerate(problem.scene.names)}
    rows = []
    for pair in all_pairs(problem):
        if pair.obstacle:
            needed = problem.required_clearance
            rows.append((pair.link - 1, index[pair.obstacle], BASE, needed))
        else:
            i, needed = pair.link - 1, problem.required_self_clearance
            rows.append((pair.other_link - 1, n_obstacles + i, i, needed))
    table = np.array(rows, dtype=float).reshape(-1, 4)
    link, obstacle, frame = np.ascontiguousarray(table[:, :3].T.astype(np.int64))
    return Pairs(link, obstacle, frame, np.ascontiguousarray(table[:, 3]))


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
    arm = problem.manipulator
    rules = Rules(
        lengths=np.array(arm.link_lengths),
        radius=float(arm.link_radius),
        joint_error=float(errors.joint),
        base_error=float(errors.base),
        obstacle_error=float(errors.obstacle),
        pad=float(arithmetic_pad(problem)),
        goal=TOLERANCES.bracket_gap,
    )
    return Task(pieces or pack_scene(problem), _packed_pairs(problem), rules)


@dataclass(frozen=True)
class ClearanceProof:
    """What the sweep proved.

    Args:
        pairs: Every pair.
        counts: Intervals by verdict, shape (n_pairs, 3).
        best: Least bounds of each pair, in the layout of `sweep`, (n_pairs, BEST).
        profile: Brackets along the motion.
        slices: Slices tried beyond one per interval and pair.
    """

    pairs: tuple[Pair, ...]
    counts: IntArray
    best: FloatArray
    profile: ClearanceProfile
    slices: int


def _new_results(
    problem: PlanningProblem, n_pairs: int, n_intervals: int, dense: int
) -> Results:
    columns = problem.manipulator.n_links + len(problem.scene.obstacles)
    stride = -(-n_intervals * columns * 2 // PROFILE_VALUES)
    n_bins = -(-n_intervals // stride)
    best = np.full((n_pairs, BEST), np.inf)
    best[:, [AT_LOWER, AT_UPPER, TIME]] = 0.0
    wanted = (dense, n_pairs) if dense else (0, 0)
    return Results(
        best=best,
        counts=np.zeros((n_pairs, 3), np.int64),
        profile=np.full((n_bins, 2, columns), np.inf),
        stride=stride,
        limit=np.full(2, np.inf),
        gap=TOLERANCES.least_bracket,
        candidates=np.zeros((CANDIDATES, 5)),
        tally=np.zeros(2, np.int64),
        overflow=np.full(2, np.inf),
        numbers=np.zeros((*wanted, 9)),
        verdicts=np.zeros(wanted, np.int64),
    )


def _chunk(results: Results, task: Task, first: int, count: int) -> ClearanceChunk:
    numbers = results.numbers[:count].copy()
    # In a pair of links the sweep moves the second one against the first.
    swapped = np.flatnonzero(task.pairs.frame != BASE)
    numbers[:, swapped, 3:] = np.roll(numbers[:, swapped, 3:], 3, axis=2)
    columns = [frozen(numbers[..., c]) for c in range(3)]
    return ClearanceChunk(
        first_interval=first,
        lower=columns[0],
        upper=columns[1],
        time=columns[2],
        verdict=frozen(results.verdicts[:count], np.int64),
        link_point=frozen(numbers[..., 3:6]),
        other_point=frozen(numbers[..., 6:9]),
    )


def _profile(problem: PlanningProblem, results: Results) -> ClearanceProfile:
    n_links = problem.manipulator.n_links
    low, high = results.profile[:, 0], results.profile[:, 1]
    first = np.arange(len(low)) * results.stride
    return ClearanceProfile(
        link_lower=frozen(low[:, :n_links]),
        link_upper=frozen(high[:, :n_links]),
        obstacle_lower=frozen(low[:, n_links:]),
        obstacle_upper=frozen(high[:, n_links:]),
        first_interval=frozen(first, np.int64),
    )


def prove_clearance(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    sinks: Sequence[ClearanceSink] = (),
) -> ClearanceProof:
    """Bracket the clearance of every pair over every interval.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
        errors: The proof covers every motion within it.
        sinks: Receive the brackets in chunks, in order.

    Returns:
        The proof, its least brackets narrowed.
    """
    task = make_task(problem, errors)
    pairs, n_pairs = all_pairs(problem), task.pairs.link.size
    motion = Motion(trajectory.x0, trajectory.alpha, trajectory.theta)
    n_intervals = max(1, trajectory.n_samples - 1)
    length = CHUNK_VALUES // max(1, n_pairs) // BLOCK * BLOCK
    length = min(CHUNK, n_intervals, max(BLOCK, length))
    results = _new_results(problem, n_pairs, n_intervals, length if sinks else 0)
    desk = new_desk(problem.manipulator.n_links, n_pairs, BUDGET)
    n_obstacles = len(problem.scene.obstacles)
    for first in range(0, n_intervals, length):
        last = min(first + length, n_intervals)
        sweep(task, motion, desk, results, first, last, n_obstacles, False)
        for sink in sinks:
            sink(_chunk(results, task, first, last - first))
    for group in range(2):
        _narrow(task, motion, desk, results, group)
    return ClearanceProof(
        pairs=pairs,
        counts=frozen(results.counts, np.int64),
        best=frozen(results.best),
        profile=_profile(problem, results),
        slices=int(results.tally[1]),
    )


def _narrow(
    task: Task, motion: Motion, desk: Desk, results: Results, group: int
) -> None:
    """Narrow the least bracket over the obstacles (group 0) or over the links (1)."""
    mine = (task.pairs.frame != BASE) == bool(group)
    if not mine.any():
        return
    heap = np.zeros((int(results.tally[0]) + BUDGET, 5))
    witnesses = np.zeros((len(mine), 10))
    witnesses[:, [0, 9]] = np.inf
    witnesses[0, 9] = results.limit[group]
    count = narrow(task, motion, desk, results, group, heap, witnesses)
    if not count:
        return
    results.limit[group] = witnesses[:, 9].min()
    least = np.full(len(mine), results.limit[group] - results.gap)
    np.minimum.at(least, heap[:count, 2].astype(np.int64), heap[:count, 0])
    least = np.minimum(least, results.overflow[group])
    of_candidates = results.candidates[: results.tally[0], 2].astype(np.int64)
    touched = np.zeros(len(mine), bool)
    touched[of_candidates[mine[of_candidates]]] = True
    if group == 0:
        # Every interval keeps what the narrowing proved of all of them.
        lower = results.profile[:, 0]
        np.maximum(lower, least[mine].min(), out=lower)
    results.best[touched, 0] = np.maximum(results.best[touched, 0], least[touched])


class HastyProof:
    """Asks whether the proof goes through, for stretches of a motion and error boxes.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion; one row counts as an interval without motion.
    """

    def __init__(self, problem: PlanningProblem, trajectory: Trajectory) -> None:
        self._problem, self._pieces = problem, pack_scene(problem)
        self._motion = Motion(trajectory.x0, trajectory.alpha, trajectory.theta)
        self.n_intervals = max(1, trajectory.n_samples - 1)
        # Nobody asks for a profile: all intervals share its one bin.
        results = _new_results(problem, len(all_pairs(problem)), 1, 0)
        self._results = results._replace(stride=self.n_intervals)

    def holds(self, errors: ErrorBox, first: int, last: int) -> bool:
        """Whether every interval from `first` to below `last` is proved.

        Stops at the first that is not.
        """
        task = make_task(self._problem, errors, self._pieces)
        arm, n_obstacles = self._problem.manipulator, len(self._problem.scene.obstacles)
        # Pairs that remember nothing: the answer depends on the question alone.
        desk = new_desk(arm.n_links, task.pairs.link.size, BUDGET)
        args = task, self._motion, desk, self._results, first, last, n_obstacles, True
        return bool(sweep(*args))


def is_certified(
    problem: PlanningProblem, trajectory: Trajectory, errors: ErrorBox
) -> bool:
    """Whether the clearance proof goes through; stops at the first gap."""
    proof = HastyProof(problem, trajectory)
    return proof.holds(errors, 0, proof.n_intervals)
