"""One pair over a block of intervals, in compiled code.

Each pair keeps the plane and the witness point that served it last, and most intervals
are proved by that plane alone. What an interval is tried with, and what comes next
where that misses:

1. the plane kept, with all intervals after it; next 2;
2. a new plane of the roughest version of the pair, with a window of intervals, which
   doubles as long as it serves; next 3, where the pair has a rough version, else 4;
3. a new plane of the next finer version, as in 2; next 3, from the pair itself 4;
4. subdivision, of this interval alone, then 1 from the next one on.
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import clock, compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.geometry.kernels import BRACKET, FAR, LOWER, NEAR, NORMAL, Goal
from vdsm_pin.geometry.obstacles import node_support
from vdsm_pin.proof.cached_clearances import cache_clearance
from vdsm_pin.proof.cached_planes import Demand, try_plane
from vdsm_pin.proof.layouts import (
    AT_UPPER,
    END,
    HELD_CLEARANCE,
    INSTANT,
    INTERVAL,
    KEY,
    KNOWN,
    MET,
    MET_AT,
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
    VERSION,
    WIDTH,
)
from vdsm_pin.proof.plane_bounds import place_disc, place_own
from vdsm_pin.proof.results import Results, note_upper
from vdsm_pin.proof.row_places import seen
from vdsm_pin.proof.rows import Rows
from vdsm_pin.proof.search import Slicing, new_witness, place_pair, resolve
from vdsm_pin.proof.slices import leaf_bracket, loaded_bound
from vdsm_pin.proof.sweep import Sweep
from vdsm_pin.proof.swept_bodies import to_body
from vdsm_pin.proof.terms import CERTIFIED, Mover, Task, finer, mover_of
from vdsm_pin.proof.witnesses import witness_at
from vdsm_pin.proof.workspace import Workspace, load_rows, take_frame

FIRST_TRIED: Final = 4
"""Intervals that a new plane is tried on at first; doubled as long as it serves."""

ROUGH: Final = 0.1
"""Part of the slack that a new plane may miss, where it is not looked at closely."""

LOOSELY: Final = 0
"""How a block is judged: bounds need be no better than what shows them to suffice."""
CLOSELY: Final = 1
"""Bounds below the least clearance met are made as good as they can be."""
YES_OR_NO: Final = 2
"""As `LOOSELY`, up to the first interval that is not proved."""
AGAIN: Final = 3
"""As `CLOSELY`, of what was judged: nothing is counted, no interval subdivided."""


class Block(NamedTuple):
    """Which intervals are judged, and how.

    Args:
        start: First interval.
        offset: Its row in the dense results.
        size: Number of intervals, at most BLOCK.
        mode: `LOOSELY`, `CLOSELY`, `YES_OR_NO` or `AGAIN`.
    """

    start: int
    offset: int
    size: int
    mode: int


@compiled(inline=False)
def _renew(
    task: Task,
    version: int,
    work: Workspace,
    local: int,
    pair: int,
    goal: Goal,
    bar: float,
) -> float:
    """A new plane and witness for a pair, from one interval of the block.

    Args:
        task: The scene, pairs and rules.
        version: The pair, or its rough version, of which they are to be.
        work: Working space, its rows filled.
        local: The interval.
        pair: The pair.
        goal: Width of a distance bracket at which to stop.
        bar: Clearances below it are to be as good as they can be; [m].

    Returns:
        The clearance proved for that interval, where the partner is of many pieces and
        needs more than one plane, else -inf; [m].
    """
    pieces, space, plane = task.pieces, work.space, work.planes[pair]
    root, proved = pieces.root[task.pairs.obstacle[version]], -np.inf
    mover, plane[VERSION] = seen(task, work.rows, version), version
    p, last = pieces.node_range[root]
    load_rows(task, mover, work, local, local + 1)
    space.out[NORMAL:NEAR] = plane[:3]
    goal = Goal(goal.width, goal.part, mover.lost, np.inf)
    if last - p == 1:
        leaf_bracket(pieces, space, p, goal, True, space.out)
    else:
        loaded_bound(task, space, version, True, bar)
        proved = space.out[LOWER]
        if space.body.discs[0, RADIUS] == 0.0:
            cache_clearance(plane, proved, space.body)
    plane[:3], plane[POINT:WIDTH] = space.out[NORMAL:NEAR], space.out[FAR:BRACKET]
    n, stack, point = plane[:3], space.stack, space.scratch[0]
    plane[SUPPORT] = node_support(pieces, root, n, stack, point)
    if mover.inverse < 0.0:
        _renew_witness(task, version, work, local, plane, goal)
    return proved


@compiled
def _renew_witness(
    task: Task, version: int, work: Workspace, local: int, plane: FloatArray, goal: Goal
) -> None:
    """Witnesses on a body that is no segment and on its partner, both at one row.

    As near to the distance as the plane, where the partner is of one piece.
    """
    mover, space, rows = seen(task, work.rows, version), work.space, work.rows
    load_rows(task, mover, work, local, local)
    space.out[NORMAL:NEAR] = plane[:3]
    p, last = task.pieces.node_range[task.pieces.root[task.pairs.obstacle[version]]]
    if last - p == 1:
        leaf_bracket(task.pieces, space, p, goal, True, space.out)
    else:
        loaded_bound(task, space, version, True, np.inf)
    plane[POINT:WIDTH] = space.out[FAR:BRACKET]
    own = plane[OWN_POINT:POINT]
    own[:] = space.out[NEAR:FAR]
    for frame in (mover.rest, mover.frame):
        take_frame(rows, local, frame, work.ends.start)
    to_body(mover, work.ends.start, own)
    place_own(mover, rows, work.runs, plane, rows.ways.shape[2])


@compiled(inline=False)
def _look_at_row(
    task: Task, work: Workspace, results: Results, local: int, pair: int
) -> None:
    """Lower the limit to what can be proved at a row at all, within the error box."""
    load_rows(task, seen(task, work.rows, pair), work, local, local)
    space = work.space
    space.out[NORMAL:NEAR] = work.planes[pair, :3]
    loaded_bound(task, space, pair, False, np.inf)
    group = task.pairs.group[pair]
    results.limit[group] = min(results.limit[group], space.out[LOWER])


@compiled(inline=False)
def _subdivide(sweep: Sweep, pair: int, block: Block, local: int) -> int:
    """Decide one interval of a block by subdivision; its verdict."""
    task, work, results = sweep.task, sweep.work, sweep.results
    row, witness = np.zeros(SLICE), new_witness()
    slicing = Slicing(task, sweep.motion, work.ends, work.space)
    k = block.start + local
    row[INTERVAL], row[PAIR], row[END], row[KEY] = k, pair, 1.0, -np.inf
    witness.value[KNOWN] = results.best[pair, UP]
    verdict, count = resolve(slicing, work.heap, row, witness)
    results.tally[SLICES] += count
    lower, upper, time = row[KEY], witness.value[MET], witness.value[MET_AT]
    group = task.pairs.group[pair]
    results.limit[group] = min(results.limit[group], witness.value[INSTANT])
    work.runs.lower[local], work.runs.upper[local] = lower, upper
    results.counts[pair, verdict] += 1
    best = results.best[pair]
    if upper < best[UP]:
        best[UP], best[AT_UPPER], best[TIME] = upper, k, time
        best[OWN:] = witness.points
    dense = results.dense
    if dense.verdict.shape[0] > 0:
        m = block.offset + local
        row[START] = row[END] = time
        place_pair(slicing, row)
        dense.lower[m, pair], dense.upper[m, pair] = lower, upper
        dense.time[m, pair], dense.verdict[m, pair] = time, verdict
        own, other, mover = (
            dense.own[m, pair],
            dense.other[m, pair],
            mover_of(task, pair),
        )
        witness_at(mover, work.ends.start, witness.points, own, other)
    work.planes[pair, SUPPORT] = work.planes[pair, HELD_CLEARANCE] = -np.inf
    return verdict


@compiled(inline=False)
def _write_dense(
    mover: Mover,
    work: Workspace,
    results: Results,
    pair: int,
    offset: int,
    first: int,
    last: int,
) -> None:
    """Write intervals that one plane and witness bound to the dense results."""
    runs, dense, pose = work.runs, results.dense, work.ends.start
    at_rows, points = runs.at_rows, work.planes[pair, OWN_POINT:WIDTH]
    for r in range(first, last):
        m, later = offset + r, 1 if at_rows[r + 1] < at_rows[r] else 0
        dense.lower[m, pair], dense.upper[m, pair] = runs.lower[r], runs.upper[r]
        dense.time[m, pair], dense.verdict[m, pair] = float(later), CERTIFIED
        for frame in (mover.rest, mover.frame):
            take_frame(work.rows, r + later, frame, pose)
        witness_at(mover, pose, points, dense.own[m, pair], dense.other[m, pair])


@compiled
def _note_proved(
    task: Task,
    mover: Mover,
    work: Workspace,
    results: Results,
    pair: int,
    block: Block,
    span: tuple[int, int],
) -> None:
    """Count and record the intervals, first to below last, that one plane proves."""
    local, done = span
    runs, best, group = work.runs, results.best[pair], task.pairs.group[pair]
    if block.mode != AGAIN:
        results.counts[pair, CERTIFIED] += done - local
    points = work.planes[pair, OWN_POINT:WIDTH]
    note_upper(best, runs, points, block.start, local, done)
    if task.rules.nominal:
        results.limit[group] = min(results.limit[group], best[UP])
    if results.dense.verdict.shape[0] > 0:
        _write_dense(mover, work, results, pair, block.offset, local, done)


@compiled
def _face(task: Task, mover: Mover, rows: Rows, plane: FloatArray, pair: int) -> None:
    """Guess the plane of a pair that has none: from a corner to a partner's middle."""
    pieces, obstacle = task.pieces, task.pairs.obstacle[pair]
    p, place = pieces.first_piece[obstacle], rows.tracks.places[mover.slots[0]]
    for c in range(3):
        plane[c] = pieces.centre[p, c] - place[c, 0]


@compiled(inline=False)
def sweep_pair(sweep: Sweep, pair: int, block: Block) -> bool:
    """All intervals of a block for one pair, from first to last.

    Returns:
        False where only a yes or no is asked and an interval is not proved, or where
        the time is over: the rest is then neither judged nor counted.

    Args:
        sweep: What they are judged with, its rows filled; its runs are written.
        pair: The pair.
        block: The intervals.
    """
    task, work, results = sweep.task, sweep.work, sweep.results
    rules, rows, runs, plane = task.rules, work.rows, work.runs, work.planes[pair]
    required, group = task.pairs.required[pair], task.pairs.group[pair]
    count, yes_or_no = block.size, block.mode == YES_OR_NO
    closely = block.mode == CLOSELY or block.mode == AGAIN
    goal = Goal(rules.goal, 0.0, 0.0, np.inf)
    if not closely:
        part = ROUGH * rules.slack
        # Of a segment the bracket has the witness too, of any other body the plane.
        of_clearance = part if mover_of(task, pair).inverse < 0.0 else 0.0
        goal = Goal(max(rules.goal, part * required), of_clearance, 0.0, np.inf)
    slack = np.inf if yes_or_no else rules.slack
    local, window, is_new, proved = 0, count, False, -np.inf
    roughest = finer(task.pairs, pair, pair)
    version = int(plane[VERSION]) if plane[SUPPORT] > -np.inf else roughest
    mover = seen(task, rows, version)
    if not plane[SUPPORT] > -np.inf:
        _face(task, mover, rows, plane, pair)
    place_disc(mover, rows, runs, count)
    place_own(mover, rows, runs, plane, count)
    while clock() <= rules.until:
        last, bar = min(count, local + window), required
        if closely:
            bar = max(bar, results.limit[group] - rules.gap)
        far = max(rules.far, results.limit[group])
        demand = Demand(local, last, bar, slack, far, is_new, proved)
        done = local
        if is_new or plane[SUPPORT] > -np.inf:
            done = try_plane(task, mover, rows, runs, plane, demand)
        if is_new and done == local:
            most = runs.lower[local] + mover.loose + rules.goal
            if version != pair and most >= required:
                # What few corners do not settle more of them may.
                version = finer(task.pairs, pair, version)
                mover = seen(task, rows, version)
                proved = _renew(task, version, work, local, pair, goal, bar)
                continue
            # This interval allows no more, and may be proved nevertheless.
            if runs.lower[local] >= required or block.mode == AGAIN:
                done += 1
        if done > local:
            span = local, done
            _note_proved(task, mover, work, results, pair, block, span)
        elif is_new:
            if yes_or_no and runs.upper[local] < required:
                return False
            verdict = _subdivide(sweep, pair, block, local)
            if yes_or_no and verdict != CERTIFIED:
                return False
            done = local + 1
        is_new, local = False, done
        if local == count:
            return True
        if done == last:
            window *= 2
            continue
        version, mover = roughest, seen(task, rows, roughest)
        proved = _renew(task, version, work, local, pair, goal, bar)
        results.tally[RENEWED] += 1
        if not (rules.nominal or yes_or_no):
            _look_at_row(task, work, results, local, pair)
        is_new, window = True, FIRST_TRIED
    return False
