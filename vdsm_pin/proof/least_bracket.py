"""A second look at what may hold the least clearance, in compiled code."""

import numpy as np

from vdsm_pin.compiled import apart, borrowed, clock, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.proof.heaps import push
from vdsm_pin.proof.layouts import (
    AT_UPPER,
    END,
    INTERVAL,
    KEY,
    OWN,
    PAIR,
    SLICE,
    TIME,
    UP,
)
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.pair_sweep import Stretch, sweep_pair
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.row_places import fill_rows
from vdsm_pin.proof.search import Slicing, Witnesses, tighten
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.workspace import Workspace


@compiled
def _look_again(
    task: Task,
    motion: Motion,
    work: Workspace,
    results: Results,
    group: int,
    order: IntArray,
    heap: FloatArray,
) -> int:
    """Sweep the candidates closely and push the intervals that are still below.

    Returns:
        Number of intervals in the heap. What finds no room in it, or is not looked at
        since links and obstacles meet, is left in `results.overflow`.
    """
    apart()
    held, lower, count = results.candidates, work.runs.lower, 0
    row, beyond = np.zeros(SLICE), results.overflow
    row[END], filled = 1.0, -1
    for c in order:
        if clock() > task.rules.until:
            break
        if not held.lower[c] < results.limit[group] - task.rules.gap:
            continue
        if results.limit[group] < 0.0:
            beyond[group] = min(beyond[group], held.lower[c])
            continue
        start, size, pair = held.first[c], held.size[c], held.pair[c]
        if start != filled:
            fill_rows(task, motion, work.rows, start, size)
            filled = start
        stretch = Stretch(start, 0, size, True, False, True)
        sweep_pair(task, motion, work, results, pair, stretch)
        for local in range(size):
            if not lower[local] < results.limit[group] - task.rules.gap:
                continue
            if count + 1 >= heap.shape[0]:
                beyond[group] = min(beyond[group], lower[local])
                continue
            row[KEY], row[INTERVAL], row[PAIR] = lower[local], start + local, pair
            count = push(heap, count, row)
    return count


@compiled
def narrow(
    task: Task,
    motion: Motion,
    work: Workspace,
    results: Results,
    order: IntArray,
    heap: FloatArray,
    found: Witnesses,
) -> int:
    """Narrow the least bracket of a group of pairs.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        work: Working space.
        results: Holds the candidates; best upper bounds and the limit are improved. Its
            counts are spoilt: every candidate is counted again.
        order: Candidates of one group, those of one block together.
        heap: Room for intervals and their slices.
        found: Working space, nothing met yet.

    Returns:
        Number of slices in the heap: together with `results.overflow` they hold all
        that is not proved to be above the limit, less the gap; -1 if the time is over.
    """
    task = borrowed(task)
    motion = borrowed(motion)
    work = borrowed(work)
    results = borrowed(results)
    order = borrowed(order)
    heap = borrowed(heap)
    found = borrowed(found)
    group = task.pairs.group[results.candidates.pair[order[0]]]
    count = _look_again(task, motion, work, results, group, order, heap)
    found = Witnesses(
        found.upper,
        found.interval,
        found.time,
        found.points,
        found.instant,
        results.limit[group],
    )
    slicing = Slicing(task, motion, work.ends, work.space)
    count = tighten(slicing, heap, count, found)
    for pair in range(found.upper.size):
        if found.upper[pair] < results.best[pair, UP]:
            best = results.best[pair]
            best[UP], best[AT_UPPER] = found.upper[pair], found.interval[pair]
            best[TIME], best[OWN:] = found.time[pair], found.points[pair]
        results.limit[group] = min(results.limit[group], found.instant[pair])
    return -1 if clock() > task.rules.until else count
