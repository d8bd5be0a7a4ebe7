"""Distances of links at single rows: coarse bounds for all, brackets for some.

The coarse bound covers a link with balls and an obstacle with its box, some ten
nanoseconds a link; the bracket is the tight one.
"""

from math import sqrt
from typing import Final

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.kernels import LOWER, UPPER
from vdsm_pin.geometry.obstacles import new_measuring, obstacle_bracket
from vdsm_pin.geometry.pieces import HALF_SPACE, PackedPieces

BALLS: Final = 8
"""Balls along a link; the coarse bound is loose by a sixteenth of its length."""


@compiled
def _box_gap(pieces: PackedPieces, o: int, x: float, y: float, z: float) -> float:
    """Distance from a point to an obstacle's box or half-space; [m]."""
    first, root = pieces.first_piece[o], pieces.root[o]
    if pieces.kind[first] == HALF_SPACE:
        n = pieces.axis[first]
        return float(n[0] * x + n[1] * y + n[2] * z - pieces.extent[first])
    low, high = pieces.node_low[root], pieces.node_high[root]
    dx = max(low[0] - x, x - high[0], 0.0)
    dy = max(low[1] - y, y - high[1], 0.0)
    dz = max(low[2] - z, z - high[2], 0.0)
    return sqrt(dx * dx + dy * dy + dz * dz)


@compiled
def coarse_bounds(
    pieces: PackedPieces, centres: FloatArray, radii: FloatArray
) -> FloatArray:
    """Lower bounds of the clearance of every link from every obstacle.

    Args:
        pieces: The scene.
        centres: Joint centres, shape (n_samples, N + 1, 3); [m].
        radii: Of the links, shape (N,); [m].

    Returns:
        Shape (n_samples, N, n_obstacles); [m].
    """
    pieces, centres, radii = borrowed(pieces), borrowed(centres), borrowed(radii)
    n_samples, n_links, n_obstacles = (
        centres.shape[0],
        centres.shape[1] - 1,
        pieces.root.size,
    )
    bounds = np.full((n_samples, n_links, n_obstacles), np.inf)
    for k in range(n_samples):
        for i in range(n_links):
            start, end = centres[k, i], centres[k, i + 1]
            dx, dy, dz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
            ball = radii[i] + 0.5 * sqrt(dx * dx + dy * dy + dz * dz) / BALLS
            for o in range(n_obstacles):
                for b in range(BALLS):
                    t = (b + 0.5) / BALLS
                    x, y, z = start[0] + t * dx, start[1] + t * dy, start[2] + t * dz
                    gap = _box_gap(pieces, o, x, y, z) - ball
                    bounds[k, i, o] = min(bounds[k, i, o], gap)
    return bounds


@compiled
def row_brackets(
    pieces: PackedPieces, ends: FloatArray, obstacle: IntArray, goal: float
) -> FloatArray:
    """Brackets of the distance between segments and obstacles.

    Args:
        pieces: The scene.
        ends: End points of the segments, shape (m, 2, 3); [m].
        obstacle: The obstacle each is held against, shape (m,).
        goal: Width of a bracket at which to stop; [m].

    Returns:
        Lower and upper bounds, shape (m, 2); of a mesh's surface, inside or out; below
        zero only the sign is meant; [m].
    """
    pieces = borrowed(pieces)
    bounds = np.zeros((obstacle.size, 2))
    body, work = new_body(2, 2, 0), new_measuring()
    for m in range(obstacle.size):
        body.points[:] = ends[m]
        obstacle_bracket(pieces, obstacle[m], body, goal, work)
        bounds[m, 0], bounds[m, 1] = work.out[LOWER], work.out[UPPER]
    return bounds


@compiled
def _point_gap(point: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """Squared distance from a point to a segment; [m^2]."""
    along = span = 0.0
    for c in range(3):
        along += (point[c] - start[c]) * (end[c] - start[c])
        span += (end[c] - start[c]) ** 2
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    square = 0.0
    for c in range(3):
        square += (start[c] + t * (end[c] - start[c]) - point[c]) ** 2
    return square


@compiled
def _crossing_gap(p: FloatArray, q: FloatArray, r: FloatArray, s: FloatArray) -> float:
    """Squared distance of two segments where both inner parts are nearest, or inf."""
    aa = bb = ab = ac = bc = 0.0
    for k in range(3):
        a, b, c = q[k] - p[k], s[k] - r[k], p[k] - r[k]
        aa, bb, ab = aa + a * a, bb + b * b, ab + a * b
        ac, bc = ac + a * c, bc + b * c
    det = aa * bb - ab * ab
    if not det > 0.0:
        return np.inf
    t, u = (ab * bc - bb * ac) / det, (aa * bc - ab * ac) / det
    if not (0.0 < t < 1.0 and 0.0 < u < 1.0):
        return np.inf
    square = 0.0
    for k in range(3):
        gap = p[k] + t * (q[k] - p[k]) - r[k] - u * (s[k] - r[k])
        square += gap * gap
    return square


@compiled
def link_gaps(centres: FloatArray, radii: FloatArray) -> FloatArray:
    """Clearance between links two or more apart, in closed form.

    The squared distance of two segments is convex, so it is least in the inside of both
    or at an end of one. Every candidate is the distance of two points of the links:
    where links are almost parallel and the first is inexact, the others are not.

    Args:
        centres: Joint centres, shape (n_samples, N + 1, 3); [m].
        radii: Of the links, shape (N,); [m].

    Returns:
        Shape (n_samples, N, N), for links i and k >= i + 2 counted from 0; the others
        are inf; negative where they meet; [m].
    """
    centres, radii = borrowed(centres), borrowed(radii)
    n_samples, n_links = centres.shape[0], centres.shape[1] - 1
    gaps = np.full((n_samples, n_links, n_links), np.inf)
    for m in range(n_samples):
        for i in range(n_links):
            p, q = centres[m, i], centres[m, i + 1]
            for k in range(i + 2, n_links):
                r, s = centres[m, k], centres[m, k + 1]
                square = min(
                    _crossing_gap(p, q, r, s),
                    _point_gap(p, r, s),
                    _point_gap(q, r, s),
                    _point_gap(r, p, q),
                    _point_gap(s, p, q),
                )
                gaps[m, i, k] = sqrt(square) - (radii[i] + radii[k])
    return gaps
