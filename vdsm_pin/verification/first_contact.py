"""When a motion first comes too close: the beginning of a collision, not its depth."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.proof.layouts import UP
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.clearance import ClearanceProof, prove_clearance
from vdsm_pin.verification.records import ErrorBox, Pair
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
    """

    pair: Pair
    moment: float
    clear_before: bool


def first_contacts(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    proof: ClearanceProof,
    deadline: Deadline = NO_LIMIT,
) -> tuple[FirstContact, ...]:
    """Where the clearance is first lost, from obstacles and between links.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion.
        errors: The box that `proof` covers.
        proof: Of the whole motion; what it does not refute has no contact.
        deadline: When to give up.

    Returns:
        One at most of either kind.

    Raises:
        OutOfTime: If the time is over.
    """
    of_obstacles = np.array([bool(pair.obstacle) for pair in proof.pairs], dtype=bool)
    search = _Search(problem, trajectory, errors, deadline)
    found = (
        search.first(mine)
        for mine in (of_obstacles, ~of_obstacles)
        if proof.counts[mine, REFUTED].any()
    )
    return tuple(one for one in found if one is not None)


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
            if self._refuted(self._within(first, low, share), mine):
                pair, high = self._pair, share
            else:
                clear &= self._clear
                low = share
        moment = round(first + high, DIGITS) if self.trajectory.n_samples > 1 else 0.0
        return FirstContact(pair, moment, clear)

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

    def _within(self, interval: int, low: float, high: float) -> Trajectory:
        """A part of one interval, as an interval of its own."""
        ends = self._rows(interval, interval + 1)
        share = np.array([low, high])[:, None]
        joints = ends.joints[0] + share * (ends.joints[-1] - ends.joints[0])
        none = np.zeros(2)
        return Trajectory(
            none.astype(bool), none, joints[:, 0], joints[:, 1::2], joints[:, 2::2]
        )
