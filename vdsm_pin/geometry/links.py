"""Clearance of every link at given configurations, in compiled code."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import Body, new_body
from vdsm_pin.geometry.kernels import LOWER, NORMAL
from vdsm_pin.geometry.mesh_insides import encloses, has_inside
from vdsm_pin.geometry.obstacles import (
    Measuring,
    new_measuring,
    obstacle_bracket,
)
from vdsm_pin.geometry.pieces import PackedPieces


class _Work(NamedTuple):
    """Working space of distances.

    Args:
        body: A link.
        boxes: Low and high corners of the obstacles' boxes, (n_obstacles, 2, 3); [m].
        far: Of these from the link's, squared, shape (n_obstacles,); [m^2].
        measuring: Of one obstacle.
        normals: The last n of each obstacle and link, shape (n_obstacles, N, 3); [-].
    """

    body: Body
    boxes: FloatArray
    far: FloatArray
    measuring: Measuring
    normals: FloatArray


@compiled
def link_clearances(
    pieces: PackedPieces,
    covers: IntArray,
    centres: FloatArray,
    radius: float,
    pad: float,
    goal: float,
) -> FloatArray:
    """Lower bounds of the clearance for each configuration and link.

    Args:
        pieces: The scene.
        covers: As for `encloses`.
        centres: Joint centres, shape (n_samples, N + 1, 3); [m].
        radius: Radius of the links; [m].
        pad: Bound of all rounding; [m].
        goal: Width of a bracket at which to stop; [m].

    Returns:
        Distance to the nearest obstacle, shape (n_samples, N); [m].
    """
    n_samples, n_links = centres.shape[0], centres.shape[1] - 1
    result = np.full((n_samples, n_links), np.inf)
    count = pieces.root.size
    boxes = np.zeros((count, 2, 3))
    for o in range(count):
        boxes[o, 0] = pieces.node_low[pieces.root[o]]
        boxes[o, 1] = pieces.node_high[pieces.root[o]]
    normals, far = np.ones((count, n_links, 3)), np.zeros(count)
    work = _Work(new_body(2, 2, 0), boxes, far, new_measuring(), normals)
    _measure(pieces, covers, centres, radius + pad, goal, work, result)
    return result


@compiled
def _crosses(a: FloatArray, b: FloatArray, box: FloatArray) -> bool:
    """Whether a segment passes through a box, but for rounding."""
    first, last = 0.0, 1.0
    for c in range(3):
        run = b[c] - a[c]
        low, high = box[0, c] - a[c], box[1, c] - a[c]
        if run == 0.0:
            if low > 0.0 or high < 0.0:
                return False
            continue
        one, two = low / run, high / run
        first, last = max(first, min(one, two)), min(last, max(one, two))
    return first <= last


@compiled
def _first(ends: FloatArray, boxes: FloatArray, far: FloatArray) -> int:
    """Write squared distances of boxes from that of a segment, 0 where they meet.

    Args:
        ends: Of the segment, shape (2, 3); [m].
        boxes: Low and high corners, shape (n, 2, 3); [m].
        far: Result, shape (n,); [m^2].

    Returns:
        The number of one that the segment passes through, else of the nearest one.
    """
    ends, boxes, far = borrowed(ends), borrowed(boxes), borrowed(far)
    a, b = ends[0], ends[1]
    nearest, crossed = 0, False
    for o in range(far.size):
        squared = 0.0
        for c in range(3):
            low, high = min(a[c], b[c]), max(a[c], b[c])
            gap = max(boxes[o, 0, c] - high, low - boxes[o, 1, c], 0.0)
            squared += gap * gap
        far[o] = squared
        if squared == 0.0 and not crossed:
            crossed = _crosses(a, b, boxes[o])
            nearest = o if crossed else nearest
        if not crossed and squared < far[nearest]:
            nearest = o
    return nearest


@compiled(inline=False)
def _measure(
    pieces: PackedPieces,
    covers: IntArray,
    centres: FloatArray,
    off: float,
    goal: float,
    work: _Work,
    result: FloatArray,
) -> None:
    """Write what is left of each distance where `off` is taken off it; [m]."""
    pieces, work = borrowed(pieces), borrowed(work)
    body, far, out = work.body, work.far, work.measuring.out
    for link in range(result.shape[1]):
        for sample in range(result.shape[0]):
            body.points[:] = centres[sample, link : link + 2]
            # What the link passes through or is nearest to settles most of the others.
            best, nearest = np.inf, _first(body.points, work.boxes, far)
            for turn in range(far.size):
                o = nearest if turn == 0 else turn - (turn <= nearest)
                if best <= 0.0 or far[o] >= best * best:
                    continue
                out[NORMAL : NORMAL + 3] = work.normals[o, link]
                obstacle_bracket(pieces, o, body, goal, work.measuring)
                work.normals[o, link] = out[NORMAL : NORMAL + 3]
                gap = out[LOWER]
                # Asked first: a call with the whole scene costs more than a link.
                if gap > 0.0 and has_inside(pieces, covers, o):
                    gap = -gap if encloses(pieces, covers, o, body.points[0]) else gap
                best = min(best, gap)
            result[sample, link] = best - off
