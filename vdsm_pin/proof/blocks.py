"""Blocks of intervals against all pairs, in compiled code."""

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.geometry.compiled import apart, borrowed, clock, compiled
from vdsm_pin.proof.coasting import glide, served
from vdsm_pin.proof.culling import Culling, cull
from vdsm_pin.proof.desk import Desk
from vdsm_pin.proof.layouts import POINT, UP, WIDTH
from vdsm_pin.proof.pair_sweep import sweep_pair
from vdsm_pin.proof.results import (
    Results,
    nominate,
    note_block,
    note_upper,
)
from vdsm_pin.proof.rows import BLOCK, fill_rows
from vdsm_pin.proof.terms import (
    BASE,
    CERTIFIED,
    Motion,
    Task,
    group_of,
    is_nominal,
    losses,
)


@compiled
def _sweep_block(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    near: IntArray,
    start: int,
    offset: int,
    count: int,
    steady: BoolArray,
    hasty: bool,
) -> bool:
    """All near pairs over a block whose rows are filled, as `sweep`.

    The quick way is tried here, with bare arrays: handing on whole tuples takes longer
    than to bound a block.
    """
    apart()
    rules, rows, runs, planes = task.rules, desk.rows, desk.runs, desk.planes
    best, counts, profile = results.best, results.counts, results.profile
    limit, lower, upper = results.limit, runs.lower[:count], runs.upper[:count]
    n_links, rise = rules.lengths.size, rules.pad - rules.radius
    nominal = is_nominal(rules)
    quick = rules.joint_error == 0.0 and results.dense.verdict.shape[0] == 0
    for pair in near:
        link, frame = task.pairs.link[pair], task.pairs.frame[pair]
        column = n_links + task.pairs.obstacle[pair] if frame == BASE else -1
        group, plane, done = group_of(frame), planes[pair], 0
        if quick:
            lost = losses(rules, frame)
            if frame == BASE:
                lost += abs(plane[0]) * rules.base_error
            glide(
                rows.centres[frame + 1],
                rows.sags[frame + 1],
                runs.growth,
                plane,
                link,
                rules.lengths[link],
                lost,
                rise,
                0,
                count,
                runs.lower,
                runs.upper,
                runs.at_rows,
                runs.work,
            )
            bar = task.pairs.required[pair]
            if steady[group]:
                bar = max(bar, limit[group] - rules.gap)
            done = served(lower, upper, bar, rules.slack, 2.0 * plane[WIDTH])
        if done == count:
            counts[pair, CERTIFIED] += count
            point = plane[POINT:WIDTH]
            note_upper(best[pair], upper, runs.at_rows, point, start, 0, count)
            if nominal:
                limit[group] = min(limit[group], best[pair, UP])
        elif not sweep_pair(
            task,
            motion,
            desk,
            results,
            start,
            offset,
            count,
            pair,
            bool(steady[group]),
            hasty,
        ):
            return False
        if hasty:  # all that is asked is whether everything is proved
            continue
        bar = limit[group] - rules.gap
        if note_block(
            best[pair],
            profile,
            results.stride,
            link,
            column,
            lower,
            upper,
            start,
            bar,
        ):
            nominate(task, results, pair, start, lower)
    return True


@compiled
def sweep(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    culling: Culling,
    first: int,
    last: int,
    hasty: bool,
) -> bool:
    """Judge the intervals [first, last).

    Returns:
        False where `hasty` and one is not proved, or where the time is over: what is
        left is then not counted.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        desk: Working space; what the pairs remember is carried on.
        results: Where to write.
        culling: For the pairs that are far.
        first: First interval; row 0 of the dense results.
        last: One past the last interval.
        hasty: As for `sweep_pair`.
    """
    task = borrowed(task)
    motion = borrowed(motion)
    desk = borrowed(desk)
    results = borrowed(results)
    culling = borrowed(culling)
    if task.rules.joint_error == 0.0:
        # Whoever asks about several error boxes leaves here what the last one added.
        desk.runs.growth[:] = 0.0
    limit, steady = results.limit, np.zeros(2, np.bool_)
    before = limit.copy()
    for start in range(first, last, BLOCK):
        if clock() > task.rules.until:
            return False
        # A limit that falls is soon out of date: what is below it is looked at later.
        for group in range(2):
            steady[group] = limit[group] >= before[group] - task.rules.gap
            steady[group] &= limit[group] < np.inf and not hasty
            before[group] = limit[group]
        count, offset = min(BLOCK, last - start), start - first
        fill_rows(motion, task.rules, desk.rows, start, count)
        n_near = cull(
            task, desk.rows, desk.space, results, culling, start, offset, count
        )
        near = culling.near[:n_near]
        if not _sweep_block(
            task, motion, desk, results, near, start, offset, count, steady, hasty
        ):
            return False
    return True
