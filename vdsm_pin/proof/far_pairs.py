"""Pairs that a broad phase found far: what is kept of them, and told of them."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.proof.layouts import AT_LOWER, AT_UPPER, LOW, OTHER, OWN, TIME, UP
from vdsm_pin.proof.motions import Motion, interpolate
from vdsm_pin.proof.packed_tree import place_two
from vdsm_pin.proof.results import Dense, Results
from vdsm_pin.proof.row_places import seen
from vdsm_pin.proof.rows import Rows
from vdsm_pin.proof.swept_bodies import Ends, place_point
from vdsm_pin.proof.terms import CERTIFIED, WORLD, Task


class BroadPhase(NamedTuple):
    """The obstacles as the broad phase sees them, its space, and what it settled.

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
        trial: Lower and upper bounds of some intervals, shape (2, n_obstacles); [m].
        when: Intervals of one body's bounds: of `trial`, of `gap` and of `reach`, shape
            (3, n_obstacles).
        far: Which pairs are far, the same shape.
        near: The pairs that are not, in no order, shape (n_pairs,).
        lower: Least lower bounds of far pairs, shape (n_bodies, n_obstacles); [m].
        upper: Least upper bounds, the same shape; [m].
        at_lower: Intervals of the former, the same shape.
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
    trial: FloatArray
    when: IntArray
    far: BoolArray
    near: IntArray
    lower: FloatArray
    upper: FloatArray
    at_lower: IntArray
    at_upper: IntArray
    settled: IntArray
    least: FloatArray


@compiled(inline=False)
def new_broad_phase(task: Task, n_obstacles: int) -> BroadPhase:
    """Nothing settled yet; the first obstacles of the packed scene are looked at."""
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
        np.zeros((2, n)),
        np.zeros((3, n), np.int64),
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
def keep_least(
    values: FloatArray, when: IntArray, least: FloatArray, at: IntArray
) -> None:
    """Keep the least values met and the intervals they were met at."""
    for o in range(values.size):
        at[o] = when[o] if values[o] < least[o] else at[o]
    for o in range(values.size):
        least[o] = values[o] if values[o] < least[o] else least[o]


@compiled(inline=False)
def dense_far(
    task: Task, dense: Dense, rows: Rows, broad: BroadPhase, offset: int, count: int
) -> None:
    """Dense rows of the far pairs; witnesses are the obstacle's point and a corner."""
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


@compiled(inline=False)
def profile_far(
    task: Task, results: Results, broad: BroadPhase, start: int, count: int
) -> None:
    """Lower the profile's bins of a block to the least bounds of its far pairs."""
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


@compiled(inline=False)
def merge_far(
    task: Task, motion: Motion, ends: Ends, results: Results, broad: BroadPhase
) -> None:
    """Bring what was settled to the counts and best rows of the pairs.

    Args:
        task: The bodies and pairs.
        motion: Rows of joint values.
        ends: Working space.
        results: Where to write.
        broad: What was settled.
    """
    at = np.zeros(3)
    n_bodies, n_obstacles = broad.number.shape
    for body in range(n_bodies):
        frame, corner = task.bodies.frame[body], task.bodies.first[body]
        own, grown = task.bodies.corners[corner], task.bodies.radius[body]
        for o in range(n_obstacles):
            pair = broad.number[body, o]
            if pair < 0 or broad.settled[body, o] == 0:
                continue
            best = results.best[pair]
            results.counts[pair, CERTIFIED] += broad.settled[body, o]
            if broad.lower[body, o] < best[LOW]:
                best[LOW] = broad.lower[body, o]
                best[AT_LOWER] = broad.at_lower[body, o]
            if not broad.upper[body, o] < best[UP]:
                continue
            interpolate(motion, broad.at_upper[body, o], 0.0, ends.q)
            place_two(task.tree, ends.q, (frame, WORLD), ends.bends.steps, ends.start)
            place_point(ends.start, frame, own, at)
            squared = 0.0
            for c in range(3):
                squared += (broad.point[c, o] - at[c]) ** 2
                best[OWN + c], best[OTHER + c] = own[c], broad.point[c, o]
            best[UP] = sqrt(squared) - grown + task.rules.pad
            best[AT_UPPER], best[TIME] = broad.at_upper[body, o], 0.0
