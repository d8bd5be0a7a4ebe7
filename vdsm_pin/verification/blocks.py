"""A block of intervals against all pairs, in compiled code."""

from typing import Final

import numpy as np

from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.geometry.kernels import BRACKET, FAR, LOWER, NEAR, NORMAL, UPPER
from vdsm_pin.verification.coasting import POINT, SUPPORT, WIDTH, coast, crude_growth
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
    losses,
    obstacle_support,
    slice_bound,
)
from vdsm_pin.verification.sweep import (
    BLOCK,
    Desk,
    Results,
    Rows,
    fill_rows,
    note_block,
    surface_points,
)

FEW: Final = 8
"""Up to so many obstacles nothing is culled and every bracket is narrow."""


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
def _hold(rows: Rows, local: int, ends: Ends) -> None:
    """Write one row of a block to both ends."""
    apart()
    n_links = rows.frames.shape[1]
    for k in range(2):
        for joint in range(n_links + 1):
            for c in range(3):
                ends.centres[k, joint, c] = rows.centres[local, joint, c]
        for link in range(n_links):
            for r in range(3):
                for c in range(3):
                    ends.frames[k, link, r, c] = rows.frames[local, link, r, c]


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
    """Decide an interval by subdivision; writes its run and returns the verdict."""
    apart()
    row, witness = np.zeros(SLICE), new_witness()
    row[INTERVAL], row[PAIR], row[END] = k, pair, 1.0
    verdict, count = resolve(
        task, motion, desk.ends, desk.space, desk.heap, row, witness
    )
    results.tally[1] += count
    run, time = desk.runs[local], witness.value[1]
    run[0], run[1], run[2], run[9] = row[KEY], witness.value[0], time, 1.0
    group = 0 if task.pairs.frame[pair] == BASE else 1
    results.limit[group] = min(results.limit[group], witness.value[2])
    row[START] = row[END] = time
    bound_between(task, motion, desk.ends, desk.space, row)
    surface_points(
        task,
        desk.ends.centres[0],
        desk.ends.frames[0],
        task.pairs.frame[pair],
        witness.points,
        run[3:9],
    )
    desk.planes[pair, SUPPORT] = -np.inf
    return verdict


@compiled
def _renew(task: Task, desk: Desk, results: Results, local: int, pair: int) -> None:
    """A new plane and witness for a pair, and the run of the interval they are for."""
    apart()
    space, plane, run = desk.space, desk.planes[pair], desk.runs[local]
    obstacle = task.pairs.obstacle[pair]
    space.out[NORMAL:NEAR] = plane[:3]
    ends = _interval(desk.rows, local)
    slice_bound(task.pieces, task.pairs, task.rules, ends, space, pair, 1.0)
    lower, n = space.out[LOWER], space.out[NORMAL:NEAR].copy()
    start = end = -np.inf
    for k in range(2):
        p, q = space.points[k], space.points[2 + k]
        start = max(start, n[0] * p[0] + n[1] * p[1] + n[2] * p[2])
        end = max(end, n[0] * q[0] + n[1] * q[1] + n[2] * q[2])
    time = 1.0 if end > start else 0.0
    _hold(desk.rows, local + int(time), desk.ends)
    slice_bound(task.pieces, task.pairs, task.rules, desk.ends, space, pair, 0.0)
    upper = space.out[UPPER] - task.rules.radius + task.rules.pad
    group = 0 if task.pairs.frame[pair] == BASE else 1
    results.limit[group] = min(results.limit[group], space.out[LOWER])
    run[0], run[1], run[2], run[9] = lower, upper, time, 0.0
    run[3:9] = space.out[NEAR:BRACKET]
    first = task.pieces.first_piece[obstacle]
    last = task.pieces.first_piece[obstacle + 1]
    plane[:3], plane[POINT:WIDTH] = n, space.out[FAR:BRACKET]
    plane[SUPPORT] = obstacle_support(task.pieces, first, last, n, space.scratch[0])
    plane[WIDTH] = upper - lower


@compiled
def _sweep_pair(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    first: int,
    count: int,
    pair: int,
    hasty: bool,
) -> bool:
    """All intervals of a block for one pair; False where `hasty` and one is not proved.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        desk: Working space, its rows filled; its runs are written.
        results: For the least bounds.
        first: First interval of the block.
        count: Intervals in the block.
        pair: The pair.
        hasty: Whether to stop at the first interval that is not proved.
    """
    apart()
    rows, rules, frame = desk.rows, task.rules, task.pairs.frame[pair]
    required, group = task.pairs.required[pair], 0 if frame == BASE else 1
    lost, rise = losses(rules, frame), rules.pad - rules.radius
    errors, nowhere = np.zeros(2), np.zeros(1)
    errors[0], errors[1], nowhere[0] = rules.joint_error, rules.base_error, -np.inf
    crude = np.full(2, np.inf if rules.joint_error > 0.0 else 0.0)
    if hasty:
        for k in range(2):
            end = task.pairs.link[pair] + k
            crude[k] = crude_growth(rules.lengths, rules.joint_error, frame + 1, end)
    nominal = rules.joint_error + rules.base_error + rules.obstacle_error == 0.0
    local = 0
    while True:
        limit = results.limit[group : group + 1]
        # Who only asks whether the proof goes through needs no narrow brackets.
        threshold = required if hasty else max(required, limit[0] - results.gap)
        local = coast(
            rows.centres,
            rows.frames,
            rows.bends,
            rows.drifts,
            rules.lengths,
            task.pairs.link[pair],
            frame,
            desk.planes[pair],
            errors,
            crude,
            lost,
            rise,
            threshold,
            limit if nominal else nowhere,
            desk.space.scratch,
            desk.runs,
            local,
            count,
        )
        if local == count:
            return True
        _renew(task, desk, results, local, pair)
        if hasty:
            desk.planes[pair, WIDTH] = np.inf
        desk.verdicts[local] = CERTIFIED
        if not desk.runs[local, 0] >= required:
            if hasty and desk.runs[local, 1] < required:
                return False
            verdict = _subdivide(
                task, motion, desk, results, first + local, local, pair
            )
            desk.verdicts[local] = verdict
            if hasty and verdict != CERTIFIED:
                return False
        local += 1
        if local == count:
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
            if not near[pair]:
                continue
            desk.verdicts[:] = CERTIFIED
            if not _sweep_pair(task, motion, desk, results, start, count, pair, hasty):
                return False
            if hasty:  # every interval so far is proved: there is nothing to note
                continue
            note_block(
                task,
                results,
                desk.rows,
                pair,
                desk.runs,
                desk.verdicts,
                start,
                start - first,
                count,
            )
    return True
