"""Clearances as data.

Brackets by interval, the least of a motion, those along it for a plot; and Coal's
distances: which pair, at which waypoint, how far apart.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen


@dataclass(frozen=True)
class ClearanceChunk:
    """Brackets of consecutive intervals; long motions arrive in many chunks.

    Args:
        first_interval: Number of the interval that row 0 of the arrays is about.
        lower: Proved lower bounds, shape (m, n_pairs); [m].
        upper: Proved upper bounds at `share`, shape (m, n_pairs); [m].
        share: Place of the upper bounds in their intervals, 0 to 1, (m, n_pairs); [-].
        verdict: 0 certified, 1 refuted, 2 undecided, shape (m, n_pairs).
        link_point: Witnesses on the links, base frame, shape (m, n_pairs, 3); [m].
        other_point: Witnesses on the partners, shape (m, n_pairs, 3); [m].
        pairs: Numbers of the pairs of the columns; None for all pairs in order.
    """

    first_interval: int
    lower: FloatArray
    upper: FloatArray
    share: FloatArray
    verdict: IntArray
    link_point: FloatArray
    other_point: FloatArray
    pairs: IntArray | None = None


@dataclass(frozen=True)
class LeastClearances:
    """The least clearance of every pair over the whole motion.

    Args:
        interval: Where the upper bound was found, of the trajectory or of the joint
            path: the holder says which; shape (n_pairs,).
        share: Its place in the interval, 0 to 1, shape (n_pairs,); [-].
        lower: Proved lower bound over the motion, shape (n_pairs,); [m].
        upper: Proved upper bound, shape (n_pairs,); [m].
        verdict: 0 certified, 1 refuted, 2 undecided, shape (n_pairs,).
        link_point: Witnesses on the links, base frame, shape (n_pairs, 3); [m].
        other_point: Witnesses on the partners, shape (n_pairs, 3); [m].
    """

    interval: IntArray
    share: FloatArray
    lower: FloatArray
    upper: FloatArray
    verdict: IntArray
    link_point: FloatArray
    other_point: FloatArray

    def of(self, pairs: IntArray) -> "LeastClearances":
        """The rows of some pairs, whose numbers have shape (m,)."""
        return LeastClearances(
            *(getattr(self, one.name)[pairs] for one in fields(self))
        )

    def with_rows(self, rows: Mapping[int, Sequence[Any]]) -> "LeastClearances":
        """A copy in which some pairs have other rows.

        Args:
            rows: By number of the pair its values, in the order of the fields.
        """
        changed = [getattr(self, one.name).copy() for one in fields(self)]
        for k, row in rows.items():
            for values, value in zip(changed, row, strict=True):
                values[k] = value
        for values in changed:
            values.setflags(write=False)
        return LeastClearances(*changed)


ClearanceSink: TypeAlias = Callable[[ClearanceChunk], None]
"""Receives chunks in order while a verification runs (a CSV writer, say)."""


@dataclass(frozen=True)
class ClearanceProfile:
    """Brackets along the motion, reduced to what a plot shows.

    Args:
        link_lower: Lower bound of each link, least over the obstacles, shape
            (n_bins, N); [m].
        link_upper: Upper bound of each link, likewise; [m].
        obstacle_lower: Lower bound of each obstacle, least over the links, shape
            (n_bins, n_obstacles); [m].
        obstacle_upper: Upper bound of each obstacle, likewise; [m].
        first_interval: First interval of each bin, shape (n_bins,). A bin is one
            interval unless the motion is very long.
    """

    link_lower: FloatArray
    link_upper: FloatArray
    obstacle_lower: FloatArray
    obstacle_upper: FloatArray
    first_interval: IntArray


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
