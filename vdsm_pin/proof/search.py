"""Subdivision of intervals in compiled code: best first, with a budget."""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import clock, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.kernels import BRACKET, LOWER, NEAR, UPPER
from vdsm_pin.proof.bends import bend_between
from vdsm_pin.proof.heaps import pop, push
from vdsm_pin.proof.layouts import (
    END,
    INSTANT,
    INTERVAL,
    KEY,
    KNOWN,
    MET,
    MET_AT,
    PAIR,
    SLICE,
    START,
)
from vdsm_pin.proof.motions import Motion, interpolate
from vdsm_pin.proof.packed_tree import place_two
from vdsm_pin.proof.slices import Space, slice_bound
from vdsm_pin.proof.swept_bodies import Ends, to_body
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED, Task, finer, mover_of

SHORTEST: Final = 2.0**-30
"""Shortest slice, in parts of an interval."""


class Slicing(NamedTuple):
    """What slices are bounded with.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        ends: Working space for two configurations.
        space: Working space of bounds; holds the bracket of the last one.
    """

    task: Task
    motion: Motion
    ends: Ends
    space: Space


class Witness(NamedTuple):
    """The least upper bound met so far, as arrays that compiled code can write.

    Args:
        value: Upper bound, its time, the least instant lower bound, and the least upper
            bound known from elsewhere, shape (4,).
        points: Core points of the body in its link's frame and of the partner in its
            own, shape (6,); [m].
    """

    value: FloatArray
    points: FloatArray


class Witnesses(NamedTuple):
    """The least upper bounds that `tighten` met, of every pair.

    Args:
        upper: Least upper bounds, shape (n_pairs,); [m].
        interval: Where they were met, shape (n_pairs,).
        time: When in that interval, shape (n_pairs,).
        points: Core points as in a `Witness`, shape (n_pairs, 6); [m].
        instant: Least bounds proved for one instant, shape (n_pairs,); [m].
        limit: Least upper bound met before; [m].
    """

    upper: FloatArray
    interval: IntArray
    time: FloatArray
    points: FloatArray
    instant: FloatArray
    limit: float


@compiled(inline=False)
def new_witness() -> Witness:
    """A witness of nothing: infinite bounds."""
    value = np.zeros(4)
    value[MET] = value[INSTANT] = value[KNOWN] = np.inf
    return Witness(value, np.zeros(6))


@compiled(inline=False)
def new_witnesses(n_pairs: int, limit: float) -> Witnesses:
    """Nothing met yet but the least upper bound of all."""
    return Witnesses(
        np.full(n_pairs, np.inf),
        np.zeros(n_pairs, np.int64),
        np.zeros(n_pairs),
        np.zeros((n_pairs, 6)),
        np.full(n_pairs, np.inf),
        limit,
    )


@compiled(inline=False)
def bound_between(slicing: Slicing, row: FloatArray) -> None:
    """Bound a slice as well as shows whether it is enough; row[KEY] is the result.

    Args:
        slicing: What they are bounded with.
        row: The slice.
    """
    place_pair(slicing, row)
    task, ends, space = slicing.task, slicing.ends, slicing.space
    pair, h = int(row[PAIR]), row[END] - row[START]
    ease = task.pairs.required[pair]
    slice_bound(task, ends, space, pair, h, np.inf, ease)
    row[KEY] = space.out[LOWER]


@compiled
def place_pair(slicing: Slicing, row: FloatArray) -> None:
    """A pair's frames at the ends of a slice and how they move between."""
    task, motion, ends = slicing.task, slicing.motion, slicing.ends
    k, start, end = int(row[INTERVAL]), row[START], row[END]
    way, steps = task.pairs.way[int(row[PAIR])], ends.bends.steps
    frames = task.ways.rest[way], task.ways.frame[way]
    interpolate(motion, k, start, ends.q)
    place_two(task.tree, ends.q, frames, steps, ends.start)
    if end > start:
        interpolate(motion, k, end, ends.q)
        place_two(task.tree, ends.q, frames, steps, ends.end)
    bend_between(task, motion, ends.bends, way, k, start, end)


@compiled(inline=False)
def _bound_towards(
    slicing: Slicing, row: FloatArray, aim: float, enough: float = np.inf
) -> bool:
    """Bound a slice by the roughest version of its pair that shows if it is enough.

    Args:
        slicing: What they are bounded with.
        row: The slice; row[KEY] is written, on entry it is what is known of it or of
            one that holds it.
        aim: A bound that is enough of a rough version; [m].
        enough: Of the pair itself, where its partner is of one piece; [m].

    Returns:
        Whether the bound is that of the pair itself.
    """
    place_pair(slicing, row)
    task, ends, space = slicing.task, slicing.ends, slicing.space
    pair, h, missing = int(row[PAIR]), row[END] - row[START], aim - row[KEY]
    version = finer(task.pairs, pair, pair)
    while version != pair:
        loose = task.pairs.loose[version]
        if missing < loose:  # less than what a rough version misses
            version = finer(task.pairs, pair, version)
            continue
        slice_bound(task, ends, space, version, h, enough)
        row[KEY] = space.out[LOWER]
        hopeless = h > 0.0 and row[KEY] + loose + task.rules.goal < aim
        if row[KEY] >= aim or hopeless:
            return False
        version = finer(task.pairs, pair, version)
    slice_bound(task, ends, space, pair, h, enough)
    row[KEY] = space.out[LOWER]
    return True


@compiled(inline=False)
def examine(slicing: Slicing, row: FloatArray, t: float, witness: Witness) -> None:
    """Look at one instant of a slice's interval; keeps the least upper bound.

    Where that may fall below the least one known it is found as closely as can be, else
    a rough version of the pair may do.
    """
    task, space = slicing.task, slicing.space
    instant = row.copy()
    instant[START] = instant[END] = t
    pair = int(row[PAIR])
    least = min(witness.value[MET], witness.value[KNOWN])
    aim = max(task.pairs.required[pair], least)
    exact = _bound_towards(slicing, instant, aim)
    upper = space.out[UPPER] + task.pairs.rise[pair]
    if upper < witness.value[MET]:
        witness.value[MET], witness.value[MET_AT] = upper, t
        for c in range(NEAR, BRACKET):
            witness.points[c - NEAR] = space.out[c]
        own, mover = witness.points[:3], mover_of(task, pair)
        to_body(mover, slicing.ends.start, own)
    if exact:
        witness.value[INSTANT] = min(witness.value[INSTANT], instant[KEY])


@compiled(inline=False)
def split(
    slicing: Slicing,
    row: FloatArray,
    heap: FloatArray,
    count: int,
    aim: float,
    enough: float,
) -> int:
    """Push the two halves of a slice; returns the new count of the heap.

    Bounds are as good as can be where that decides whether they come up to the aim, or
    to what is enough.
    """
    start, end = row[START], row[END]
    middle = 0.5 * (start + end)
    half = row.copy()
    half[END] = middle
    _bound_towards(slicing, half, aim, enough)
    half[KEY] = max(half[KEY], row[KEY])
    count = push(heap, count, half)
    half[START], half[END], half[KEY] = middle, end, row[KEY]
    _bound_towards(slicing, half, aim, enough)
    half[KEY] = max(half[KEY], row[KEY])
    return push(heap, count, half)


@compiled(inline=False)
def resolve(
    slicing: Slicing, heap: FloatArray, row: FloatArray, witness: Witness
) -> tuple[int, int]:
    """Decide one pair over one slice of an interval.

    Args:
        slicing: What they are bounded with.
        heap: Working space; its length is the budget. On return its first rows tile
            the slice.
        row: The slice; row[KEY] is the proved bound on return, on entry -inf.
        witness: The least upper bound, updated.

    Returns:
        Verdict and number of slices in the heap.
    """
    task = slicing.task
    required = task.pairs.required[int(row[PAIR])]
    rounding = task.rules.pad + task.rules.goal
    examine(slicing, row, row[START], witness)
    examine(slicing, row, row[END], witness)
    _bound_towards(slicing, row, required)
    count = push(heap, 0, row)
    while True:
        if heap[0, KEY] >= required:
            verdict = CERTIFIED
            break
        if witness.value[MET] < required:
            verdict = REFUTED
            break
        # No slice can prove more than its instants: there is nothing to hope for where
        # slices already prove as much but for rounding, or where instants fall short
        # of what is required. Where they do so by rounding alone, another instant may
        # fall below it as long as slices leave room for that.
        least, known = witness.value[INSTANT], heap[0, KEY]
        short, nearly = required - least, required - known <= task.rules.gap
        if least - known <= rounding or short > (0.0 if nearly else rounding):
            verdict = UNDECIDED
            break
        if count + 2 > heap.shape[0] or clock() > task.rules.until:
            verdict = UNDECIDED
            break
        count = pop(heap, count, row)
        if row[END] - row[START] <= SHORTEST:
            count = push(heap, count, row)
            verdict = UNDECIDED
            break
        middle = 0.5 * (row[START] + row[END])
        examine(slicing, row, middle, witness)
        count = split(slicing, row, heap, count, required, np.inf)
    row[KEY] = heap[0, KEY]
    return verdict, count


@compiled(inline=False)
def tighten(
    slicing: Slicing, heap: FloatArray, count: int, witnesses: Witnesses
) -> int:
    """Split the slices of the least bounds until the bracket of the least is narrow.

    Args:
        slicing: What they are bounded with.
        heap: A heap of slices with room for more: the budget.
        count: Slices in it.
        witnesses: Updated.

    Returns:
        Number of slices in the heap; the first is the least bound.
    """
    task = slicing.task
    row = np.zeros(SLICE)
    least = witnesses.limit
    while count > 0 and count + 2 <= heap.shape[0]:
        if heap[0, KEY] >= least - task.rules.gap or least < 0.0:
            break
        if clock() > task.rules.until:
            break
        count = pop(heap, count, row)
        if row[END] - row[START] <= SHORTEST:
            count = push(heap, count, row)
            break
        witness = new_witness()
        witness.value[KNOWN] = least
        middle = 0.5 * (row[START] + row[END])
        examine(slicing, row, middle, witness)
        least = min(least, witness.value[INSTANT])
        pair = int(row[PAIR])
        witnesses.instant[pair] = min(witnesses.instant[pair], witness.value[INSTANT])
        if witness.value[MET] < witnesses.upper[pair]:
            witnesses.upper[pair] = witness.value[MET]
            witnesses.interval[pair] = int(row[INTERVAL])
            witnesses.time[pair] = middle
            witnesses.points[pair] = witness.points
        aim = least - task.rules.gap
        count = split(slicing, row, heap, count, aim, aim)
    return count
