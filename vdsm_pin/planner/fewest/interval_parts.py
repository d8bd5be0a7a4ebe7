"""Parts of intervals that are not known to be clear, and where to cut them."""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray

LEANING = 0.3
"""Part of its length that a link is thought to advance along the rail at least; [-]."""
MOST_PARTS: Final = 8
"""Parts of one cut. More at once takes fewer turns, but looks at more where the first
would have shown that the way is blocked."""
LONG_TRAVEL: Final = 0.064
"""Way of a piece, over the arm's length, above which the middle is looked at whatever
the clearance; [-]."""


class Parts(NamedTuple):
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

    def inner(self, counts: IntArray) -> tuple[IntArray, FloatArray]:
        """The places that cut every part evenly, shape (n,) counts of 2 and more.

        Returns:
            The part of each, in order, and where it is in its interval, (r,) each.
        """
        part = np.repeat(np.arange(len(counts)), counts - 1)
        first = np.cumsum(counts - 1) - (counts - 1)
        step = (np.arange(len(part)) - first[part] + 1) / counts[part]
        low, high = self.low[part], self.high[part]
        return part, low + step * (high - low)

    def take(self, kept: BoolArray) -> "Parts":
        """Some of the parts."""
        return Parts._make(values[kept] for values in self)

    def cut(
        self,
        part: IntArray,
        share: FloatArray,
        centres: FloatArray,
        clearances: FloatArray,
    ) -> "Parts":
        """The parts between the places, every place of each part in order."""
        number = np.arange(len(self.interval))
        # Part by part: its begin, then its places; its places, then its end.
        begins = np.argsort(np.append(number, part), kind="stable")
        ends = np.argsort(np.append(part, number), kind="stable")
        return Parts(
            np.append(self.interval, self.interval[part])[begins],
            np.append(self.low, share)[begins],
            np.append(share, self.high)[ends],
            np.concatenate([self.centres, centres])[begins],
            np.concatenate([centres, self.next_centres])[ends],
            np.concatenate([self.clearances, clearances])[begins],
            np.concatenate([clearances, self.next_clearances])[ends],
        )


@compiled
def bow_bounds(centres: FloatArray, next_centres: FloatArray, bows: FloatArray) -> None:
    """How far joint centres stray from the straight line between two configurations.

    The tip does not; a link whose projection d goes along a line advances along the
    rail by a = sqrt(l^2 - d^2), which strays by d'^2 l^2 / 8 a^3 at most. Of directions
    that go along arcs, and below `LEANING`, it is an estimate.

    Args:
        centres: Of one configuration, shape (N + 1, 3); [m].
        next_centres: Of the other; [m].
        bows: Set to the bounds, the tip's last, shape (N + 1,); [m].
    """
    last = centres.shape[0] - 1
    bows[last] = 0.0
    for i in range(last - 1, -1, -1):
        length = turn = 0.0
        for c in range(3):
            side = centres[i + 1, c] - centres[i, c]
            length += side * side
            if c > 0:
                turn += (next_centres[i + 1, c] - next_centres[i, c] - side) ** 2
        a = min(
            centres[i + 1, 0] - centres[i, 0],
            next_centres[i + 1, 0] - next_centres[i, 0],
        )
        a = max(a, LEANING * np.sqrt(length))
        bows[i] = bows[i + 1] + turn * length / (8.0 * a**3)


@compiled
def parts_of_pieces(
    parts: "Parts", knees: BoolArray, need: FloatArray, finest: float, long_way: float
) -> IntArray:
    """Into how many parts to cut the way of a piece to see that it is clear.

    No point of a straight piece moves farther than both its ends, which may bow out on
    the way (`bow_bounds`). The number is what it takes if there is as much clearance on
    the way as at its ends, as a power of 2.

    Args:
        parts: The ways.
        knees: Of each interval, shape (n, N + 1).
        need: Clearance to keep in each interval, shape (n,); [m].
        finest: A way that is too short to matter; [m].
        long_way: A way that is cut whatever the clearance: it may hide a bend; [m].

    Returns:
        Shape (r, N), 0 where a piece is clear all the way.
    """
    interval, _, _, centres, next_centres, clearances, next_clearances = parts
    n_rows, n_links = clearances.shape
    counts = np.zeros((n_rows, n_links), dtype=np.int64)
    bows = np.zeros(n_links + 1)
    for r in range(n_rows):
        bow_bounds(centres[r], next_centres[r], bows)
        before = 0.0
        for i in range(n_links + 1):
            if not knees[interval[r], i]:
                continue
            square = 0.0
            for c in range(3):
                square += (next_centres[r, i, c] - centres[r, i, c]) ** 2
            here = np.sqrt(square) + 2.0 * bows[i]
            way, before = max(before, here), here
            if i == 0 or not way > finest:
                continue
            spare = (
                clearances[r, i - 1]
                + next_clearances[r, i - 1]
                - 2.0 * need[interval[r]]
            )
            if spare >= way and way <= long_way:
                continue
            counts[r, i - 1] = 2
            step = max(spare, finest)
            while 2 * counts[r, i - 1] <= MOST_PARTS and counts[r, i - 1] * step < way:
                counts[r, i - 1] *= 2
    return counts
