"""Boxes over a block of intervals settle the pairs that are far, in compiled code.

A pair is far where the distance of the boxes exceeds the required clearance, the
least clearance met so far, and the distance of the link's nearest obstacle: then no
narrower bracket could change what is reported.
"""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import second_order
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.compiled import compiled
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
def _farthest(box: FloatArray, centre: FloatArray) -> float:
    """Largest distance of a point from a box's points; [m]."""
    squared = 0.0
    for c in range(3):
        squared += max(centre[c] - box[0, c], box[1, c] - centre[c]) ** 2
    return sqrt(squared)


@compiled
def _note_far(
    task: Task,
    desk: Desk,
    results: Results,
    start: int,
    count: int,
    offset: int,
    pair: int,
    lower: float,
    upper: float,
) -> None:
    """Record one pair as far over a whole block; both bounds hold at any time in it."""
    link, obstacle = task.pairs.link[pair], task.pairs.obstacle[pair]
    centre = task.pieces.centre[task.pieces.first_piece[obstacle]]
    best = results.best[pair]
    results.counts[pair, CERTIFIED] += count
    if lower < best[KEY]:
        best[KEY], best[AT_LOWER] = lower, start
    if upper < best[UP]:
        best[UP], best[AT_UPPER], best[TIME] = upper, start, 0.0
        _own_point(task, desk.rows.centres[0, link], centre, best[OWN:OTHER])
        best[OTHER : OTHER + 3] = centre
    if results.verdicts.shape[0] > 0:
        for local in range(count):
            row = results.numbers[offset + local, pair]
            row[0], row[1], row[2] = lower, upper, 0.0
            _own_point(task, desk.rows.centres[local, link], centre, row[3:6])
            row[6:9] = centre
            results.verdicts[offset + local, pair] = CERTIFIED


@compiled
def _own_point(task: Task, at: FloatArray, centre: FloatArray, out: FloatArray) -> None:
    """The surface point of a link's cap that faces a point, shape (3,); [m]."""
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
    rules, n_links = task.rules, task.rules.lengths.size
    boxes = np.zeros((n_links, 2, 3))
    bounds = np.zeros((n_obstacles + 1, n_links))
    least = np.full((2, n_links + n_obstacles), np.inf)
    _link_boxes(rules, desk.rows, count, boxes)
    nominal = rules.joint_error + rules.base_error + rules.obstacle_error == 0.0
    _lower_bounds(task, desk, results, boxes, bounds, nominal)
    for o in range(n_obstacles):
        centre = task.pieces.centre[task.pieces.first_piece[o]]
        for link in range(n_links):
            pair, lower = o * n_links + link, bounds[o, link]
            threshold = max(bounds[n_obstacles, link], results.limit[0])
            near[pair] = not lower >= threshold
            if not near[pair]:
                upper = _farthest(boxes[link], centre) - rules.radius + rules.pad
                _note_far(task, desk, results, start, count, offset, pair, lower, upper)
                for column in (link, n_links + o):
                    least[0, column] = min(least[0, column], lower)
                    least[1, column] = min(least[1, column], upper)
    last_bin = (start + count - 1) // results.stride
    for bin_ in range(start // results.stride, last_bin + 1):
        for side in range(2):
            for column in range(n_links + n_obstacles):
                value = least[side, column]
                if value < results.profile[bin_, side, column]:
                    results.profile[bin_, side, column] = value
