"""Boxes over a block of intervals settle the pairs that are far, in compiled code.

A pair is far where the distance of the boxes exceeds the required clearance, the
least clearance met so far, and the distance of the link's nearest obstacle: then no
narrower bracket could change what is reported.
"""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.bodies import Body, new_body
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.geometry.kernels import NORMAL, UPPER
from vdsm_pin.geometry.obstacles import obstacle_bracket
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.proof.boxes import box_gaps, box_reaches, link_box
from vdsm_pin.proof.results import Dense, Results
from vdsm_pin.proof.rows import Rows
from vdsm_pin.proof.slices import Space
from vdsm_pin.proof.terms import (
    BASE,
    CERTIFIED,
    OBSTACLES,
    Task,
    is_nominal,
    losses,
)

FEW: Final = 8
"""Up to so many obstacles nothing is culled and every bracket is narrow."""


class Culling(NamedTuple):
    """The obstacles as culling sees them, its working space, and what it settled.

    Args:
        box: Lower and upper corner of every obstacle's box, shape (2, 3, n_obstacles);
            [m].
        point: A point of every obstacle, shape (3, n_obstacles); [m].
        gap: Lower bounds of a block, shape (N, n_obstacles); [m].
        reach: Upper bounds of a block, inf where not far, the same shape; [m].
        far: Which pairs are far, the same shape.
        near: The pairs that are not, in no order, shape (n_pairs,).
        lower: Least lower bounds of far pairs, shape (N, n_obstacles); [m].
        upper: Least upper bounds, the same shape; [m].
        at_lower: First interval of the block of the former, the same shape.
        at_upper: Of the latter, the same shape.
        settled: Intervals in which a pair was far, the same shape.
        least: Least lower and upper bounds by obstacle, shape (2, n_obstacles); [m].
    """

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
def new_culling(
    pieces: PackedPieces, n_links: int, n_obstacles: int, n_pairs: int
) -> Culling:
    """Nothing settled yet; the obstacles are the first ones of the packed scene."""
    n, shape = n_obstacles, (n_links, n_obstacles)
    box, point = np.zeros((2, 3, n)), np.zeros((3, n))
    for o in range(n):
        root, first = pieces.root[o], pieces.first_piece[o]
        for c in range(3):
            box[0, c, o] = pieces.node_low[root, c]
            box[1, c, o] = pieces.node_high[root, c]
            point[c, o] = pieces.centre[first, c]
    return Culling(
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
def _nearest_upper(
    task: Task, rows: Rows, space: Space, body: Body, link: int, obstacle: int
) -> float:
    """Upper bound of the clearance of a link and an obstacle at a block's first row."""
    apart()
    for k in range(2):
        for c in range(3):
            body.points[k, c] = rows.centres[0, link + k, c, 0]
    space.out[NORMAL : NORMAL + 3] = 1.0
    obstacle_bracket(
        task.pieces,
        obstacle,
        body,
        task.rules.goal,
        space.scratch,
        space.nodes,
        space.trial,
        space.out,
    )
    return float(space.out[UPPER] - task.rules.radius + task.rules.pad)


@compiled
def _settle_link(
    task: Task, results: Results, culling: Culling, link: int, upper: float, n_near: int
) -> int:
    """Tell which obstacles are far from a link; adds the near ones, their number.

    Args:
        task: The scene, pairs and rules.
        results: For the least clearance met.
        culling: `gap` of the link is read, `far` written.
        link: The link.
        upper: Upper bound of the distance of its nearest obstacle; [m].
        n_near: Near pairs so far.
    """
    apart()
    n_links = culling.gap.shape[0]
    threshold = max(task.pairs.required[0], upper, results.limit[OBSTACLES])
    gap, far = culling.gap[link], culling.far[link]
    for o in range(gap.size):
        far[o] = gap[o] >= threshold
    for o in range(gap.size):
        if not far[o]:
            culling.near[n_near] = o * n_links + link
            n_near += 1
            gap[o] = np.inf
    return n_near


@compiled
def _dense_far(
    task: Task, dense: Dense, rows: Rows, culling: Culling, offset: int, count: int
) -> None:
    """Dense rows of the far pairs; witnesses are the obstacle's point and a cap's."""
    apart()
    n_links, n_obstacles = culling.far.shape
    for o in range(n_obstacles):
        for link in range(n_links):
            if not culling.far[link, o]:
                continue
            pair = o * n_links + link
            for local in range(count):
                m, squared = offset + local, 0.0
                for c in range(3):
                    d = culling.point[c, o] - rows.centres[0, link, c, local]
                    squared += d * d
                gap = sqrt(squared)
                share = task.rules.radius / gap if gap > 0.0 else 0.0
                for c in range(3):
                    at = rows.centres[0, link, c, local]
                    dense.own[m, pair, c] = at + share * (culling.point[c, o] - at)
                    dense.other[m, pair, c] = culling.point[c, o]
                dense.lower[m, pair] = culling.gap[link, o]
                dense.upper[m, pair] = gap - task.rules.radius + task.rules.pad
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
def _profile_far(results: Results, culling: Culling, start: int, count: int) -> None:
    """Lower the profile's bins of a block to the least bounds of its far pairs."""
    apart()
    n_links, n_obstacles = culling.far.shape
    profile, stride = results.profile, results.stride
    culling.least[:] = np.inf
    for link in range(n_links):
        low = high = np.inf
        for side in range(2):
            values = culling.gap[link] if side == 0 else culling.reach[link]
            least = culling.least[side]
            for o in range(n_obstacles):
                least[o] = values[o] if values[o] < least[o] else least[o]
            for o in range(n_obstacles):
                if side == 0:
                    low = min(low, values[o])
                else:
                    high = min(high, values[o])
        _lower_profile(profile, stride, link, low, high, start, count)
    for o in range(n_obstacles):
        low, high = culling.least[0, o], culling.least[1, o]
        if low < np.inf:
            _lower_profile(profile, stride, n_links + o, low, high, start, count)


@compiled
def cull(
    task: Task,
    rows: Rows,
    space: Space,
    results: Results,
    culling: Culling,
    start: int,
    offset: int,
    count: int,
) -> int:
    """Record the pairs that are far over a block and list the others.

    Args:
        task: The scene, pairs and rules.
        rows: The block.
        space: Working space.
        results: Where to write.
        culling: Where to write; `near` lists the pairs that need a closer look.
        start: First interval of the block.
        offset: Its row in the dense results.
        count: Intervals in the block.

    Returns:
        The number of near pairs.
    """
    apart()
    n_links, n_obstacles = culling.gap.shape
    if n_obstacles <= FEW:
        return culling.near.size
    rules, n_near = task.rules, 0
    lost, rise = losses(rules, BASE), rules.pad - rules.radius
    low, high, body = np.zeros(3), np.zeros(3), new_body(2, 0)
    for link in range(n_links):
        gap, reach = culling.gap[link], culling.reach[link]
        link_box(rules, rows, count, link, low, high)
        box_gaps(culling.box, low, high, lost, gap)
        upper = _nearest_upper(task, rows, space, body, link, int(np.argmin(gap)))
        if is_nominal(rules):
            results.limit[OBSTACLES] = min(results.limit[OBSTACLES], upper)
        n_near = _settle_link(task, results, culling, link, upper, n_near)
        far, settled = culling.far[link], culling.settled[link]
        box_reaches(culling.point, low, high, rise, far, reach)
        for o in range(n_obstacles):
            settled[o] += count if far[o] else 0
        _keep_least(gap, culling.lower[link], culling.at_lower[link], start)
        _keep_least(reach, culling.upper[link], culling.at_upper[link], start)
    for pair in range(n_links * n_obstacles, task.pairs.link.size):
        culling.near[n_near] = pair
        n_near += 1
    _profile_far(results, culling, start, count)
    if results.dense.verdict.shape[0] > 0:
        _dense_far(task, results.dense, rows, culling, offset, count)
    return n_near
