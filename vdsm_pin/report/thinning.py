"""Which rows and obstacles a page shows: all, or few enough and the remarkable ones."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.problem.any_problem import AnyMotion
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.records import Verification

MOST_ROWS: Final = 2_000
"""Rows of a motion that a page shows at most, besides remarkable ones."""

_MOST_CHANGES: Final = 500  # changes between path and detour that are kept

MOST_DRAWN: Final = 2_000
"""Obstacles that a page or a picture shows."""

MOST_PLOTTED: Final = 100
"""Obstacles with a curve of their own."""


def nearest_obstacles(verification: Verification, most: int) -> IntArray:
    """Numbers of the obstacles that come nearest, in file order; `most` of them."""
    count, least = len(verification.problem.scene.obstacles), verification.least
    if count <= most:
        return np.arange(count)
    lowers = dict.fromkeys(verification.problem.scene.names, np.inf)
    for pair, lower in zip(verification.pairs, least.lower.tolist(), strict=True):
        if pair.obstacle:
            lowers[pair.obstacle] = min(lowers[pair.obstacle], lower)
    return np.sort(np.argpartition(list(lowers.values()), most)[:most])


@dataclass(frozen=True)
class Thinned:
    """The rows shown.

    Args:
        rows: Their numbers, rising, first and last included, shape (k,).
        n_samples: Rows of the whole motion.
    """

    rows: IntArray
    n_samples: int

    @property
    def complete(self) -> bool:
        """Whether every row is shown."""
        return len(self.rows) == self.n_samples

    def least(self, bins: FloatArray, first: IntArray) -> FloatArray:
        """Least value between neighbouring rows shown.

        Args:
            bins: A profile's values, shape (n_bins, m).
            first: The interval each bin begins with, rising from 0, shape (n_bins,).

        Returns:
            Shape (k - 1, m), or one row where one row is shown.
        """
        if len(self.rows) < 2:
            return frozen(bins.min(axis=0, keepdims=True))
        start = np.searchsorted(first, self.rows[:-1], side="right") - 1
        end = np.searchsorted(first, self.rows[1:], side="left")
        padded = np.vstack([bins, np.full((1, bins.shape[1]), np.inf)])
        edges = np.stack([start, end], axis=1).ravel()
        return frozen(np.minimum.reduceat(padded, edges, axis=0)[::2])


def thinned(trajectory: AnyMotion, keep: IntArray) -> Thinned:
    """Choose the rows to show.

    Args:
        trajectory: The whole motion.
        keep: Rows that must be among them; rows outside the motion are dropped.
    """
    n = trajectory.n_samples
    if n <= MOST_ROWS:
        return Thinned(np.arange(n), n)
    even = np.linspace(0, n - 1, MOST_ROWS).astype(np.int64)
    changes = np.zeros(0, np.int64)
    if isinstance(trajectory, Trajectory):
        changes = np.flatnonzero(np.diff(trajectory.on_path.astype(np.int64)))
        changes = changes[:_MOST_CHANGES]
    chosen = np.concatenate([even, changes, changes + 1, keep])
    return Thinned(np.unique(chosen[(chosen >= 0) & (chosen < n)]), n)
