"""Parts of intervals that are not known to be clear, and where to cut them."""

from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.pose_kernels import Cutting, Seen, parts_of_pieces

MOST_PARTS: Final = 8
"""Parts of one cut. More at once takes fewer turns, but looks at more where the first
would have shown that the way is blocked."""
LONG_TRAVEL: Final = 0.064
"""Way of a piece, over the arm's length, above which the middle is looked at whatever
the clearance; [-]."""


@dataclass(frozen=True)
class Inner:
    """Places within parts, in order: the part of each, where it is in the interval."""

    part: IntArray
    share: FloatArray


@dataclass(frozen=True)
class Parts:
    """Parts of intervals with both ends looked at: where, joint centres, clearance.

    A piece that is settled has no clearance where its interval was cut (inf).
    """

    interval: IntArray
    low: FloatArray
    high: FloatArray
    centres: FloatArray
    next_centres: FloatArray
    clearances: FloatArray
    next_clearances: FloatArray

    def counts(
        self, knees: BoolArray, need: FloatArray, finest: float, length: float
    ) -> IntArray:
        """Into how many parts to cut for each piece, 0 where it is clear, shape (n, N).

        A long part may hide a bend or a curve: it is cut anyway.

        Args:
            knees: Of each interval, shape (m, N + 1).
            need: Clearance to keep in each interval, shape (m,); [m].
            finest: A way that is too short to matter; [m].
            length: Of the arm; [m].
        """
        begin = Seen(self.centres, self.clearances)
        end = Seen(self.next_centres, self.next_clearances)
        cutting = Cutting(finest, LONG_TRAVEL * length, MOST_PARTS)
        return parts_of_pieces(begin, end, knees, self.interval, need, cutting)

    def inner(self, counts: IntArray) -> Inner:
        """The places that cut every part evenly, shape (n,) counts of 2 and more."""
        part = np.repeat(np.arange(len(counts)), counts - 1)
        first = np.cumsum(counts - 1) - (counts - 1)
        step = (np.arange(len(part)) - first[part] + 1) / counts[part]
        low, high = self.low[part], self.high[part]
        return Inner(part, low + step * (high - low))

    def take(self, kept: BoolArray) -> "Parts":
        """Some of the parts."""
        return Parts(*(getattr(self, one.name)[kept] for one in fields(self)))

    def cut(self, inner: Inner, centres: FloatArray, clearances: FloatArray) -> "Parts":
        """The parts between the places, every place of each part in order."""
        number = np.arange(len(self.interval))
        # Part by part: its begin, then its places; its places, then its end.
        begins = np.argsort(np.append(number, inner.part), kind="stable")
        ends = np.argsort(np.append(inner.part, number), kind="stable")
        return Parts(
            np.append(self.interval, self.interval[inner.part])[begins],
            np.append(self.low, inner.share)[begins],
            np.append(inner.share, self.high)[ends],
            np.concatenate([self.centres, centres])[begins],
            np.concatenate([centres, self.next_centres])[ends],
            np.concatenate([self.clearances, clearances])[begins],
            np.concatenate([clearances, self.next_clearances])[ends],
        )
