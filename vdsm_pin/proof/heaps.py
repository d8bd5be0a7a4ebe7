"""Slices of intervals in a heap, the one of the least bound first."""

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.proof.layouts import KEY


@compiled(inline=False)
def push(heap: FloatArray, count: int, row: FloatArray) -> int:
    """Add a slice to a heap of `count` slices; returns the new count."""
    at = count
    while at > 0:
        parent = (at - 1) // 2
        if heap[parent, KEY] <= row[KEY]:
            break
        heap[at] = heap[parent]
        at = parent
    heap[at] = row
    return count + 1


@compiled(inline=False)
def pop(heap: FloatArray, count: int, row: FloatArray) -> int:
    """Take the slice of the least bound; returns the new count."""
    row[:] = heap[0]
    count -= 1
    last = heap[count].copy()
    at = 0
    while True:
        child = 2 * at + 1
        if child >= count:
            break
        if child + 1 < count and heap[child + 1, KEY] < heap[child, KEY]:
            child += 1
        if last[KEY] <= heap[child, KEY]:
            break
        heap[at] = heap[child]
        at = child
    heap[at] = last
    return count
