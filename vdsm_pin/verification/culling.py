"""Boxes over a block of intervals settle the pairs that are far, in compiled code.

A pair is far where the distance of the boxes exceeds the required clearance, the
least clearance met so far, and the distance of the link's nearest obstacle: then no
narrower bracket could change what is reported.
"""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import second_order
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.geometry.kernels import NORMAL, UPPER
from vdsm_pin.geometry.obstacles import box_distance, obstacle_bracket
from vdsm_pin.verification.search import CERTIFIED, KEY, Task
from vdsm_pin.verification.slices import Rules, losses
from vdsm_pin.verification.sweep import (
    AT_LOWER,
    AT_UPPER,
    OTHER,
    OWN,
    TIME,
    UP,
    Desk,
    Results,
    Rows,
)


@compiled
def _growth(rules: Rules, rows: Rows, count: int, joint: int) -> float:
    """How far O_joint may leave the box of its rows: bend and error box; [m]."""
    bend = drift = 0.0
    for r in range(count):
        bend = max(bend, rows.bends[r, 0, joint])
        drift = max(drift, rows.drifts[r, 0, joint])
    swing = behind = 0.0
    for link in range(joint - 1, -1, -1):
        behind += rules.lengths[link]
        swing += 2.0 * behind
    error = rules.joint_error * (swing + 0.5 * drift) + rules.base_error
    return (
        error + 0.125 * bend + second_order(rules.lengths, 0, joint, rules.joint_error)
    )


@compiled
def _link_boxes(rules: Rules, rows: Rows, count: int, boxes: FloatArray) -> None:
    """Boxes of the links over a block and the error box, shape (N, 2, 3); [m]."""
    apart()
    for link in range(rules.lengths.size):
        low, high = boxes[link, 0], boxes[link, 1]
        low[:], high[:] = np.inf, -np.inf
        for joint in (link, link + 1):
            grown = _growth(rules, rows, count, joint)
            for r in range(count + 1):
                for c in range(3):
                    low[c] = min(low[c], rows.centres[r, joint, c] - grown)
                    high[c] = max(high[c], rows.centres[r, joint, c] + grown)


@compiled
def _nearest_upper(task: Task, desk: Desk, link: int, obstacle: int) -> float:
    """Upper bound of the clearance of a link and an obstacle at a block's first row."""
    apart()
    space, points = desk.space, desk.rows.centres[0, link : link + 2]
    space.out[NORMAL : NORMAL + 3] = 1.0
    obstacle_bracket(
        task.pieces,
        obstacle,
        points,
        2,
        task.rules.goal,
        space.scratch,
        space.stack,
        space.trial,
        space.out,
    )
    return float(space.out[UPPER] - task.rules.radius + task.rules.pad)


@compiled
def _settle(
    centres: FloatArray,
    first_piece: IntArray,
    boxes: FloatArray,
    bounds: FloatArray,
    rise: float,
    best: FloatArray,
    counts: IntArray,
    least: FloatArray,
    near: BoolArray,
    start: int,
    count: int,
) -> None:
    """Record all far pairs over a block: bare arrays, since there are millions.

    Args:
        centres: A point of every piece, shape (n_pieces, 3); [m].
        first_piece: Where an obstacle's pieces start.
        boxes: Boxes of the links, shape (N, 2, 3); [m].
        bounds: Lower bounds, the last row the thresholds, (n_obstacles + 1, N); [m].
        rise: What turns a core distance into an upper bound; [m].
        best: Least bounds of each pair, updated, shape (n_pairs, BEST).
        counts: Intervals of each pair by verdict, updated, shape (n_pairs, 3).
        least: Least bounds by link, then by obstacle, (2, N + n_obstacles); [m].
        near: Result: which pairs are not far, shape (n_pairs,).
        start: First interval of the block.
        count: Intervals in the block.
    """
    apart()
    n_obstacles, n_links = bounds.shape[0] - 1, bounds.shape[1]
    for o in range(n_obstacles):
        p = first_piece[o]
        for link in range(n_links):
            pair, lower = o * n_links + link, bounds[o, link]
            near[pair] = not lower >= bounds[n_obstacles, link]
            if near[pair]:
                continue
            squared = 0.0
            for c in range(3):
                down = centres[p, c] - boxes[link, 0, c]
                squared += max(down, boxes[link, 1, c] - centres[p, c]) ** 2
            upper = sqrt(squared) + rise
            counts[pair, CERTIFIED] += count
            if lower < best[pair, KEY]:
                best[pair, KEY], best[pair, AT_LOWER] = lower, start
            if upper < best[pair, UP]:
                best[pair, UP], best[pair, AT_UPPER] = upper, start
                best[pair, TIME], best[pair, OWN] = 0.0, np.nan
            least[0, link] = min(least[0, link], lower)
            least[1, link] = min(least[1, link], upper)
            least[0, n_links + o] = min(least[0, n_links + o], lower)
            least[1, n_links + o] = min(least[1, n_links + o], upper)


@compiled
def _place_far(
    task: Task,
    desk: Desk,
    results: Results,
    bounds: FloatArray,
    boxes: FloatArray,
    near: BoolArray,
    offset: int,
    count: int,
) -> None:
    """Witnesses of the far pairs, and their dense rows where they are wanted."""
    apart()
    n_obstacles, n_links = bounds.shape[0] - 1, bounds.shape[1]
    dense = results.verdicts.shape[0] > 0
    for pair in range(n_obstacles * n_links):
        fresh = np.isnan(results.best[pair, OWN])
        if near[pair] or not (fresh or dense):
            continue
        link, o = pair % n_links, pair // n_links
        centre = task.pieces.centre[task.pieces.first_piece[o]]
        at = desk.rows.centres[:, link]
        if fresh:
            _own_point(task, at[0], centre, results.best[pair, OWN:OTHER])
            results.best[pair, OTHER : OTHER + 3] = centre
        if not dense:
            continue
        upper = 0.0
        for c in range(3):
            down, up = centre[c] - boxes[link, 0, c], boxes[link, 1, c] - centre[c]
            upper += max(down, up) ** 2
        for local in range(count):
            row = results.numbers[offset + local, pair]
            row[0], row[2] = bounds[o, link], 0.0
            row[1] = sqrt(upper) - task.rules.radius + task.rules.pad
            _own_point(task, at[local], centre, row[3:6])
            row[6:9] = centre
            results.verdicts[offset + local, pair] = CERTIFIED


@compiled
def _own_point(task: Task, at: FloatArray, centre: FloatArray, out: FloatArray) -> None:
    """The surface point of a link's cap that faces a point, shape (3,); [m]."""
    apart()
    squared = 0.0
    for c in range(3):
        squared += (centre[c] - at[c]) ** 2
    gap = sqrt(squared)
    share = task.rules.radius / gap if gap > 0.0 else 0.0
    for c in range(3):
        out[c] = at[c] + share * (centre[c] - at[c])


@compiled
def _lower_bounds(
    task: Task,
    desk: Desk,
    results: Results,
    boxes: FloatArray,
    bounds: FloatArray,
    nominal: bool,
) -> None:
    """Box bounds of every obstacle and link, and below which a pair is near.

    Args:
        task: The scene, pairs and rules.
        desk: Working space, its rows filled.
        results: The least bound met so far is read and, if nominal, improved.
        boxes: Boxes of the links, shape (N, 2, 3); [m].
        bounds: Result, shape (n_obstacles + 1, N); the last row is the threshold; [m].
        nominal: Whether the error box is empty.
    """
    apart()
    n_obstacles = bounds.shape[0] - 1
    lost = losses(task.rules, -1)
    for link in range(boxes.shape[0]):
        nearest = 0
        for o in range(n_obstacles):
            root = task.pieces.root[o]
            gap = box_distance(task.pieces, root, boxes[link, 0], boxes[link, 1])
            bounds[o, link] = gap - lost
            if gap - lost < bounds[nearest, link]:
                nearest = o
        upper = _nearest_upper(task, desk, link, nearest)
        if nominal:
            results.limit[0] = min(results.limit[0], upper)
        bounds[n_obstacles, link] = max(task.pairs.required[0], upper)


@compiled
def cull(
    task: Task,
    desk: Desk,
    results: Results,
    start: int,
    count: int,
    offset: int,
    n_obstacles: int,
    near: BoolArray,
) -> None:
    """Record the pairs that are far over a block and mark the others.

    Args:
        task: The scene, pairs and rules.
        desk: Working space, its rows filled.
        results: Where to write.
        start: First interval of the block.
        count: Intervals in the block.
        offset: Row of `start` in the dense results.
        n_obstacles: Obstacles of the scene.
        near: Result: pairs that need a closer look, shape (n_pairs,).
    """
    apart()
    rules, n_links = task.rules, task.rules.lengths.size
    boxes = np.zeros((n_links, 2, 3))
    bounds = np.zeros((n_obstacles + 1, n_links))
    least = np.full((2, n_links + n_obstacles), np.inf)
    _link_boxes(rules, desk.rows, count, boxes)
    nominal = rules.joint_error + rules.base_error + rules.obstacle_error == 0.0
    _lower_bounds(task, desk, results, boxes, bounds, nominal)
    for link in range(n_links):
        bounds[n_obstacles, link] = max(bounds[n_obstacles, link], results.limit[0])
    rise = rules.pad - rules.radius
    _settle(
        task.pieces.centre,
        task.pieces.first_piece,
        boxes,
        bounds,
        rise,
        results.best,
        results.counts,
        least,
        near,
        start,
        count,
    )
    _place_far(task, desk, results, bounds, boxes, near, offset, count)
    _lower_profile(results.profile, results.stride, least, start, count)


@compiled
def _lower_profile(
    profile: FloatArray, stride: int, least: FloatArray, start: int, count: int
) -> None:
    """Lower the bins of a block to the least bounds of its far pairs."""
    for row in range(start // stride, (start + count - 1) // stride + 1):
        for side in range(2):
            for column in range(least.shape[1]):
                value = least[side, column]
                if value < profile[row, side, column]:
                    profile[row, side, column] = value
