"""Blocks of intervals against all pairs, in compiled code."""

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.geometry.compiled import apart, borrowed, clock, compiled
from vdsm_pin.proof.coasting import bound_above, bound_below, served
from vdsm_pin.proof.culling import Culling, cull
from vdsm_pin.proof.desk import Desk
from vdsm_pin.proof.layouts import OWN_POINT, UP, WIDTH
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
    n_links, pairs, axial = rules.lengths.size, task.pairs, task.bodies.axial
    quick = rules.steady and results.dense.verdict.shape[0] == 0
    for pair in near:
        link, frame = pairs.link[pair], pairs.frame[pair]
        column = n_links + pairs.obstacle[pair] if frame == BASE else -1
        group, plane, done = group_of(frame), planes[pair], 0
        if quick and axial[pairs.body[pair]]:
            length, f = rules.lengths[link], frame + 1
            points = rows.centres[f, link : link + 2]
            bound_below(
                points,
                rows.sags[f, link : link + 2],
                runs.growth,
                plane,
                2,
                pairs.lost[pair],
                0,
                count,
                runs.lower,
                runs.work,
            )
            bound_above(
                points[0],
                points[1],
                plane,
                1.0 / (length * length),
                pairs.rise[pair],
                0,
                count,
                runs.upper,
                runs.at_rows,
            )
            bar = pairs.required[pair]
            if steady[group]:
                bar = max(bar, limit[group] - rules.gap)
            done = served(lower, upper, bar, rules.slack, 2.0 * plane[WIDTH])
        if done == count:
            counts[pair, CERTIFIED] += count
            points_of = plane[OWN_POINT:WIDTH]
            note_upper(best[pair], upper, runs.at_rows, points_of, start, 0, count)
            if rules.nominal:
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
    if task.rules.steady:
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
        n_near = cull(task, desk, results, culling, start, offset, count)
        near = culling.near[:n_near]
        if not _sweep_block(
            task, motion, desk, results, near, start, offset, count, steady, hasty
        ):
            return False
    return True
