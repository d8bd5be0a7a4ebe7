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
from vdsm_pin.proof.layouts import LOW, TALLY
from vdsm_pin.proof.proofs import RANK
from vdsm_pin.proof.proving import Proving, dense_rows, room_for
from vdsm_pin.proof.results import Dense
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.terms import REFUTED, UNDECIDED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    LeastClearances,
)
from vdsm_pin.verification.clearances import (
    in_rows,
    least_clearances,
    profile_of,
    with_depths,
)
from vdsm_pin.verification.counterexample import find_counterexamples
from vdsm_pin.verification.moving import Knots
from vdsm_pin.verification.records import Counterexample, Pair

CHUNK_VALUES: Final = 1_000_000
"""Most (interval, pair) values held at once for the sinks."""

CHUNK: Final = 4096
"""Most intervals between two chunks."""


@dataclass(frozen=True)
class ClearanceProof:
    """What the sweep proved.

    Args:
        motion: What is asked.
        counts: Intervals certified, refuted and undecided, shape (n_pairs, 3); knots of
            what carries obstacles end intervals too.
        on_path: The least clearances, in intervals of the path.
        weakest_on_path: Of each pair the interval of the path with its least lower
            bound, shape (n_pairs,).
        profile: Brackets along the motion.
        late: Whether the time was over before all was judged.
        sent: Intervals whose brackets the sinks received: all, if there was time.
    """

    motion: AskedMotion
    counts: IntArray
    on_path: LeastClearances
    weakest_on_path: IntArray
    profile: ClearanceProfile
    late: bool
    sent: int

    @property
    def pairs(self) -> Sequence[Pair]:
        """Every pair."""
        return self.motion.asked.pairs

    @cached_property
    def least(self) -> LeastClearances:
        """The least clearances, in intervals of the trajectory."""
        return in_rows(self.on_path, self.motion.knots)

    def counterexamples(
        self, deadline: Deadline = NO_LIMIT
    ) -> tuple[Counterexample, ...]:
        """Motions within the errors that miss what the proof left undecided.

        Raises:
            OutOfTime: If the time is over.
        """
        least, weakest = self.on_path, self.weakest_on_path
        return find_counterexamples(self.motion, least, weakest, deadline)

    def with_depths(self, deadline: Deadline = NO_LIMIT) -> "ClearanceProof":
        """The same with what balls in both bodies of pairs prove.

        No depth is measured of bodies that nothing grows: where they meet their
        clearance is 0 at most, which refutes no required clearance of 0.
        """
        found = with_depths(self.motion, self.on_path, deadline=deadline)
        lost = (self.on_path.verdict == UNDECIDED) & (found.verdict == REFUTED)
        counts = self.counts.copy()
        counts[lost, REFUTED] += 1
        counts[lost, UNDECIDED] -= 1
        return replace(self, on_path=found, counts=frozen(counts, np.int64))


def _chunk(
    motion: AskedMotion,
    dense: Dense,
    span: tuple[int, int],
    least: FloatArray,
    pairs: IntArray,
) -> ClearanceChunk:
    """A chunk of the trajectory's intervals from the first to below the last."""
    knots, (first, last) = motion.knots, span
    count = int(knots.first[last] - knots.first[first])
    own, other = dense.own[:count], dense.other[:count]
    # In a pair of links the sweep moves the second one against the first.
    swapped = ~motion.asked.outer[None, :, None]
    chunk = ClearanceChunk(
        first_interval=first,
        # No interval is worse than what refining proved of all of them.
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


def prove_clearance(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    deadline: Deadline = NO_LIMIT,
) -> ClearanceProof:
    """`prove_motion` of a snake arm, of every motion within the errors."""
    motion = AskedMotion.of_arm(problem, trajectory, errors)
    return prove_motion(motion, Budget(until=deadline.end))


def prove_motion(
    motion: AskedMotion,
    budget: Budget,
    sinks: Sequence[ClearanceSink] = (),
    reach: float = math.inf,
) -> ClearanceProof:
    """Bracket the clearance of every pair over every interval.

    Args:
        motion: What is asked.
        budget: What is not judged within it is undecided.
        sinks: Receive the brackets in chunks, in order, once all is proved.
        reach: Obstacles that no link is proved nearer to than this, at any time, are
            left out of what the sinks receive; [m].

    Returns:
        The proof, its least brackets refined unless the time ended before.
    """
    asked, proving = motion.asked, motion.proving(budget)
    step("proving the clearance of %d pairs", asked.table.size)
    with watched(lambda: proving.share):
        told = proving.prove()
    sent = _send(motion, proving, sinks, reach) if sinks else 0
    n_links = max(asked.links, default=0)
    return ClearanceProof(
        motion=motion,
        counts=told.counts,
        on_path=least_clearances(asked, told),
        weakest_on_path=told.lower_interval,
        profile=profile_of(told.profile, told.stride, motion.knots, n_links),
        late=not told.in_time,
        sent=sent,
    )


def _send(
    motion: AskedMotion, proving: Proving, sinks: Sequence[ClearanceSink], reach: float
) -> int:
    """Sweep the near obstacles of a snake arm once more, closely and for the sinks.

    Returns:
        Number of intervals sent.
    """
    asked, known = motion.asked, proving.results
    outer, obstacle = asked.outer, asked.table.one - len(asked.own)
    # numpy.unique imports numpy.ma, for which every process would wait.
    near = np.flatnonzero(np.bincount(obstacle[outer & (known.best[:, LOW] <= reach)]))
    pairs = frozen(np.flatnonzero(~outer | np.isin(obstacle, near)), np.int64)
    if near.size < len(asked.scene.obstacles):
        motion = motion.among(pairs)
        proving = motion.proving(proving.budget)
    length = CHUNK_VALUES // max(1, pairs.size) // BLOCK * BLOCK
    length = min(CHUNK, proving.n_intervals, max(BLOCK, length))
    knots = motion.knots.first
    steps = _steps(knots, length)
    length = max(int(np.diff(knots[steps]).max()), 1)
    results = proving.results._replace(
        best=known.best[pairs],
        counts=np.zeros((pairs.size, 3), np.int64),
        profile=np.full_like(proving.results.profile, np.inf),
        limit=known.limit,
        candidates=room_for(0),
        tally=np.zeros(TALLY, np.int64),
        dense=dense_rows(length, pairs.size),
    )
    again, least = replace(proving, results=results), known.best[pairs, LOW]
    step("clearances of every interval")
    with watched(lambda: again.share):
        for begin, end in pairwise(steps):
            if not again.sweep(int(knots[begin]), int(knots[end])):
                return begin
            chunk = _chunk(motion, results.dense, (begin, end), least, pairs)
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
