"""Convex bodies: the hull of a few points, each grown by a zonotope and a ball.

A link at rest is the hull of two points. Over a slice of a motion and a box of errors
either end of its axis sweeps a region: a zonotope, since each error moves it along a
direction of its own, and a ball for what is bounded by its length alone.
"""

from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import apart, compiled


class Body(NamedTuple):
    """A convex body. Point k is grown like end k % 2 of a link's axis.

    Args:
        points: Shape (n_points, 3); [m].
        swings: Generators of the zonotopes of both ends, shape (2, room, 3): the end
            moves by any sum of them, each times a number between -1 and 1; [m].
        sizes: How many generators there are, shape (2,).
        balls: Radii of the balls, shape (2,); [m].
    """

    points: FloatArray
    swings: FloatArray
    sizes: IntArray
    balls: FloatArray


@compiled
def new_body(n_points: int, room: int) -> Body:
    """A body of points in the origin, not grown, with room for so many generators."""
    apart()
    return Body(
        np.zeros((n_points, 3)),
        np.zeros((2, room, 3)),
        np.zeros(2, np.int64),
        np.zeros(2),
    )


@compiled
def _growth(body: Body, end: int, nx: float, ny: float, nz: float) -> float:
    """Largest n.x over the zonotope and ball of an end, n of unit length; [m]."""
    g, total = body.swings, body.balls[end]
    for k in range(body.sizes[end]):
        total += abs(nx * g[end, k, 0] + ny * g[end, k, 1] + nz * g[end, k, 2])
    return float(total)


@compiled
def body_reach(body: Body, nx: float, ny: float, nz: float) -> float:
    """Largest n.x over a body, n of unit length; [m]."""
    p, reach = body.points, -np.inf
    for end in range(2):
        grown = _growth(body, end, nx, ny, nz)
        for k in range(end, p.shape[0], 2):
            reach = max(reach, nx * p[k, 0] + ny * p[k, 1] + nz * p[k, 2] + grown)
    return reach


@compiled
def body_support(
    body: Body, nx: float, ny: float, nz: float, point: FloatArray
) -> float:
    """Largest n.x over a body, n of unit length, and a point it is taken at.

    Args:
        body: The body.
        nx: Direction n, of unit length.
        ny: The same.
        nz: The same.
        point: Where the largest value is taken, written, shape (3,); [m].

    Returns:
        The largest value; [m].
    """
    p, g = body.points, body.swings
    first, second = _growth(body, 0, nx, ny, nz), _growth(body, 1, nx, ny, nz)
    best, at = -np.inf, 0
    for k in range(p.shape[0]):
        value = nx * p[k, 0] + ny * p[k, 1] + nz * p[k, 2]
        value += second if k % 2 else first
        if value > best:
            best, at = value, k
    end = at % 2
    ball = body.balls[end]
    x, y, z = p[at, 0] + ball * nx, p[at, 1] + ball * ny, p[at, 2] + ball * nz
    for k in range(body.sizes[end]):
        along = nx * g[end, k, 0] + ny * g[end, k, 1] + nz * g[end, k, 2]
        side = 1.0 if along >= 0.0 else -1.0
        x, y, z = (
            x + side * g[end, k, 0],
            y + side * g[end, k, 1],
            z + side * g[end, k, 2],
        )
    point[0], point[1], point[2] = x, y, z
    return best
