"""Octrees: cells halved on demand, what they hold and what they lead to.

A cell is the code of its lowest corner (bits of the three coordinates in turn, counted
in cells of the finest level) and its level. Sorted codes are in depth-first order, so
the eight children of a cell take its place without any sorting.
"""

import heapq

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray

DEPTH = 18
"""Level of the finest cells; three coordinates of so many bits fit an integer."""
COORDINATE = sum(1 << (3 * bit) for bit in range(DEPTH))
"""Bits of the first coordinate in a code; those of the others stand beside them."""
FIRST_LEVEL = 4
"""Level of the cells begun with."""
SHUT = 0
"""Proved: a tip anywhere in the cell is too close to an obstacle or out of reach."""
DOUBTFUL = 1
"""Neither of the two others."""
OPEN = 2
"""A tip anywhere in the cell is clear and within reach."""


@compiled
def encode(x: int, y: int, z: int) -> int:
    """The code of a finest cell."""
    code = 0
    for bit in range(DEPTH):
        code |= ((x >> bit) & 1) << (3 * bit)
        code |= ((y >> bit) & 1) << (3 * bit + 1)
        code |= ((z >> bit) & 1) << (3 * bit + 2)
    return code


@compiled
def decode(code: int, axis: int) -> int:
    """One coordinate of a code."""
    value = 0
    for bit in range(DEPTH):
        value |= ((code >> (3 * bit + axis)) & 1) << bit
    return value


@compiled
def places(codes: IntArray) -> IntArray:
    """Lowest corners of cells, counted in finest cells, shape (n, 3)."""
    result = np.zeros((codes.size, 3), np.int64)
    for n in range(codes.size):
        for axis in range(3):
            result[n, axis] = decode(codes[n], axis)
    return result


@compiled
def holders(codes: IntArray, points: IntArray) -> IntArray:
    """Number of the cell that holds each finest cell, shape (n,)."""
    result = np.zeros(len(points), np.int64)
    for n in range(len(points)):
        result[n] = _holder(codes, encode(points[n, 0], points[n, 1], points[n, 2]))
    return result


@compiled
def _holder(codes: IntArray, code: int) -> int:
    """Number of the cell that holds a finest cell."""
    low, high = 0, codes.size
    while high - low > 1:
        middle = (low + high) // 2
        if codes[middle] <= code:
            low = middle
        else:
            high = middle
    return low


@compiled
def _beside(code: int, axis: int, level: int, ahead: bool) -> int:
    """The finest cell beside the lowest corner of a cell, -1 outside of all.

    A sum carries from bit to bit of one coordinate where those of the others are all
    set.

    Args:
        code: The cell's.
        axis: Along which axis, 0 to 2.
        level: The cell's.
        ahead: Whether past the cell, else one finest cell before it.
    """
    mask = COORDINATE << axis
    own = code & mask
    if ahead:
        moved = ((own | ~mask) + (1 << (3 * (DEPTH - level) + axis))) & mask
        return (code & ~mask) | moved if moved > own else -1
    return (code & ~mask) | ((own - (1 << axis)) & mask) if own > 0 else -1


@compiled
def adjoining(
    codes: IntArray, levels: IntArray, passable: BoolArray
) -> tuple[IntArray, IntArray]:
    """Cells that share a part of a face with each cell, both of them passable.

    A way that leaves a cell through an edge or a corner touches every cell about it:
    none of them is shut, and faces join them.

    Returns:
        Compressed rows: where each cell's neighbours begin, shape (n + 1,), and the
        neighbours.
    """
    count = codes.size
    pairs = np.zeros((6 * count, 2), np.int64)
    found = 0
    for n in range(count):
        if not passable[n]:
            continue
        for axis in range(3):
            for ahead in (False, True):
                beside = _beside(codes[n], axis, levels[n], ahead)
                if beside < 0:
                    continue
                other = _holder(codes, beside)
                # A smaller neighbour finds this cell from its own side.
                if levels[other] <= levels[n] and passable[other]:
                    pairs[found, 0], pairs[found, 1] = n, other
                    found += 1
    first = np.zeros(count + 1, np.int64)
    for e in range(found):
        first[pairs[e, 0] + 1] += 1
        first[pairs[e, 1] + 1] += 1
    for n in range(count):
        first[n + 1] += first[n]
    place = first[:-1].copy()
    neighbours = np.zeros(2 * found, np.int64)
    for e in range(found):
        a, b = pairs[e, 0], pairs[e, 1]
        neighbours[place[a]], neighbours[place[b]] = b, a
        place[a] += 1
        place[b] += 1
    return first, neighbours


@compiled
def doubt_to(
    sources: IntArray, first: IntArray, neighbours: IntArray, doubt: FloatArray
) -> FloatArray:
    """Least sum of `doubt` on a way through cells from any source, both ends counted.

    Args:
        sources: Cell numbers, shape (s,).
        first: Where each cell's neighbours begin, shape (n + 1,).
        neighbours: Cell numbers.
        doubt: What passing a cell costs, shape (n,).

    Returns:
        Shape (n,), inf where no way leads.
    """
    result = np.full(doubt.size, np.inf)
    heap = [(0.0, 0)][:0]
    for source in sources:
        result[source] = doubt[source]
        heapq.heappush(heap, (doubt[source], source))
    while len(heap) > 0:
        value, n = heapq.heappop(heap)
        if value > result[n]:
            continue
        for e in range(first[n], first[n + 1]):
            m = neighbours[e]
            if value + doubt[m] < result[m]:
                result[m] = value + doubt[m]
                heapq.heappush(heap, (result[m], m))
    return result


class Octree:
    """Cells that fill a cube, halved on demand.

    Args:
        corner: Lowest corner of the cube, shape (3,); [m].
        side: Of the cube; [m].
    """

    def __init__(self, corner: FloatArray, side: float) -> None:
        self.corner, self.side = corner, side
        count = 8**FIRST_LEVEL
        self.codes = np.arange(count) << (3 * (DEPTH - FIRST_LEVEL))
        self.levels = np.full(count, FIRST_LEVEL)
        self.known = self.look(self.codes, self.levels)

    def look(self, codes: IntArray, levels: IntArray) -> tuple[FloatArray, ...]:
        """What is kept of cells, shape (n,) each."""
        raise NotImplementedError

    def boxes(self, codes: IntArray, levels: IntArray) -> tuple[FloatArray, FloatArray]:
        """Centres, shape (n, 3), and half sides, shape (n,), of cells; [m]."""
        half = self.side / 2.0 ** (levels + 1.0)
        low = self.corner + self.side / 2.0**DEPTH * places(codes)
        return np.asarray(low + half[:, None]), np.asarray(half)

    def split(self, chosen: IntArray) -> None:
        """Put the eight children of cells in their place."""
        count = np.ones(self.codes.size, dtype=np.int64)
        count[chosen] = 8
        begin = np.cumsum(count) - count
        kids = (begin[chosen, None] + np.arange(8)).ravel()
        codes, levels = np.repeat(self.codes, count), np.repeat(self.levels, count)
        levels[kids] += 1
        shift = 3 * (DEPTH - levels[kids])
        codes[kids] += np.tile(np.arange(8), len(chosen)) << shift
        known = tuple(np.repeat(values, count, axis=0) for values in self.known)
        for values, fresh in zip(
            known, self.look(codes[kids], levels[kids]), strict=True
        ):
            values[kids] = fresh
        self.codes, self.levels, self.known = codes, levels, known
