"""An order of points in which every halved range is compact, in compiled code."""

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray


@compiled
def _precedes(points: FloatArray, axis: int, a: int, b: int) -> bool:
    """Whether point a comes before point b along an axis; ties by number."""
    if points[a, axis] == points[b, axis]:
        return a < b
    return bool(points[a, axis] < points[b, axis])


@compiled
def _halve(
    points: FloatArray, order: IntArray, first: int, last: int, middle: int, axis: int
) -> None:
    """Put the least of a range before its middle (Hoare's selection)."""
    low, high = first, last - 1
    while low < high:
        pivot, i, j = order[(low + high) // 2], low, high
        while i <= j:
            while _precedes(points, axis, order[i], pivot):
                i += 1
            while _precedes(points, axis, pivot, order[j]):
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@compiled
def _longest(points: FloatArray, order: IntArray, first: int, last: int) -> int:
    """The axis along which a range is longest."""
    best, axis = -1.0, 0
    for c in range(3):
        low, high = np.inf, -np.inf
        for k in range(first, last):
            low = min(low, points[order[k], c])
            high = max(high, points[order[k], c])
        if high - low > best:
            best, axis = high - low, c
    return axis


@compiled
def coherent_order(points: FloatArray) -> IntArray:
    """An order in which every halved range is compact: a k-d tree's leaves.

    A range's lesser half along its longest axis comes first, the first of several;
    what is equal there goes by number. docs/certificate.md states this rule.

    Args:
        points: Shape (n, 3); [m].

    Returns:
        Permutation of 0..n-1, shape (n,).
    """
    order = np.arange(points.shape[0])
    # One half waits while the other is halved: as many as the tree is deep.
    waiting = np.zeros((64, 2), np.int64)
    waiting[0, 1] = points.shape[0]
    count = 1
    while count > 0:
        count -= 1
        first, last = waiting[count]
        if last - first <= 1:
            continue
        middle = (first + last) // 2
        axis = _longest(points, order, first, last)
        _halve(points, order, first, last, middle, axis)
        waiting[count, 0], waiting[count, 1] = first, middle
        waiting[count + 1, 0], waiting[count + 1, 1] = middle, last
        count += 2
    return order
