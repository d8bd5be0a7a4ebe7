"""Coal's distances as data: which pair, at which waypoint, how far apart."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen


@dataclass(frozen=True)
class CoalRows:
    """What Coal measured at the waypoints.

    Args:
        waypoint: Row of the trajectory, from 0, shape (m,).
        pair: Number of the pair, as in `Verification.pairs`, shape (m,).
        distance: By Coal; NaN where its answer is unusable, shape (m,); [m].
    """

    waypoint: IntArray
    pair: IntArray
    distance: FloatArray


NOTHING_MEASURED: Final = CoalRows(
    frozen([], np.int64), frozen([], np.int64), frozen([])
)
"""What a Coal that was not asked measured."""


class CoalIndex:
    """Finds Coal's distance by a key; of several with one key the least.

    Args:
        rows: What was measured.
        keys: Key of each, shape (m,).
    """

    def __init__(self, rows: CoalRows, keys: IntArray) -> None:
        order = np.lexsort((rows.distance, keys))
        self._keys = keys[order]
        found = np.column_stack([rows.waypoint, rows.distance])[order]
        self._found = np.vstack([found, [np.nan, np.nan]])

    def at(self, keys: IntArray) -> FloatArray:
        """Waypoint and distance for some keys, NaN where nothing was measured.

        Args:
            keys: Shape (k,).

        Returns:
            Shape (k, 2); waypoints, and [m].
        """
        place = np.searchsorted(self._keys, keys)
        known = np.append(self._keys, -1)[place] == keys
        return np.asarray(self._found[np.where(known, place, -1)])
