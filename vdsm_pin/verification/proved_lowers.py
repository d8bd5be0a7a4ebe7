"""Proved lower bounds interval by interval, for whoever compares with them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import ClearanceProof

COMPARED: Final = 2_000_000
"""Most proved bounds kept to hold Coal's distances against."""


@dataclass(frozen=True)
class ProvedLowers:
    """Proved lower bounds of the pairs over intervals, or else over the whole motion.

    Args:
        least: Over the motion, shape (n_pairs,); [m].
        column: Column of a pair in `lower`, below 0 for none, shape (n_pairs,).
        lower: Over each interval, shape (n_intervals, n_columns); [m].
    """

    least: FloatArray
    column: IntArray
    lower: FloatArray

    def at(self, waypoint: IntArray, pair: IntArray) -> FloatArray:
        """The larger bound of the two intervals that meet at a row, shape (m,); [m]."""
        column = self.column[pair]
        last = len(self.lower) - 1
        before = self.lower[np.minimum(np.maximum(waypoint - 1, 0), last), column]
        after = self.lower[np.minimum(waypoint, last), column]
        return np.where(column < 0, self.least[pair], np.maximum(before, after))


class LowersSink:
    """Collects the proved bounds of the intervals, where they fit into memory."""

    def __init__(self, problem: PlanningProblem, trajectory: Trajectory) -> None:
        n_intervals = max(1, trajectory.n_samples - 1)
        columns = len(problem.scene.obstacles) * problem.manipulator.axis_radii.size
        self.fits = 0 < n_intervals * columns <= COMPARED
        self._parts: list[FloatArray] = []
        self._pairs, self._size = np.zeros(0, np.int64), 0

    def keep(self, chunk: ClearanceChunk) -> None:
        """Receive a chunk."""
        self._size += chunk.lower.size
        if self._size <= COMPARED and chunk.pairs is not None:
            self._parts.append(chunk.lower)
            self._pairs = chunk.pairs

    def proved(self, proof: ClearanceProof) -> ProvedLowers:
        """The bounds of the intervals, and of the whole motion for other pairs."""
        least = proof.least.lower
        column = np.full(len(least), -1)
        lower = np.zeros((1, 1))
        whole = proof.sent == proof.motion.n_intervals and self._size <= COMPARED
        if self._pairs.size and whole:
            column[self._pairs] = np.arange(self._pairs.size)
            lower = np.concatenate(self._parts)
        return ProvedLowers(least, column, lower)
