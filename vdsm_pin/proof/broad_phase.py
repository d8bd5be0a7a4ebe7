"""The broad phase: boxes over a block of intervals settle the pairs that are far.

A pair is far where the distance of the boxes exceeds the required clearance, the
least clearance met so far, and the distance of the body's nearest obstacle: then no
narrower bracket could change what is reported.
"""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import apart, borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.kernels import NORMAL, UPPER
from vdsm_pin.geometry.obstacles import obstacle_bracket
from vdsm_pin.proof.boxes import body_box, box_gaps, box_reaches
from vdsm_pin.proof.cached_planes import place_disc
from vdsm_pin.proof.pair_sweep import Stretch
from vdsm_pin.proof.results import Dense, Results
from vdsm_pin.proof.rows import Rows, seen
from vdsm_pin.proof.terms import (
    CERTIFIED,
    OBSTACLES,
    WORLD,
    Task,
    finer,
)
from vdsm_pin.proof.workspace import Workspace, load_rows

FEW: Final = 8
"""Up to so many obstacles nothing is culled and every bracket is narrow."""


class BroadPhase(NamedTuple):
    """The obstacles as broad sees them, its working space, and what it settled.

    Args:
        number: The pair of every body and obstacle, -1 for none, shape (n_bodies,
            n_obstacles).
        some: A pair of each body with one of them, -1 for none, shape (n_bodies,).
        others: All other pairs.
        column: Where the profile has an obstacle's bounds, -1 for nowhere, shape
            (n_obstacles,).
        box: Lower and upper corner of every obstacle's box, shape (2, 3, n_obstacles);
            [m].
        point: A point of every obstacle, shape (3, n_obstacles); [m].
        gap: Lower bounds of a block, inf where not far, shape (n_bodies, n_obstacles);
            [m].
        reach: Upper bounds of a block, inf where not far, the same shape; [m].
        far: Which pairs are far, the same shape.
        near: The pairs that are not, in no order, shape (n_pairs,).
        lower: Least lower bounds of far pairs, shape (n_bodies, n_obstacles); [m].
        upper: Least upper bounds, the same shape; [m].
        at_lower: First interval of the block of the former, the same shape.
        at_upper: Of the latter, the same shape.
        settled: Intervals in which a pair was far, the same shape.
        least: Least lower and upper bounds by obstacle, shape (2, n_obstacles); [m].
    """

    number: IntArray
    some: IntArray
    others: IntArray
    column: IntArray
    box: FloatArray
    point: FloatArray
    gap: FloatArray
    reach: FloatArray
    far: BoolArray
    near: IntArray
    lower: FloatArray
    upper: FloatArray
    at_lower: IntArray
    at_upper: IntArray
    settled: IntArray
    least: FloatArray


@compiled
def new_broad_phase(task: Task, n_obstacles: int) -> BroadPhase:
    """Nothing settled yet; the first obstacles of the packed scene are looked at."""
    apart()
    task = borrowed(task)
    pieces, pairs, ways = task.pieces, task.pairs, task.ways
    n_bodies, n_pairs = task.bodies.frame.size, pairs.rough.shape[0]
    n, shape = n_obstacles, (n_bodies, n_obstacles)
    box, point = np.zeros((2, 3, n)), np.zeros((3, n))
    for o in range(n):
        root, first = pieces.root[o], pieces.first_piece[o]
        for c in range(3):
            box[0, c, o] = pieces.node_low[root, c]
            box[1, c, o] = pieces.node_high[root, c]
            point[c, o] = pieces.centre[first, c]
    number, others = np.full(shape, -1), np.zeros(n_pairs, np.int64)
    some, column = np.full(n_bodies, -1), np.full(n, -1)
    n_others = 0
    for pair in range(n_pairs):
        at_rest = ways.rest[pairs.way[pair]] == WORLD
        if at_rest and pairs.obstacle[pair] < n:
            number[pairs.body[pair], pairs.obstacle[pair]] = pair
            some[pairs.body[pair]] = pair
            column[pairs.obstacle[pair]] = pairs.column[pair]
        else:
            others[n_others] = pair
            n_others += 1
    return BroadPhase(
        number,
        some,
        others[:n_others].copy(),
        column,
        box,
        point,
        np.zeros(shape),
        np.zeros(shape),
        np.zeros(shape, np.bool_),
        np.arange(n_pairs),
        np.full(shape, np.inf),
        np.full(shape, np.inf),
        np.zeros(shape, np.int64),
        np.zeros(shape, np.int64),
        np.zeros(shape, np.int64),
        np.zeros((2, n)),
    )


@compiled
def _keep_least(values: FloatArray, least: FloatArray, at: IntArray, k: int) -> None:
    """Keep the least values met and the intervals they were met at."""
    for o in range(values.size):
        at[o] = k if values[o] < least[o] else at[o]
    for o in range(values.size):
        least[o] = values[o] if values[o] < least[o] else least[o]


@compiled
def _nearest_upper(task: Task, work: Workspace, broad: BroadPhase, body: int) -> float:
    """Upper bound of the clearance of a body and of the obstacle whose box is nearest.

    At the first row of a block; inf for a body without pairs.
    """
    apart()
    pair, least, space = -1, np.inf, work.space
    for o in range(broad.number.shape[1]):
        if broad.number[body, o] >= 0 and broad.gap[body, o] < least:
            pair, least = broad.number[body, o], broad.gap[body, o]
    if pair < 0:
        return np.inf
    pair = finer(task.pairs, pair, pair)
    mover = seen(task, work.rows, pair)
    place_disc(mover, work.rows, work.runs, 1)
    load_rows(task, mover, work, 0, 0)
    space.out[NORMAL : NORMAL + 3] = 1.0
    obstacle_bracket(
        task.pieces,
        task.pairs.obstacle[pair],
        space.core,
        task.rules.goal,
        space.scratch,
        space.nodes,
        space.trial,
        space.out,
    )
    return float(space.out[UPPER] + mover.rise)


@compiled
def _settle_body(
    task: Task,
    results: Results,
    broad: BroadPhase,
    body: int,
    upper: float,
    n_near: int,
) -> int:
    """Tell which obstacles are far from a body; adds the near ones, their number.

    Args:
        task: The scene, pairs and rules.
        results: For the least clearance met.
        broad: `gap` of the body is read, `far` written.
        body: The body.
        upper: Upper bound of the distance of its nearest obstacle; [m].
        n_near: Near pairs so far.
    """
    apart()
    threshold = max(upper, results.limit[OBSTACLES])
    gap, far, number = broad.gap[body], broad.far[body], broad.number[body]
    for o in range(gap.size):
        required = task.pairs.required[max(number[o], 0)]
        far[o] = gap[o] >= max(threshold, required) and number[o] >= 0
    for o in range(gap.size):
        if not far[o]:
            gap[o] = np.inf
            if number[o] >= 0:
                broad.near[n_near] = number[o]
                n_near += 1
    return n_near


@compiled
def _dense_far(
    task: Task, dense: Dense, rows: Rows, broad: BroadPhase, offset: int, count: int
) -> None:
    """Dense rows of the far pairs; witnesses are the obstacle's point and a corner."""
    apart()
    n_bodies, n_obstacles = broad.far.shape
    bodies = task.bodies
    for body in range(n_bodies):
        if broad.some[body] < 0:
            continue
        place = seen(task, rows, broad.some[body]).slots[0]
        at, radius = rows.tracks.places[place], bodies.radius[body]
        for o in range(n_obstacles):
            if not broad.far[body, o]:
                continue
            pair = broad.number[body, o]
            for local in range(count):
                m, squared = offset + local, 0.0
                for c in range(3):
                    squared += (broad.point[c, o] - at[c, local]) ** 2
                gap = sqrt(squared)
                share = radius / gap if gap > 0.0 else 0.0
                for c in range(3):
                    away = broad.point[c, o] - at[c, local]
                    dense.own[m, pair, c] = at[c, local] + share * away
                    dense.other[m, pair, c] = broad.point[c, o]
                dense.lower[m, pair] = broad.gap[body, o]
                dense.upper[m, pair] = gap + task.pairs.rise[pair]
                dense.time[m, pair], dense.verdict[m, pair] = 0.0, CERTIFIED


@compiled
def _lower_profile(
    profile: FloatArray,
    stride: int,
    column: int,
    lower: float,
    upper: float,
    start: int,
    count: int,
) -> None:
    """Lower the bins of a block in one column."""
    first, last = start // stride, (start + count - 1) // stride + 1
    for side in range(2):
        part, value = profile[side, column, first:last], lower if side == 0 else upper
        for k in range(part.size):
            part[k] = part[k] if part[k] < value else value


@compiled
def _profile_far(
    task: Task, results: Results, broad: BroadPhase, start: int, count: int
) -> None:
    """Lower the profile's bins of a block to the least bounds of its far pairs."""
    apart()
    n_bodies, n_obstacles = broad.far.shape
    profile, stride = results.profile, results.stride
    bodies = task.bodies
    broad.least[:] = np.inf
    for body in range(n_bodies):
        low = high = np.inf
        for side in range(2):
            values = broad.gap[body] if side == 0 else broad.reach[body]
            least = broad.least[side]
            for o in range(n_obstacles):
                least[o] = values[o] if values[o] < least[o] else least[o]
            for o in range(n_obstacles):
                if side == 0:
                    low = min(low, values[o])
                else:
                    high = min(high, values[o])
        _lower_profile(profile, stride, bodies.column[body], low, high, start, count)
    for o in range(n_obstacles):
        low, high = broad.least[0, o], broad.least[1, o]
        column = broad.column[o]
        if low < np.inf and column >= 0:
            _lower_profile(profile, stride, column, low, high, start, count)


@compiled
def settle_far(
    task: Task,
    work: Workspace,
    results: Results,
    broad: BroadPhase,
    stretch: Stretch,
) -> int:
    """Record the pairs that are far over a block and list the others.

    Args:
        task: The scene, pairs and rules.
        work: Working space; its rows are filled.
        results: Where to write.
        broad: Where to write; `near` lists the pairs that need a closer look.
        stretch: The block.

    Returns:
        The number of near pairs.
    """
    apart()
    n_bodies, n_obstacles = broad.gap.shape
    if n_obstacles <= FEW:
        return broad.near.size
    rules, rows, n_near = task.rules, work.rows, 0
    start, count = stretch.start, stretch.size
    low, high, lost = np.zeros(3), np.zeros(3), task.pairs.lost
    for body in range(n_bodies):
        gap, reach = broad.gap[body], broad.reach[body]
        if broad.some[body] < 0:
            gap[:] = reach[:] = np.inf
            broad.far[body, :] = False
            continue
        body_box(task, rows, count, broad.some[body], low, high)
        box_gaps(broad.box, low, high, gap)
        radius = task.bodies.radius[body]
        for o in range(n_obstacles):
            pair = broad.number[body, o]
            gap[o] -= lost[pair] if pair >= 0 else 0.0
        upper = _nearest_upper(task, work, broad, body)
        if rules.nominal:
            results.limit[OBSTACLES] = min(results.limit[OBSTACLES], upper)
        n_near = _settle_body(task, results, broad, body, upper, n_near)
        far, settled = broad.far[body], broad.settled[body]
        rise_of = rules.pad - radius
        box_reaches(broad.point, low, high, rise_of, far, reach)
        for o in range(n_obstacles):
            settled[o] += count if far[o] else 0
        _keep_least(gap, broad.lower[body], broad.at_lower[body], start)
        _keep_least(reach, broad.upper[body], broad.at_upper[body], start)
    for pair in broad.others:
        broad.near[n_near] = pair
        n_near += 1
    _profile_far(task, results, broad, start, count)
    if results.dense.verdict.shape[0] > 0:
        _dense_far(task, results.dense, rows, broad, stretch.offset, count)
    return n_near
