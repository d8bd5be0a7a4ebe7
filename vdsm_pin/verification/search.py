"""Subdivision of intervals in compiled code: best first, with a budget."""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import bends_and_drifts, place_between
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.geometry.kernels import BRACKET, LOWER, NEAR, UPPER
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.verification.slices import Ends, Pairs, Rules, Space, slice_bound

CERTIFIED: Final = 0
REFUTED: Final = 1
UNDECIDED: Final = 2
"""Verdicts as the chunks number them."""

KEY: Final = 0
INTERVAL: Final = 1
PAIR: Final = 2
START: Final = 3
END: Final = 4
SLICE: Final = 5
"""Layout of a slice in a heap: lower bound, interval, pair, start, end."""

SHORTEST: Final = 2.0**-30
"""Shortest slice, in parts of an interval."""


class Motion(NamedTuple):
    """Rows of joint values.

    Args:
        x0: Shape (n_rows,); [m].
        alpha: Shape (n_rows, N); [rad].
        theta: Shape (n_rows, N); [rad].
    """

    x0: FloatArray
    alpha: FloatArray
    theta: FloatArray


class Task(NamedTuple):
    """Everything that stays the same while a motion is judged."""

    pieces: PackedPieces
    pairs: Pairs
    rules: Rules


class Witness(NamedTuple):
    """The least upper bound met so far, as arrays that compiled code can write.

    Args:
        value: Upper bound, its time, and the least instant lower bound, shape (3,).
        points: Core points of the link and of the partner, shape (6,); [m].
    """

    value: FloatArray
    points: FloatArray


@compiled
def new_witness() -> Witness:
    """A witness of nothing: infinite bounds."""
    apart()
    value = np.zeros(3)
    value[0] = value[2] = np.inf
    return Witness(value, np.zeros(6))


@compiled
def push(heap: FloatArray, count: int, row: FloatArray) -> int:
    """Add a slice to a heap of `count` slices; returns the new count."""
    apart()
    at = count
    while at > 0:
        parent = (at - 1) // 2
        if heap[parent, KEY] <= row[KEY]:
            break
        heap[at] = heap[parent]
        at = parent
    heap[at] = row
    return count + 1


@compiled
def pop(heap: FloatArray, count: int, row: FloatArray) -> int:
    """Take the slice of the least bound; returns the new count."""
    apart()
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


@compiled
def bound_between(
    task: Task, motion: Motion, ends: Ends, space: Space, row: FloatArray
) -> None:
    """Bound a slice and write the result to row[KEY].

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        ends: Working space for two configurations.
        space: Working space; holds the bracket on return.
        row: The slice.
    """
    apart()
    k = int(row[INTERVAL])
    last = min(k + 2, motion.x0.size)
    x0, alpha = motion.x0[k:last], motion.alpha[k:last]
    theta, lengths = motion.theta[k:last], task.rules.lengths
    for end in range(2):
        t = row[START + end] if last - k == 2 else 0.0
        place_between(t, x0, alpha, theta, lengths, ends.centres[end], ends.frames[end])
    if last - k == 2:
        bends_and_drifts(alpha, theta, lengths, ends.bends, ends.drifts)
    else:
        ends.bends[:] = 0.0
        ends.drifts[:] = 0.0
    h = row[END] - row[START]
    slice_bound(task.pieces, task.pairs, task.rules, ends, space, int(row[PAIR]), h)
    row[KEY] = space.out[LOWER]


@compiled
def examine(
    task: Task,
    motion: Motion,
    ends: Ends,
    space: Space,
    row: FloatArray,
    t: float,
    witness: Witness,
) -> float:
    """Look at one instant of a slice's interval; keeps the least upper bound.

    Returns:
        The clearance that a plane proves at this instant alone; [m].
    """
    apart()
    instant = row.copy()
    instant[START] = instant[END] = t
    bound_between(task, motion, ends, space, instant)
    upper = space.out[UPPER] - task.rules.radius + task.rules.pad
    if upper < witness.value[0]:
        witness.value[0], witness.value[1] = upper, t
        for c in range(NEAR, BRACKET):
            witness.points[c - NEAR] = space.out[c]
    witness.value[2] = min(witness.value[2], instant[KEY])
    return float(instant[KEY])


@compiled
def split(
    task: Task,
    motion: Motion,
    ends: Ends,
    space: Space,
    row: FloatArray,
    heap: FloatArray,
    count: int,
) -> int:
    """Push the two halves of a slice; returns the new count of the heap."""
    apart()
    start, end = row[START], row[END]
    middle = 0.5 * (start + end)
    half = row.copy()
    half[END] = middle
    bound_between(task, motion, ends, space, half)
    half[KEY] = max(half[KEY], row[KEY])
    count = push(heap, count, half)
    half[START], half[END] = middle, end
    bound_between(task, motion, ends, space, half)
    half[KEY] = max(half[KEY], row[KEY])
    return push(heap, count, half)


@compiled
def resolve(
    task: Task,
    motion: Motion,
    ends: Ends,
    space: Space,
    heap: FloatArray,
    row: FloatArray,
    witness: Witness,
) -> tuple[int, int]:
    """Decide one pair over one interval.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        ends: Working space for two configurations.
        space: Working space with a guess of n.
        heap: Working space; its length is the budget. On return its first rows tile
            the interval.
        row: The interval as one slice; row[KEY] is the proved bound on return.
        witness: The least upper bound, updated.

    Returns:
        Verdict and number of slices in the heap.
    """
    apart()
    required = task.pairs.required[int(row[PAIR])]
    rounding = task.rules.pad + task.rules.goal
    examine(task, motion, ends, space, row, 0.0, witness)
    examine(task, motion, ends, space, row, 1.0, witness)
    bound_between(task, motion, ends, space, row)
    count = push(heap, 0, row)
    while True:
        if heap[0, KEY] >= required:
            verdict = CERTIFIED
            break
        if witness.value[0] < required:
            verdict = REFUTED
            break
        # No slice can prove more than its instants: there is nothing to hope for where
        # they fall short, or where slices already prove as much but for rounding.
        least = witness.value[2]
        if least < required or least - heap[0, KEY] <= rounding:
            verdict = UNDECIDED
            break
        if count + 2 > heap.shape[0]:
            verdict = UNDECIDED
            break
        count = pop(heap, count, row)
        if row[END] - row[START] <= SHORTEST:
            count = push(heap, count, row)
            verdict = UNDECIDED
            break
        middle = 0.5 * (row[START] + row[END])
        examine(task, motion, ends, space, row, middle, witness)
        count = split(task, motion, ends, space, row, heap, count)
    row[KEY] = heap[0, KEY]
    return verdict, count


@compiled
def tighten(
    task: Task,
    motion: Motion,
    ends: Ends,
    space: Space,
    heap: FloatArray,
    count: int,
    gap: float,
    witnesses: FloatArray,
) -> int:
    """Split the slices of the least bounds until the bracket of the least is narrow.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        ends: Working space for two configurations.
        space: Working space.
        heap: A heap of slices with room for more: the budget.
        count: Slices in it.
        gap: Width of the bracket at which to stop; [m].
        witnesses: One row per pair: least upper bound, its interval, its time, core
            points (6), least instant bound; updated; shape (n_pairs, 10).

    Returns:
        Number of slices in the heap; the first is the least bound.
    """
    apart()
    row = np.zeros(SLICE)
    least = np.inf
    for pair in range(witnesses.shape[0]):
        least = min(least, witnesses[pair, 9])
    while count > 0 and count + 2 <= heap.shape[0]:
        if heap[0, KEY] >= least - gap or least < 0.0:
            break
        count = pop(heap, count, row)
        if row[END] - row[START] <= SHORTEST:
            count = push(heap, count, row)
            break
        witness = new_witness()
        middle = 0.5 * (row[START] + row[END])
        examine(task, motion, ends, space, row, middle, witness)
        least = min(least, witness.value[2])
        keep = witnesses[int(row[PAIR])]
        keep[9] = min(keep[9], witness.value[2])
        if witness.value[0] < keep[0]:
            keep[0], keep[1], keep[2] = witness.value[0], row[INTERVAL], middle
            for c in range(6):
                keep[3 + c] = witness.points[c]
        count = split(task, motion, ends, space, row, heap, count)
    return count
