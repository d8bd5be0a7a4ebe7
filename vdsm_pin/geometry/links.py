"""Clearance of every link at given configurations, in compiled code."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.geometry.kernels import BRACKET, LOWER, NORMAL, SCRATCH_ROWS
from vdsm_pin.geometry.obstacles import (
    STACK,
    box_distance,
    box_of,
    crossings,
    obstacle_bracket,
)
from vdsm_pin.geometry.pieces import PackedPieces


@compiled
def _inside(pieces: PackedPieces, obstacle: int, point: FloatArray) -> bool:
    root = pieces.root[obstacle]
    for c in range(3):
        if not pieces.node_low[root, c] <= point[c] <= pieces.node_high[root, c]:
            return False
    return crossings(pieces, obstacle, point[0], point[1], point[2]) % 2 == 1


@compiled
def link_clearances(
    pieces: PackedPieces,
    closed: FloatArray,
    centres: FloatArray,
    radius: float,
    pad: float,
    goal: float,
) -> FloatArray:
    """Lower bounds of the clearance for each configuration and link.

    Args:
        pieces: The scene.
        closed: 1 where an obstacle is a mesh with an inside, shape (n_obstacles,).
        centres: Joint centres, shape (n_samples, N + 1, 3); [m].
        radius: Radius of the links; [m].
        pad: Bound of all rounding; [m].
        goal: Width of a bracket at which to stop; [m].

    Returns:
        Distance to the nearest obstacle, shape (n_samples, N); [m].
    """
    n_samples, n_links = centres.shape[0], centres.shape[1] - 1
    n_obstacles = pieces.root.size
    result = np.full((n_samples, n_links), np.inf)
    scratch = np.zeros((SCRATCH_ROWS + 2, 3))
    box, body = np.zeros((2, 3)), new_body(2, 0)
    stack = np.zeros(STACK, np.int64)
    trial, out = np.zeros(BRACKET + 4), np.zeros(BRACKET + 4)
    normals = np.ones((n_obstacles, n_links, 3))
    for link in range(n_links):
        for sample in range(n_samples):
            body.points[:] = centres[sample, link : link + 2]
            box_of(body.points, box[0], box[1])
            best = np.inf
            for o in range(n_obstacles):
                if box_distance(pieces, pieces.root[o], box[0], box[1]) >= best:
                    continue
                out[NORMAL : NORMAL + 3] = normals[o, link]
                obstacle_bracket(pieces, o, body, goal, scratch, stack, trial, out)
                normals[o, link] = out[NORMAL : NORMAL + 3]
                gap = out[LOWER]
                if closed[o] > 0.0 and gap > 0.0 and _inside(pieces, o, body.points[0]):
                    gap = -gap
                best = min(best, gap)
            result[sample, link] = best - radius - pad
    return result
