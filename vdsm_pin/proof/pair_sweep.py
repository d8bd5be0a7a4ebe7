"""One pair over a block of intervals, in compiled code.

Each pair keeps the plane and the witness point that served it last. Most intervals are
proved by that plane alone; a pair whose bracket grows too wide gets a new one; where
the bound misses the required clearance the interval is subdivided.
"""

from typing import Final

import numpy as np

from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.geometry.compiled import apart, clock, compiled
from vdsm_pin.geometry.kernels import BRACKET, FAR, LOWER, NEAR, NORMAL
from vdsm_pin.geometry.obstacles import node_support
from vdsm_pin.proof.coasting import coast, place_body, place_own
from vdsm_pin.proof.desk import Desk, load_rows, take_rows
from vdsm_pin.proof.holding import hold
from vdsm_pin.proof.layouts import (
    AT_UPPER,
    END,
    HELD_CLEARANCE,
    INSTANT,
    INTERVAL,
    KEY,
    MET,
    OWN,
    OWN_POINT,
    PAIR,
    POINT,
    RENEWED,
    SLICE,
    SLICES,
    START,
    SUPPORT,
    TIME,
    UP,
    WHEN,
    WIDTH,
)
from vdsm_pin.proof.results import Results, note_upper
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.search import bound_between, new_witness, resolve
from vdsm_pin.proof.slices import leaf_bracket, loaded_bound
from vdsm_pin.proof.swept_bodies import to_link
from vdsm_pin.proof.terms import (
    CERTIFIED,
    Motion,
    Mover,
    Task,
    group_of,
    mover_of,
)
from vdsm_pin.proof.witnesses import witness_at

STRETCH: Final = 8
"""Intervals that a new plane is tried on at first; doubled as long as it serves."""

ROUGH: Final = 0.1
"""Part of the slack that a new plane may miss, where it is not looked at closely."""


@compiled
def _renew(
    task: Task,
    mover: Mover,
    desk: Desk,
    results: Results,
    local: int,
    pair: int,
    goal: float,
    bar: float,
) -> float:
    """A new plane and witness for a pair, from one interval of the block.

    Args:
        task: The scene, pairs and rules.
        mover: The body of the pair.
        desk: Working space, its rows filled.
        results: For the tally.
        local: The interval.
        pair: The pair.
        goal: Width of a distance bracket at which to stop; [m].
        bar: Clearances below it are to be as good as they can be; [m].

    Returns:
        The clearance proved for that interval, where the partner is of many pieces and
        needs more than one plane, else -inf; [m].
    """
    apart()
    pieces, space, plane = task.pieces, desk.space, desk.planes[pair]
    root, proved = pieces.root[task.pairs.obstacle[pair]], -np.inf
    p, last = pieces.node_range[root]
    load_rows(task.rules, mover, desk, local, local + 1)
    space.out[NORMAL:NEAR] = plane[:3]
    if last - p == 1:
        leaf_bracket(pieces, space, p, goal, True, space.out)
    else:
        loaded_bound(task, space, pair, True, bar)
        proved = space.out[LOWER]
        if space.body.discs[0, RADIUS] == 0.0:
            hold(plane, proved, space.body)
    plane[:3], plane[POINT:WIDTH] = space.out[NORMAL:NEAR], space.out[FAR:BRACKET]
    n, stack, point = plane[:3], space.stack, space.scratch[0]
    plane[SUPPORT] = node_support(pieces, root, n, stack, point)
    if not mover.axial:
        _renew_witness(task, mover, desk, local, pair)
    results.tally[RENEWED] += 1
    return proved


@compiled
def _renew_witness(task: Task, mover: Mover, desk: Desk, local: int, pair: int) -> None:
    """Witnesses on a body that is no axis and on its partner, both at one row."""
    load_rows(task.rules, mover, desk, local, local)
    plane, space, rows = desk.planes[pair], desk.space, desk.rows
    space.out[NORMAL:NEAR] = plane[:3]
    loaded_bound(task, space, pair, True, np.inf)
    plane[POINT:WIDTH] = space.out[FAR:BRACKET]
    own = plane[OWN_POINT:POINT]
    own[:] = space.out[NEAR:FAR]
    take_rows(rows, local, local, desk.ends)
    to_link(mover, desk.ends.centres[0], desk.ends.frames[0], own)
    place_own(mover, rows, desk.runs, plane, BLOCK)


@compiled
def _look_at_row(
    task: Task, mover: Mover, desk: Desk, results: Results, local: int, pair: int
) -> None:
    """Lower the limit to what can be proved at a row at all, within the error box."""
    apart()
    load_rows(task.rules, mover, desk, local, local)
    space = desk.space
    space.out[NORMAL:NEAR] = desk.planes[pair, :3]
    loaded_bound(task, space, pair, False, np.inf)
    group = group_of(task.pairs.frame[pair])
    results.limit[group] = min(results.limit[group], space.out[LOWER])


@compiled
def _subdivide(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    k: int,
    m: int,
    local: int,
    pair: int,
) -> int:
    """Decide interval k by subdivision, row m of the dense results; its verdict."""
    apart()
    row, witness = np.zeros(SLICE), new_witness()
    row[INTERVAL], row[PAIR], row[END] = k, pair, 1.0
    verdict, count = resolve(
        task, motion, desk.ends, desk.space, desk.heap, row, witness
    )
    results.tally[SLICES] += count
    lower, upper, time = row[KEY], witness.value[MET], witness.value[WHEN]
    group = group_of(task.pairs.frame[pair])
    results.limit[group] = min(results.limit[group], witness.value[INSTANT])
    desk.runs.lower[local], desk.runs.upper[local] = lower, upper
    results.counts[pair, verdict] += 1
    best = results.best[pair]
    if upper < best[UP]:
        best[UP], best[AT_UPPER], best[TIME] = upper, k, time
        best[OWN:] = witness.points
    dense = results.dense
    if dense.verdict.shape[0] > 0:
        row[START] = row[END] = time
        bound_between(task, motion, desk.ends, desk.space, row)
        dense.lower[m, pair], dense.upper[m, pair] = lower, upper
        dense.time[m, pair], dense.verdict[m, pair] = time, verdict
        centres, frames = desk.ends.centres[0], desk.ends.frames[0]
        own, other = dense.own[m, pair], dense.other[m, pair]
        mover = mover_of(task, pair)
        witness_at(mover, centres, frames, witness.points, own, other)
    desk.planes[pair, SUPPORT] = desk.planes[pair, HELD_CLEARANCE] = -np.inf
    return verdict


@compiled
def _dense_stretch(
    mover: Mover,
    desk: Desk,
    results: Results,
    pair: int,
    offset: int,
    first: int,
    last: int,
) -> None:
    """Write intervals that one plane and witness bound to the dense results."""
    apart()
    runs, rows, dense = desk.runs, desk.rows, results.dense
    at_rows, points = runs.at_rows, desk.planes[pair, OWN_POINT:WIDTH]
    centres, frames = rows.centres[0], rows.frames[1:]
    for r in range(first, last):
        m, later = offset + r, 1 if at_rows[r + 1] < at_rows[r] else 0
        dense.lower[m, pair], dense.upper[m, pair] = runs.lower[r], runs.upper[r]
        dense.time[m, pair], dense.verdict[m, pair] = float(later), CERTIFIED
        witness_at(
            mover,
            centres[:, :, r + later],
            frames[:, :, :, r + later],
            points,
            dense.own[m, pair],
            dense.other[m, pair],
        )


@compiled
def sweep_pair(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    start: int,
    offset: int,
    count: int,
    pair: int,
    closely: bool,
    hasty: bool,
) -> bool:
    """All intervals of a block for one pair.

    Returns:
        False where `hasty` and one is not proved, or where the time is over: the rest
        is then neither judged nor counted.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        desk: Working space, its rows filled; its runs are written.
        results: Where to write.
        start: First interval of the block.
        offset: Its row in the dense results.
        count: Intervals in the block.
        pair: The pair.
        closely: Whether bounds below the least clearance met are made as good as they
            can be.
        hasty: Whether to stop at the first interval that is not proved.
    """
    apart()
    rules, rows, runs, plane = task.rules, desk.rows, desk.runs, desk.planes[pair]
    required, group = task.pairs.required[pair], group_of(task.pairs.frame[pair])
    counts, best, limit = results.counts[pair], results.best[pair], results.limit
    nominal, dense = rules.nominal, results.dense.verdict.shape[0] > 0
    goal = rules.goal if closely else max(rules.goal, ROUGH * rules.slack * required)
    slack = np.inf if hasty else rules.slack
    local, stretch, fresh, proved = 0, count, False, -np.inf
    mover = mover_of(task, pair)
    place_body(mover, rows, runs, count, rules.steady)
    place_own(mover, rows, runs, plane, count)
    while clock() <= rules.until:
        last, bar = min(count, local + stretch), required
        if closely:
            bar = max(bar, limit[group] - rules.gap)
        done = coast(
            rules, mover, rows, runs, plane, local, last, bar, slack, fresh, proved
        )
        if fresh and done == local:
            # This interval allows no more, and may be proved nevertheless.
            done += runs.lower[local] >= required
        if done > local:
            counts[CERTIFIED] += done - local
            points = plane[OWN_POINT:WIDTH]
            note_upper(best, runs.upper, runs.at_rows, points, start, local, done)
            if nominal:
                limit[group] = min(limit[group], best[UP])
            if dense:
                _dense_stretch(mover, desk, results, pair, offset, local, done)
        elif fresh:
            if hasty and runs.upper[local] < required:
                return False
            k, m = start + local, offset + local
            verdict = _subdivide(task, motion, desk, results, k, m, local, pair)
            if hasty and verdict != CERTIFIED:
                return False
            done = local + 1
        fresh, local = False, done
        if local == count:
            return True
        if done == last:
            stretch *= 2
            continue
        proved = _renew(task, mover, desk, results, local, pair, goal, bar)
        if not (nominal or hasty):
            _look_at_row(task, mover, desk, results, local, pair)
        fresh, stretch = True, STRETCH
    return False
