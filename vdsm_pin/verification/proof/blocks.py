"""A block of intervals against all pairs, in compiled code.

Each pair keeps the plane and the witness point that served it last. Most intervals are
proved by that plane alone; a pair whose bracket grows too wide gets a new one; where
the bound misses the required clearance the interval is subdivided.
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import apart, borrowed, compiled
from vdsm_pin.geometry.kernels import BRACKET, FAR, LOWER, NEAR, NORMAL, bracket
from vdsm_pin.geometry.obstacles import node_support
from vdsm_pin.verification.proof.coasting import (
    PLANE,
    POINT,
    SUPPORT,
    WIDTH,
    Runs,
    coast,
    glide,
    new_runs,
    served,
)
from vdsm_pin.verification.proof.culling import Culling, cull
from vdsm_pin.verification.proof.heaps import END, INTERVAL, KEY, PAIR, SLICE, START
from vdsm_pin.verification.proof.results import (
    AT_UPPER,
    OTHER,
    RENEWED,
    SLICES,
    TIME,
    UP,
    Results,
    nominate,
    note_block,
    note_upper,
)
from vdsm_pin.verification.proof.rows import BLOCK, Rows, fill_rows, new_rows
from vdsm_pin.verification.proof.search import (
    INSTANT,
    MET,
    WHEN,
    bound_between,
    new_witness,
    resolve,
)
from vdsm_pin.verification.proof.slices import (
    Ends,
    Space,
    loaded_bound,
    new_ends,
    new_space,
)
from vdsm_pin.verification.proof.terms import (
    BASE,
    CERTIFIED,
    Motion,
    Task,
    group_of,
    is_nominal,
    losses,
)
from vdsm_pin.verification.proof.witnesses import witness_at

STRETCH: Final = 8
"""Intervals that a new plane is tried on at first; doubled as long as it serves."""

ROUGH: Final = 0.1
"""Part of the slack that a new plane may miss, where it is not looked at closely."""


class Desk(NamedTuple):
    """Working space of a sweep.

    Args:
        rows: The block.
        runs: Bounds of the block's intervals for one pair.
        planes: What the pairs remember, shape (n_pairs, PLANE).
        ends: For slices inside an interval.
        space: For bounds.
        heap: For subdivision; its length is the budget of one interval and pair.
    """

    rows: Rows
    runs: Runs
    planes: FloatArray
    ends: Ends
    space: Space
    heap: FloatArray


@compiled
def forget(planes: FloatArray) -> None:
    """No pair remembers a plane any more, shape (n_pairs, PLANE)."""
    planes[:] = 0.0
    planes[:, 0] = 1.0
    planes[:, SUPPORT] = -np.inf


@compiled
def new_desk(n_links: int, n_pairs: int, budget: int) -> Desk:
    """Fresh working space; no pair remembers a plane yet."""
    planes = np.zeros((n_pairs, PLANE))
    forget(planes)
    heap = np.zeros((budget, SLICE))
    ends, space = new_ends(n_links), new_space()
    return Desk(new_rows(n_links), new_runs(), planes, ends, space, heap)


@compiled
def _take_rows(rows: Rows, first: int, last: int, ends: Ends) -> None:
    """Write the configurations of two rows of a block to both ends of a slice."""
    apart()
    n_links = rows.turns.shape[0]
    for k in range(2):
        row = last if k else first
        for j in range(n_links + 1):
            for c in range(3):
                ends.centres[k, j, c] = rows.centres[0, j, c, row]
        for link in range(n_links):
            for c in range(3):
                for d in range(3):
                    ends.frames[k, link, c, d] = rows.frames[link + 1, c, d, row]


@compiled
def _load_rows(task: Task, desk: Desk, pair: int, first: int, last: int) -> None:
    """Load the link of a pair between two rows of a block; `last` is `first` or next.

    Of the ends only what joint errors ask for is written.
    """
    apart()
    rows, space, ends = desk.rows, desk.space, desk.ends
    link, f = task.pairs.link[pair], task.pairs.frame[pair] + 1
    for k in range(2):
        space.sags[k] = rows.sags[f, link + k, first] if last > first else 0.0
        for c in range(3):
            space.points[k, c] = rows.centres[f, link + k, c, first]
            space.points[2 + k, c] = rows.centres[f, link + k, c, last]
        if task.rules.joint_error > 0.0:
            ends.drifts[f, link + k] = rows.drifts[f, link + k, min(first, BLOCK - 1)]
    if task.rules.joint_error > 0.0:
        _take_rows(rows, first, last, ends)


@compiled
def _renew(
    task: Task, desk: Desk, results: Results, local: int, pair: int, goal: float
) -> float:
    """A new plane and witness for a pair, from one interval of the block.

    Returns:
        The clearance proved for that interval, where the partner is of many pieces and
        needs more than one plane, else -inf; [m].
    """
    apart()
    pieces, space, plane = task.pieces, desk.space, desk.planes[pair]
    root, proved = pieces.root[task.pairs.obstacle[pair]], -np.inf
    p, last = pieces.node_range[root]
    _load_rows(task, desk, pair, local, local + 1)
    space.out[NORMAL:NEAR] = plane[:3]
    if last - p == 1:
        bracket(pieces, p, space.points, 4, goal, space.scratch, space.out)
    else:
        loaded_bound(pieces, task.pairs, task.rules, desk.ends, space, pair, 1.0)
        proved = space.out[LOWER]
    plane[:3], plane[POINT:WIDTH] = space.out[NORMAL:NEAR], space.out[FAR:BRACKET]
    n, stack, point = plane[:3], space.stack, space.scratch[0]
    plane[SUPPORT] = node_support(pieces, root, n, stack, point)
    results.tally[RENEWED] += 1
    return proved


@compiled
def _look_at_row(
    task: Task, desk: Desk, results: Results, local: int, pair: int
) -> None:
    """Lower the limit to what can be proved at a row at all, within the error box."""
    apart()
    _load_rows(task, desk, pair, local, local)
    rules, space, pieces = task.rules, desk.space, task.pieces
    space.out[NORMAL:NEAR] = desk.planes[pair, :3]
    loaded_bound(pieces, task.pairs, rules, desk.ends, space, pair, 0.0)
    group = group_of(task.pairs.frame[pair])
    results.limit[group] = min(results.limit[group], space.out[LOWER])


@compiled
def _dense_row(
    task: Task,
    desk: Desk,
    results: Results,
    m: int,
    local: int,
    pair: int,
    verdict: int,
    time: float,
    point: FloatArray,
) -> None:
    """Write one interval to row m of the dense results; the ends are at its time."""
    apart()
    dense, places = results.dense, np.zeros(6)
    witness_at(task, desk.ends, pair, point, places)
    dense.lower[m, pair] = desk.runs.lower[local]
    dense.upper[m, pair] = desk.runs.upper[local]
    dense.time[m, pair], dense.verdict[m, pair] = time, verdict
    dense.own[m, pair], dense.other[m, pair] = places[:3], places[3:]


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
    best, point = results.best[pair], witness.points[3:]
    if upper < best[UP]:
        best[UP], best[AT_UPPER], best[TIME] = upper, k, time
        best[OTHER:] = point
    if results.dense.verdict.shape[0] > 0:
        row[START] = row[END] = time
        bound_between(task, motion, desk.ends, desk.space, row)
        _dense_row(task, desk, results, m, local, pair, verdict, time, point)
    desk.planes[pair, SUPPORT] = -np.inf
    return verdict


@compiled
def _dense_stretch(
    task: Task,
    desk: Desk,
    results: Results,
    pair: int,
    offset: int,
    first: int,
    last: int,
) -> None:
    """Write intervals that one plane and witness bound to the dense results."""
    apart()
    at_rows, point = desk.runs.at_rows, desk.planes[pair, POINT:WIDTH]
    for r in range(first, last):
        later = 1 if at_rows[r + 1] < at_rows[r] else 0
        _take_rows(desk.rows, r + later, r + later, desk.ends)
        _dense_row(
            task, desk, results, offset + r, r, pair, CERTIFIED, float(later), point
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
    """All intervals of a block for one pair; False where `hasty` and one is not proved.

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
    link, frame = task.pairs.link[pair], task.pairs.frame[pair]
    required, group = task.pairs.required[pair], group_of(frame)
    counts, best, limit = results.counts[pair], results.best[pair], results.limit
    nominal, dense = is_nominal(rules), results.dense.verdict.shape[0] > 0
    goal = rules.goal if closely else max(rules.goal, ROUGH * rules.slack * required)
    slack = np.inf if hasty else rules.slack
    local, stretch, fresh, proved = 0, count, False, -np.inf
    while True:
        last, bar = min(count, local + stretch), required
        if closely:
            bar = max(bar, limit[group] - rules.gap)
        done = coast(
            rules, rows, runs, plane, link, frame, local, last, bar, slack, fresh
        )
        if fresh and done == local:
            # This interval allows no more, and may be proved nevertheless.
            runs.lower[local] = max(runs.lower[local], proved)
            done += runs.lower[local] >= required
        if done > local:
            counts[CERTIFIED] += done - local
            point = plane[POINT:WIDTH]
            note_upper(best, runs.upper, runs.at_rows, point, start, local, done)
            if nominal:
                limit[group] = min(limit[group], best[UP])
            if dense:
                _dense_stretch(task, desk, results, pair, offset, local, done)
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
        proved = _renew(task, desk, results, local, pair, goal)
        if not (nominal or hasty):
            _look_at_row(task, desk, results, local, pair)
        fresh, stretch = True, STRETCH


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
    """Judge the intervals [first, last); False where `hasty` and one is not proved.

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
    limit, steady = results.limit, np.zeros(2, np.bool_)
    before = limit.copy()
    for start in range(first, last, BLOCK):
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
