"""A block of intervals against all pairs, in compiled code."""

from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.geometry.kernels import FAR, LOWER, NEAR, NORMAL, UPPER
from vdsm_pin.verification.culling import cull
from vdsm_pin.verification.search import (
    CERTIFIED,
    END,
    INTERVAL,
    KEY,
    PAIR,
    SLICE,
    START,
    Motion,
    Task,
    bound_between,
    new_witness,
    resolve,
)
from vdsm_pin.verification.slices import (
    BASE,
    Ends,
    load_points,
    losses,
    obstacle_support,
    reach_along,
    slice_bound,
)
from vdsm_pin.verification.sweep import (
    BLOCK,
    POINT,
    SUPPORT,
    WIDTH,
    Desk,
    Results,
    Rows,
    fill_rows,
    note,
    stale_upper,
)

FEW: Final = 8
"""Up to so many obstacles nothing is culled and every bracket is narrow."""

SLACK: Final = 0.05
"""A bracket is renewed where it is wider than this part of the clearance, and wider
than twice what it was when its plane was found."""


@compiled
def _interval(rows: Rows, local: int) -> Ends:
    """The configurations of one interval of a block, as views."""
    return Ends(
        rows.centres[local : local + 2],
        rows.frames[local : local + 2],
        rows.bends[local],
        rows.drifts[local],
    )


@compiled
def _instant(rows: Rows, local: int) -> Ends:
    """One row of a block at both ends."""
    at = local
    return Ends(
        np.stack((rows.centres[at], rows.centres[at])),
        np.stack((rows.frames[at], rows.frames[at])),
        rows.bends[0],
        rows.drifts[0],
    )


@compiled
def _subdivide(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    k: int,
    local: int,
    pair: int,
) -> int:
    """Decide an interval by subdivision and record it; returns the verdict."""
    row, witness = np.zeros(SLICE), new_witness()
    row[INTERVAL], row[PAIR], row[END] = k, pair, 1.0
    verdict, count = resolve(
        task, motion, desk.ends, desk.space, desk.heap, row, witness
    )
    results.tally[1] += count
    lower, upper, time = row[KEY], witness.value[0], witness.value[1]
    group = 0 if task.pairs.frame[pair] == BASE else 1
    results.limit[group] = min(results.limit[group], witness.value[2])
    row[START] = row[END] = time
    bound_between(task, motion, desk.ends, desk.space, row)
    note(
        task,
        results,
        desk.ends,
        k,
        local,
        pair,
        lower,
        upper,
        time,
        verdict,
        witness.points,
    )
    desk.planes[pair, SUPPORT] = -np.inf
    return verdict


@compiled
def _renew(
    task: Task,
    desk: Desk,
    results: Results,
    ends: Ends,
    rows: Rows,
    local: int,
    pair: int,
    core: FloatArray,
) -> tuple[float, float, float]:
    """A new plane and witness for a pair.

    Returns:
        Lower bound over the interval, upper bound and its time.
    """
    space, plane = desk.space, desk.planes[pair]
    obstacle = task.pairs.obstacle[pair]
    space.out[NORMAL:NEAR] = plane[:3]
    slice_bound(task.pieces, task.pairs, task.rules, ends, space, pair, 1.0)
    lower, n = space.out[LOWER], space.out[NORMAL:NEAR].copy()
    start = end = -np.inf
    for k in range(2):
        p, q = space.points[k], space.points[2 + k]
        start = max(start, n[0] * p[0] + n[1] * p[1] + n[2] * p[2])
        end = max(end, n[0] * q[0] + n[1] * q[1] + n[2] * q[2])
    time = 1.0 if end > start else 0.0
    at = _instant(rows, local + int(time))
    slice_bound(task.pieces, task.pairs, task.rules, at, space, pair, 0.0)
    upper = space.out[UPPER] - task.rules.radius + task.rules.pad
    group = 0 if task.pairs.frame[pair] == BASE else 1
    results.limit[group] = min(results.limit[group], space.out[LOWER])
    core[0], core[1] = space.out[NEAR:FAR], space.out[FAR : FAR + 3]
    first, last = (
        task.pieces.first_piece[obstacle],
        task.pieces.first_piece[obstacle + 1],
    )
    plane[:3], plane[POINT:WIDTH] = n, core[1]
    plane[SUPPORT] = obstacle_support(task.pieces, first, last, n, space.scratch[0])
    plane[WIDTH] = upper - lower
    return lower, upper, time


@compiled
def _sweep_pair(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    first: int,
    count: int,
    offset: int,
    pair: int,
    hasty: bool,
) -> bool:
    """All intervals of a block for one pair; False where `hasty` and one is not proved.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        desk: Working space, its rows filled.
        results: Where to write.
        first: First interval of the block.
        count: Intervals in the block.
        offset: Row of `first` in the dense results.
        pair: The pair.
        hasty: Whether to stop at the first interval that is not proved.
    """
    link, frame = task.pairs.link[pair], task.pairs.frame[pair]
    required, rules = task.pairs.required[pair], task.rules
    plane, lost = desk.planes[pair], losses(task.rules, frame)
    core, group = np.zeros((2, 3)), 0 if frame == BASE else 1
    for local in range(count):
        ends = _interval(desk.rows, local)
        load_points(ends, desk.space, link, frame)
        n, time = plane[:3], 0.0
        reach = reach_along(rules, ends, desk.space, link, frame, n, 1.0)
        lower = plane[SUPPORT] - reach - lost
        core[1] = plane[POINT:WIDTH]
        upper = stale_upper(desk.space.points, core[1], core[0])
        upper += rules.pad - rules.radius
        allowed = 2.0 * plane[WIDTH] + SLACK * upper
        threshold = max(required, results.limit[group] - results.gap)
        if not (lower >= threshold and upper - lower <= allowed):
            lower, upper, time = _renew(
                task, desk, results, ends, desk.rows, local, pair, core
            )
        elif rules.joint_error + rules.base_error + rules.obstacle_error == 0.0:
            results.limit[group] = min(results.limit[group], upper)
        k = first + local
        if lower >= required:
            note(
                task,
                results,
                ends,
                k,
                offset + local,
                pair,
                lower,
                upper,
                time,
                CERTIFIED,
                core,
            )
            continue
        if hasty and upper < required:
            return False
        verdict = _subdivide(task, motion, desk, results, k, offset + local, pair)
        if hasty and verdict != CERTIFIED:
            return False
    return True


@compiled
def sweep(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    first: int,
    last: int,
    n_obstacles: int,
    hasty: bool,
) -> bool:
    """Judge the intervals [first, last); False where `hasty` and one is not proved.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        desk: Working space; what the pairs remember is carried on.
        results: Where to write.
        first: First interval.
        last: One past the last interval.
        n_obstacles: Obstacles of the scene; the axes of the links follow them.
        hasty: Whether to stop at the first interval that is not proved.
    """
    n_pairs = task.pairs.link.size
    near = np.ones(n_pairs, np.bool_)
    for start in range(first, last, BLOCK):
        count = min(BLOCK, last - start)
        fill_rows(task, motion, desk.rows, start, count)
        if n_obstacles > FEW:
            cull(task, desk, results, start, count, start - first, n_obstacles, near)
        for pair in range(n_pairs):
            if near[pair] and not _sweep_pair(
                task, motion, desk, results, start, count, start - first, pair, hasty
            ):
                return False
    return True
