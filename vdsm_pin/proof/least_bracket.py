"""A second look at what may hold the least clearance, in compiled code."""

import numpy as np

from vdsm_pin.compiled import clock, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.proof.heaps import pop, push
from vdsm_pin.proof.layouts import (
    AT_UPPER,
    CANDIDATES,
    END,
    INTERVAL,
    KEY,
    LOW,
    OWN,
    PAIR,
    SLICE,
    TIME,
    UP,
)
from vdsm_pin.proof.pair_sweep import AGAIN, Block, sweep_pair
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.row_places import fill_rows
from vdsm_pin.proof.rows import BEGIN, COUNT
from vdsm_pin.proof.search import Slicing, new_witnesses, tighten
from vdsm_pin.proof.sweep import Sweep
from vdsm_pin.proof.terms import ACROSS, Task


@compiled(inline=False)
def _in_order(task: Task, results: Results, group: int, heap: FloatArray) -> IntArray:
    """The candidates of a group that may hold the least bound.

    The least first, since it lowers the limit most, then block by block.
    """
    held, pairs = results.candidates, task.pairs
    row, count, n_pairs = np.zeros(SLICE), 0, pairs.rough.shape[0]
    for c in range(results.tally[CANDIDATES]):
        below = held.lower[c] < results.limit[group] - task.rules.gap
        if below and pairs.group[held.pair[c]] == group:
            row[KEY], row[PAIR] = held.first[c] * n_pairs + held.pair[c], c
            count = push(heap, count, row)
    order, least = np.zeros(count, np.int64), 0
    for k in range(order.size):
        count = pop(heap, count, row)
        order[k] = int(row[PAIR])
        if held.lower[order[k]] < held.lower[order[least]]:
            least = k
    for k in range(least, 0, -1):
        order[k - 1], order[k] = order[k], order[k - 1]
    return order


@compiled(inline=False)
def _look_again(sweep: Sweep, group: int, order: IntArray) -> int:
    """Sweep the candidates closely; what is still below goes to `work.intervals`.

    Returns:
        Their number. What finds no room, or is not looked at since links and obstacles
        meet, is left in `results.overflow`.
    """
    task, work, results = sweep.task, sweep.work, sweep.results
    held, lower, count = results.candidates, work.runs.lower, 0
    heap = work.intervals
    row, beyond = np.zeros(SLICE), results.overflow
    row[END], block = 1.0, work.rows.block
    for c in order:
        if clock() > task.rules.until:
            break
        if not held.lower[c] < results.limit[group] - task.rules.gap:
            continue
        if results.limit[group] < 0.0:
            beyond[group] = min(beyond[group], held.lower[c])
            continue
        start, size, pair = held.first[c], held.size[c], held.pair[c]
        if (
            start != block[BEGIN] or size != block[COUNT]
        ):  # what was judged last is there
            fill_rows(task, sweep.motion, work.rows, start, size)
        sweep_pair(sweep, pair, Block(start, 0, size, AGAIN))
        for local in range(size):
            if not lower[local] < results.limit[group] - task.rules.gap:
                continue
            if count + 1 >= heap.shape[0]:
                beyond[group] = min(beyond[group], lower[local])
                continue
            row[KEY], row[INTERVAL], row[PAIR] = lower[local], start + local, pair
            count = push(heap, count, row)
    return count


@compiled(inline=False)
def _raise_bounds(
    task: Task, results: Results, group: int, heap: FloatArray, count: int
) -> None:
    """Raise the lower bounds of a group's pairs to what is proved of all intervals.

    Args:
        task: The pairs and rules.
        results: Bounds and profile are raised.
        group: The group.
        heap: Together with `results.overflow` its first rows hold all that is not
            proved to be above the limit, less the gap.
        count: Number of these rows.
    """
    groups, best, profile = task.pairs.group, results.best, results.profile
    proved = np.full(best.shape[0], results.limit[group] - task.rules.gap)
    for k in range(count):
        pair = int(heap[k, PAIR])
        proved[pair] = min(proved[pair], heap[k, KEY])
    least = np.inf
    for pair in range(proved.size):
        if groups[pair] == group:
            bound = min(proved[pair], results.overflow[group])
            best[pair, LOW], least = max(best[pair, LOW], bound), min(least, bound)
    if group == ACROSS:
        # Every interval keeps what refining proved of all of them.
        for column in range(profile.shape[1]):
            for k in range(profile.shape[2]):
                profile[0, column, k] = max(profile[0, column, k], least)


@compiled(inline=False)
def refine(sweep: Sweep, group: int) -> None:
    """Refine the least bracket of a group of pairs.

    Args:
        sweep: Its results hold the candidates; bounds, profile and limit are improved.
        group: The group.
    """
    task, work, results = sweep.task, sweep.work, sweep.results
    heap = work.intervals
    order = _in_order(task, results, group, heap)
    if order.size == 0:
        return
    count = _look_again(sweep, group, order)
    found = new_witnesses(results.best.shape[0], results.limit[group])
    slicing = Slicing(task, sweep.motion, work.ends, work.space)
    count = tighten(slicing, heap, count, found)
    for pair in range(found.upper.size):
        if found.upper[pair] < results.best[pair, UP]:
            best = results.best[pair]
            best[UP], best[AT_UPPER] = found.upper[pair], found.interval[pair]
            best[TIME], best[OWN:] = found.time[pair], found.points[pair]
        results.limit[group] = min(results.limit[group], found.instant[pair])
    # Where not all was looked at again, what was proved before holds.
    if not clock() > task.rules.until:
        _raise_bounds(task, results, group, heap, count)
