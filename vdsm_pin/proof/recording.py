"""The planes of a proof, written down interval by interval, in compiled code."""

from math import sqrt
from typing import Final

import numpy as np

from vdsm_pin.compiled import borrowed, clock, compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.kernels import NEAR, NORMAL, Goal
from vdsm_pin.geometry.obstacles import middle_of
from vdsm_pin.geometry.pieces import HALF_SPACE
from vdsm_pin.proof.layouts import (
    CLAIM,
    END,
    FIRST,
    INTERVAL,
    KEY,
    LAST,
    OF_INTERVAL,
    OF_PAIR,
    PAIR,
    PLANE_NORMAL,
    SLICE,
    SLICE_END,
    SLICE_START,
    START,
)
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.search import Slicing, bound_between, new_witness, resolve
from vdsm_pin.proof.slices import leaf_bound, node_bound, plane_bound
from vdsm_pin.proof.terms import CERTIFIED, Task
from vdsm_pin.proof.workspace import Workspace

LOSS: Final = 1e-5
"""What a plane may prove less for the sake of fewer digits; [m]."""


def by_all_corners(task: Task) -> Task:
    """The task without rough versions of pairs, as `record` takes it.

    Whoever checks a plane counts all corners. Over a slice they may prove less than few
    of them do, less what those miss: the plane is the best one of where corners are at
    the ends, not of how far each of them swings in between.
    """
    rough = np.full_like(task.pairs.rough, -1)
    return task._replace(pairs=task.pairs._replace(rough=rough))


@compiled
def _claim(
    task: Task, work: Workspace, row: FloatArray, node: int, n: FloatArray
) -> float:
    """Clearance that one plane proves of the pieces of a node over a slice; [m]."""
    lost = task.pairs.lost[int(row[PAIR])]
    return plane_bound(task.pieces, work.space, node, lost, n)


@compiled(inline=False)
def _shortened(
    task: Task, work: Workspace, row: FloatArray, node: int, n: FloatArray
) -> float:
    """Take the whole numbers of few digits for n that prove nearly as much.

    Args:
        task: The scene, pairs and rules.
        work: Its space holds the body over the slice.
        row: The slice.
        node: The pieces.
        n: Of unit length; on return of any length, [-].

    Returns:
        The clearance that the plane proves; [m].
    """
    claim, needed = (
        _claim(task, work, row, node, n),
        task.pairs.required[int(row[PAIR])],
    )
    if task.pieces.kind[task.pieces.node_range[node, 0]] == HALF_SPACE:
        return claim  # its direction is not to be changed
    whole, tried = np.zeros(3), np.zeros(3)
    for digits in range(2, 7):
        squared = 0.0
        for c in range(3):
            whole[c] = np.rint(n[c] * 10.0**digits)
            squared += whole[c] * whole[c]
        if not squared > 0.0:
            continue
        for c in range(3):
            tried[c] = whole[c] / sqrt(squared)
        found = _claim(task, work, row, node, tried)
        if found >= needed and found >= claim - LOSS:
            n[:] = whole
            return found
    return claim


@compiled
def _write(
    task: Task,
    row: FloatArray,
    node: int,
    n: FloatArray,
    claim: float,
    records: FloatArray,
    count: int,
) -> int:
    """Append a plane; returns the new count, or -1 where there is no room."""
    if count == records.shape[0]:
        return -1
    pair = int(row[PAIR])
    start = task.pieces.first_piece[task.pairs.obstacle[pair]]
    first, last = task.pieces.node_range[node]
    out = records[count]
    out[OF_INTERVAL], out[OF_PAIR] = row[INTERVAL], pair
    out[SLICE_START], out[SLICE_END] = row[START], row[END]
    out[FIRST], out[LAST] = first - start, last - start
    out[PLANE_NORMAL:CLAIM] = n
    out[CLAIM] = claim
    return count + 1


@compiled(inline=False)
def _write_ranges(
    task: Task, work: Workspace, row: FloatArray, records: FloatArray, count: int
) -> int:
    """Write planes for ranges of pieces, as few as the hierarchy allows."""
    pieces, space, pair = task.pieces, work.space, int(row[PAIR])
    lost, needed = task.pairs.lost[pair], task.pairs.required[pair]
    n, nodes, middle = np.zeros(3), space.nodes, middle_of(space.body)
    waiting = 1
    nodes[0] = pieces.root[task.pairs.obstacle[pair]]
    while waiting > 0 and count >= 0:
        waiting -= 1
        node = nodes[waiting]
        if pieces.node_range[node, 1] - pieces.node_range[node, 0] == 1:
            goal = Goal(task.rules.goal, 0.0, lost, np.inf)
            leaf_bound(task, space, node, goal, False, space.trial)
            n[:] = space.trial[NORMAL:NEAR]
            claim = _shortened(task, work, row, node, n)
            count = _write(task, row, node, n, claim, records, count)
            continue
        bound = node_bound(pieces, space, node, middle, lost, n)
        if bound >= needed:
            claim = _shortened(task, work, row, node, n)
            count = _write(task, row, node, n, claim, records, count)
            continue
        nodes[waiting], nodes[waiting + 1] = pieces.node_right[node], node + 1
        waiting += 2
    return count


@compiled(inline=False)
def _write_slice(
    task: Task, work: Workspace, row: FloatArray, records: FloatArray, count: int
) -> int:
    """Write the planes of one slice; returns the new count, -1 without room.

    The slice is the one that `bound_between` bounded last, and proves.
    """
    pair = int(row[PAIR])
    root = task.pieces.root[task.pairs.obstacle[pair]]
    n = work.space.out[NORMAL:NEAR].copy()
    claim = _claim(task, work, row, root, n)
    first, last = task.pieces.node_range[root]
    if last - first == 1 or claim >= task.pairs.required[pair]:
        claim = _shortened(task, work, row, root, n)
        return _write(task, row, root, n, claim, records, count)
    work.space.trial[NORMAL:NEAR] = n
    return _write_ranges(task, work, row, records, count)


@compiled(inline=False)
def _record_pair(
    slicing: Slicing, work: Workspace, row: FloatArray, records: FloatArray, count: int
) -> tuple[int, bool]:
    """Write the planes of one pair over one interval.

    Returns:
        The new count, -1 without room, and whether the interval is proved.
    """
    task, pair = slicing.task, int(row[PAIR])
    row[START], row[END] = 0.0, 1.0
    work.space.out[NORMAL:NEAR] = work.planes[pair, :3]
    bound_between(slicing, row)
    work.planes[pair, :3] = work.space.out[NORMAL:NEAR]
    if row[KEY] >= task.pairs.required[pair]:
        return _write_slice(task, work, row, records, count), True
    verdict, n_slices = resolve(slicing, work.heap, row, new_witness())
    if verdict != CERTIFIED:
        return count, False
    for k in range(n_slices):
        if count >= 0:
            row[:] = work.heap[k]
            bound_between(slicing, row)
            count = _write_slice(task, work, row, records, count)
    return count, True


@compiled(inline=False)
def record(
    task: Task,
    motion: Motion,
    work: Workspace,
    first: int,
    last: int,
    records: FloatArray,
) -> tuple[int, int, int]:
    """Write the planes of the intervals [first, last) and all pairs.

    Args:
        task: The scene, pairs and rules, no pair with a rough version.
        motion: Rows of joint values.
        work: Working space; what the pairs remember is carried on.
        first: First interval.
        last: One past the last interval.
        records: Result, shape (room, RECORD).

    Returns:
        Number of planes written, the interval reached (below `last` where the room or
        the time ended; all its pairs are missing) and the pair that is not proved in
        it, or -1.
    """
    task = borrowed(task)
    motion = borrowed(motion)
    work = borrowed(work)
    records = borrowed(records)
    row, count = np.zeros(SLICE), 0
    slicing = Slicing(task, motion, work.ends, work.space)
    for k in range(first, last):
        before = count
        for pair in range(task.pairs.rough.shape[0]):
            if clock() > task.rules.until:
                return before, k, -1
            row[INTERVAL], row[PAIR] = k, pair
            count, proved = _record_pair(slicing, work, row, records, count)
            if not proved:
                return before, k, pair
            if count < 0:
                return before, k, -1
    return count, last, -1
