"""Blocks of intervals against all pairs, in compiled code."""

import numpy as np

from vdsm_pin.compiled import borrowed, clock, compiled
from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.proof.broad_phase import settle_far
from vdsm_pin.proof.cached_planes import served
from vdsm_pin.proof.far_pairs import merge_far
from vdsm_pin.proof.layouts import OWN_POINT, UP, VERSION, WIDTH
from vdsm_pin.proof.least_bracket import refine
from vdsm_pin.proof.pair_sweep import CLOSELY, LOOSELY, YES_OR_NO, Block, sweep_pair
from vdsm_pin.proof.plane_bounds import bound_above, bound_below
from vdsm_pin.proof.results import Results, count_the_rest, note_block, note_upper
from vdsm_pin.proof.row_places import fill_rows, seen
from vdsm_pin.proof.rows import BLOCK, TURNED
from vdsm_pin.proof.sweep import Sweep
from vdsm_pin.proof.terms import ACROSS, CERTIFIED, WITHIN, Task
from vdsm_pin.proof.witnesses import place_best
from vdsm_pin.proof.workspace import Workspace


@compiled
def _serves(
    task: Task, work: Workspace, results: Results, pair: int, block: Block
) -> bool:
    """Whether a pair's cached plane serves a whole block; its bounds are written.

    The quick way out, of segments under errors that cost the same everywhere: most
    blocks of most pairs end here.
    """
    plane, runs = work.planes[pair], work.runs
    mover = seen(task, work.rows, int(plane[VERSION]))
    rules, count, group = task.rules, block.size, task.pairs.group[pair]
    bound_below(mover, work.rows.tracks, runs, plane, 0, count)
    bound_above(mover, work.rows.tracks, runs, plane, 0, count)
    bar = task.pairs.required[pair]
    if block.mode == CLOSELY:
        bar = max(bar, results.limit[group] - rules.gap)
    lower, upper = runs.lower[:count], runs.upper[:count]
    far = max(rules.far, results.limit[group])
    if served(lower, upper, bar, rules.slack, 2.0 * plane[WIDTH], far) < count:
        return False
    best = results.best[pair]
    results.counts[pair, CERTIFIED] += count
    note_upper(best, runs, plane[OWN_POINT:WIDTH], block.start, 0, count)
    if rules.nominal:
        results.limit[group] = min(results.limit[group], best[UP])
    return True


@compiled(inline=False)
def _sweep_block(
    sweep: Sweep, near: IntArray, block: Block, settled: BoolArray
) -> bool:
    """All near pairs over a block whose rows are filled, as `run_sweep`."""
    task, work, results = sweep.task, sweep.work, sweep.results
    runs, pairs, count = work.runs, task.pairs, block.size
    quick = task.rules.steady and results.dense.verdict.shape[0] == 0
    for pair in near:
        mode = CLOSELY if settled[pairs.group[pair]] else block.mode
        asked = Block(block.start, block.offset, count, mode)
        segment = task.bodies.inverse[pairs.body[pair]] >= 0.0
        if not (quick and segment and _serves(task, work, results, pair, asked)):
            if not sweep_pair(sweep, pair, asked):
                return False
        if block.mode == YES_OR_NO:  # all that is asked is whether everything is proved
            continue
        lower, upper = runs.lower[:count], runs.upper[:count]
        note_block(task, results, pair, block.start, lower, upper)
    return True


@compiled(inline=False)
def _run_sweep(sweep: Sweep, span: tuple[int, int], yes_or_no: bool) -> bool:
    """`run_sweep` of what is borrowed."""
    task, work, results, broad = sweep.task, sweep.work, sweep.results, sweep.broad
    mode, state = YES_OR_NO if yes_or_no else LOOSELY, work.rows.block
    if task.rules.steady and state[TURNED]:
        # Whoever asks about several error boxes leaves here what the last one added.
        work.runs.growth[:] = 0.0
    state[TURNED] = not task.rules.steady
    limit, settled = results.limit, np.zeros(2, np.bool_)
    before, (first, last) = limit.copy(), span
    for start in range(first, last, BLOCK):
        if clock() > task.rules.until:
            return False
        # A limit that falls is soon out of date: what is below it is looked at later.
        for group in range(2):
            settled[group] = limit[group] >= before[group] - task.rules.gap
            settled[group] &= limit[group] < np.inf and not yes_or_no
            before[group] = limit[group]
        count = min(BLOCK, last - start)
        block = Block(start, start - first, count, mode)
        fill_rows(task, sweep.motion, work.rows, start, count)
        n_near = settle_far(task, work, results, broad, block)
        near = broad.near[:n_near]
        if not _sweep_block(sweep, near, block, settled):
            return False
    return True


@compiled
def run_sweep(sweep: Sweep, span: tuple[int, int], yes_or_no: bool) -> bool:
    """Judge some intervals.

    Returns:
        False where only a yes or no is asked and an interval is not proved, or where
        the time is over: what is left is then not counted.

    Args:
        sweep: What they are judged with.
        span: First interval, row 0 of the dense results, and one past the last.
        yes_or_no: As for `sweep_pair`.
    """
    return _run_sweep(borrowed(sweep), span, yes_or_no)


@compiled
def judge(sweep: Sweep, span: tuple[int, int], refining: bool) -> bool:
    """Judge some intervals, whatever the time does not allow as undecided.

    The far pairs are brought to the results, the witnesses placed on the surfaces.

    Returns:
        Whether there was time for all.

    Args:
        sweep: What they are judged with.
        span: The intervals.
        refining: Whether to refine the least brackets, of all intervals, in time.
    """
    sweep = borrowed(sweep)
    task, motion, ends = sweep.task, sweep.motion, sweep.work.ends
    in_time, results = _run_sweep(sweep, span, False), sweep.results
    merge_far(task, motion, ends, results, sweep.broad)
    count_the_rest(results, span[1] - span[0])
    if in_time and refining:
        refine(sweep, ACROSS)
        refine(sweep, WITHIN)
    place_best(task, motion, ends, results.best)
    return in_time
