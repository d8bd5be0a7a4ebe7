"""When a motion is too close: a collision's begin, end and intervals, not its depth."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import UP
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.clearance import ClearanceProof, prove_clearance
from vdsm_pin.verification.records import ClearanceChunk, Pair
from vdsm_pin.verification.task import pack_scene

STRETCH: Final = 64
"""Intervals looked at first; the next stretches are twice as long each."""

HALVINGS: Final = 24
"""How often the interval of the contact is halved."""

DIGITS: Final = 6
"""Decimals of a moment, in waypoints; finer than 24 halvings tell."""


@dataclass(frozen=True)
class FirstContact:
    """The first moment at which a pair is proved to be too close.

    Args:
        pair: The pair.
        moment: In waypoints: 12.25 is a quarter of the way from 12 to 13.
        clear_before: Whether every pair of its kind is proved clear before.
        last: The last moment at which some pair of its kind is proved to be too close;
            NaN where nobody noted the intervals; in waypoints.
        intervals: How many intervals some pair of its kind is too close in; 0 where
            nobody noted them.
        stretches: How many runs of neighbours they make.
        time: When `moment` is; NaN where rows have no times; [s].
        last_time: When `last` is; [s].
    """

    pair: Pair
    moment: float
    clear_before: bool
    last: float = nan
    intervals: int = 0
    stretches: int = 0
    time: float = nan
    last_time: float = nan

    def timed(self, trajectory: Trajectory) -> "FirstContact":
        """The same with the times of its moments, where there are any."""
        times = trajectory.times_at(np.array([self.moment, self.last]))
        if times is None:
            return self
        return replace(self, time=float(times[0]), last_time=float(times[1]))


class TooClose:
    """Notes the intervals in which a pair is too close; receives brackets as a sink.

    Args:
        pairs: Every pair, as chunks number them.
        n_intervals: Of the motion.
    """

    def __init__(self, pairs: Sequence[Pair], n_intervals: int) -> None:
        self._of_obstacles = np.array([bool(pair.obstacle) for pair in pairs], bool)
        self._noted = np.zeros((2, n_intervals), dtype=np.bool_)

    def __call__(self, chunk: ClearanceChunk) -> None:
        """Receive a chunk."""
        mine = self._of_obstacles
        mine = mine if chunk.pairs is None else mine[chunk.pairs]
        refuted = chunk.verdict == REFUTED
        here = slice(chunk.first_interval, chunk.first_interval + len(refuted))
        for noted, columns in zip(self._noted, (~mine, mine), strict=True):
            noted[here] |= refuted[:, columns].any(axis=1)

    def of(self, *, obstacles: bool) -> BoolArray:
        """Whether each interval is one, shape (n_intervals,)."""
        return np.asarray(self._noted[int(obstacles)])


def first_contacts(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    proof: ClearanceProof,
    deadline: Deadline = NO_LIMIT,
    noted: TooClose | None = None,
) -> tuple[FirstContact, ...]:
    """Where the clearance is first lost, from obstacles and between links.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion.
        errors: The box that `proof` covers.
        proof: Of the whole motion; what it does not refute has no contact.
        deadline: When to give up.
        noted: The intervals that are too close, where the whole motion was noted.

    Returns:
        One at most of either kind.

    Raises:
        OutOfTime: If the time is over.
    """
    of_obstacles = np.array([bool(pair.obstacle) for pair in proof.pairs], dtype=bool)
    search = _Search(problem, trajectory, errors, deadline)
    contacts = []
    for mine, kind in ((of_obstacles, True), (~of_obstacles, False)):
        found = search.first(mine) if proof.counts[mine, REFUTED].any() else None
        if found is not None and noted is not None:
            found = search.with_end(found, mine, noted.of(obstacles=kind))
        contacts += [] if found is None else [found.timed(trajectory)]
    return tuple(contacts)


class _Search:
    """Proofs of stretches of one motion."""

    def __init__(
        self,
        problem: PlanningProblem,
        trajectory: Trajectory,
        errors: ErrorBox,
        deadline: Deadline,
    ) -> None:
        self.problem, self.trajectory = problem, trajectory
        self.errors, self.deadline = errors, deadline
        self.pieces = pack_scene(problem)

    def first(self, mine: BoolArray) -> FirstContact | None:
        """Of some pairs the first that is refuted, and when; None if none is."""
        n_intervals = max(1, self.trajectory.n_samples - 1)
        first, last, clear = 0, min(STRETCH, n_intervals), True
        while not self._refuted(self._rows(first, last), mine):
            if last == n_intervals:
                return None
            clear &= self._clear
            first, last = last, min(3 * last - 2 * first, n_intervals)
        while last - first > 1:
            middle = (first + last) // 2
            if self._refuted(self._rows(first, middle), mine):
                last = middle
            else:
                clear &= self._clear
                first = middle
        self._refuted(self._rows(first, last), mine)
        pair, low, high = self._pair, 0.0, 1.0
        for _ in range(HALVINGS):
            share = (low + high) / 2.0
            if self._refuted(self.trajectory.within(first, low, share), mine):
                pair, high = self._pair, share
            else:
                clear &= self._clear
                low = share
        moment = round(first + high, DIGITS) if self.trajectory.n_samples > 1 else 0.0
        return FirstContact(pair, moment, clear)

    def with_end(
        self, found: FirstContact, mine: BoolArray, noted: BoolArray
    ) -> FirstContact:
        """The contact with its end, and the intervals it is in."""
        intervals = np.flatnonzero(noted)
        if not intervals.size or self.trajectory.n_samples == 1:
            return replace(found, last=found.moment, intervals=1, stretches=1)
        last, low, high = int(intervals[-1]), 0.0, 1.0
        for _ in range(HALVINGS):
            share = (low + high) / 2.0
            if self._refuted(self.trajectory.within(last, share, 1.0), mine):
                low = share
            else:
                high = share
        return replace(
            found,
            last=round(last + low, DIGITS),
            intervals=intervals.size,
            stretches=1 + int((np.diff(intervals) > 1).sum()),
        )

    def _refuted(self, rows: Trajectory, mine: BoolArray) -> bool:
        """Whether some pair is refuted; keeps which, and whether all are proved."""
        self.deadline.check()
        proof = prove_clearance(
            self.problem, rows, self.errors, (), self.pieces, self.deadline
        )
        counts: IntArray = np.where(mine[:, None], proof.counts, 0)
        self._clear = bool(counts.sum() == counts[:, CERTIFIED].sum())
        worst = np.where(counts[:, REFUTED] > 0, proof.best[:, UP], np.inf)
        self._pair = proof.pairs[int(np.argmin(worst))]
        return bool(counts[:, REFUTED].any())

    def _rows(self, first: int, last: int) -> Trajectory:
        """The intervals from `first` to below `last`."""
        return self.trajectory.part(first, last + 1)
