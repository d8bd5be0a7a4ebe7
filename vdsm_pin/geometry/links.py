"""Clearance of every link at given configurations, in compiled code."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import apart, borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import Body, new_body
from vdsm_pin.geometry.kernels import LOWER, NORMAL
from vdsm_pin.geometry.mesh_insides import encloses, has_inside
from vdsm_pin.geometry.obstacles import (
    Measuring,
    box_distance,
    box_of,
    new_measuring,
    obstacle_bracket,
)
from vdsm_pin.geometry.pieces import PackedPieces


class _Work(NamedTuple):
    """Working space of distances, and the last n of each obstacle and link."""

    body: Body
    box: FloatArray
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
    normals = np.ones((pieces.root.size, n_links, 3))
    work = _Work(new_body(2, 2, 0), np.zeros((2, 3)), new_measuring(), normals)
    _measure(pieces, covers, centres, radius + pad, goal, work, result)
    return result


@compiled
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
    apart()
    pieces, work = borrowed(pieces), borrowed(work)
    body, box, out = work.body, work.box, work.measuring.out
    for link in range(result.shape[1]):
        for sample in range(result.shape[0]):
            body.points[:] = centres[sample, link : link + 2]
            box_of(body, box[0], box[1])
            best = np.inf
            for o in range(pieces.root.size):
                if box_distance(pieces, pieces.root[o], box[0], box[1]) >= best:
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
