"""Convex bodies: the hull of a few points, each grown by a zonotope, a ball and a disc.

A solid at rest is the hull of its corners (the two ends of a link's axis, the eight
corners of a box, the two face centres of a cylinder with the disc between them). Over a
slice of a motion and a box of errors each corner sweeps a region: a zonotope, since
each error moves it along a direction of its own, and a ball for what is bounded by its
length alone.
"""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray

ALIGNED: Final = 1e-14
"""Sine below which a direction counts as that of a disc's or cylinder's axis; [-]."""

RADIUS: Final = 3
"""Layout of a disc: its axis (3) and its radius."""


class Body(NamedTuple):
    """A convex body, in arrays that may have room for more.

    Point k stands for corner k % corners at instant k // corners. Where the arrays of
    what grows corners are of size 0 nothing but discs does.

    Args:
        points: Shape (room, 3); [m].
        swings: Generators of each corner's zonotope, shape (corners, room, 3): it
            moves by any sum of them, each times a number between -1 and 1; [m].
        sizes: How many generators there are, shape (corners,).
        balls: Radii of the balls, shape (corners,); [m].
        discs: Disc that grows every point, at the first and the second instant, shape
            (2, 4): unit axis [-] and radius [m], 0 for none.
        used: Number of points and of corners, shape (2,).
    """

    points: FloatArray
    swings: FloatArray
    sizes: IntArray
    balls: FloatArray
    discs: FloatArray
    used: IntArray


@compiled(inline=False)
def new_body(n_points: int, n_corners: int, room: int) -> Body:
    """A body of points in the origin, not grown, with room for so many generators.

    Without room for one its corners are never grown.
    """
    grown = n_corners if room > 0 else 0
    count = np.zeros(2, np.int64)
    count[0], count[1] = n_points, n_corners
    return Body(
        np.zeros((n_points, 3)),
        np.empty((grown, room, 3)),  # noqa: TID251 (read where `sizes` says so)
        np.zeros(grown, np.int64),
        np.zeros(grown),
        np.zeros((2, 4)),
        count,
    )


@compiled
def _is_bare(body: Body) -> bool:
    """Whether a body is the hull of its points alone."""
    return bool(body.balls.size == 0 and not body.discs[0, RADIUS] > 0.0)


@compiled
def _growth(body: Body, corner: int, nx: float, ny: float, nz: float) -> float:
    """Largest n.x over the zonotope and ball of a corner, n of unit length; [m]."""
    if body.balls.size == 0:
        return 0.0
    g, total = body.swings, body.balls[corner]
    for k in range(body.sizes[corner]):
        total += abs(nx * g[corner, k, 0] + ny * g[corner, k, 1] + nz * g[corner, k, 2])
    return float(total)


@compiled
def _disc_reach(body: Body, instant: int, nx: float, ny: float, nz: float) -> float:
    """Largest n.x over the disc at an instant; [m]."""
    d = body.discs[instant]
    along = nx * d[0] + ny * d[1] + nz * d[2]
    x, y, z = nx - along * d[0], ny - along * d[1], nz - along * d[2]
    return float(d[RADIUS] * sqrt(x * x + y * y + z * z))


@compiled
def body_reach(body: Body, nx: float, ny: float, nz: float) -> float:
    """Largest n.x over a body, n of unit length; [m]."""
    p, reach = body.points, -np.inf
    n_points, n_corners = body.used[0], body.used[1]
    if _is_bare(body):
        for k in range(n_points):
            along = nx * p[k, 0] + ny * p[k, 1] + nz * p[k, 2]
            reach = along if along > reach else reach
        return reach
    first = second = 0.0
    if body.discs[0, RADIUS] > 0.0:
        first = _disc_reach(body, 0, nx, ny, nz)
        second = _disc_reach(body, 1, nx, ny, nz)
    for corner in range(n_corners):
        grown, disc, k = _growth(body, corner, nx, ny, nz), first, corner
        while k < n_points:
            along = nx * p[k, 0] + ny * p[k, 1] + nz * p[k, 2]
            reach = max(reach, along + grown + disc)
            disc, k = second, k + n_corners
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
    n_points, n_corners = body.used[0], body.used[1]
    if _is_bare(body):
        most, k = -np.inf, 0
        for j in range(n_points):
            along = nx * p[j, 0] + ny * p[j, 1] + nz * p[j, 2]
            if along > most:
                most, k = along, j
        point[0], point[1], point[2] = p[k, 0], p[k, 1], p[k, 2]
        return most
    first = second = 0.0
    has_disc = body.discs[0, RADIUS] > 0.0
    if has_disc:
        first = _disc_reach(body, 0, nx, ny, nz)
        second = _disc_reach(body, 1, nx, ny, nz)
    best, at, corner = -np.inf, 0, 0
    for c in range(n_corners):
        grown, disc, k = _growth(body, c, nx, ny, nz), first, c
        while k < n_points:  # no division: this is the innermost loop of all
            value = nx * p[k, 0] + ny * p[k, 1] + nz * p[k, 2] + grown + disc
            if value > best:
                best, at, corner = value, k, c
            disc, k = second, k + n_corners
    ball, size = 0.0, 0
    if body.balls.size > 0:
        ball, size = body.balls[corner], body.sizes[corner]
    x, y, z = p[at, 0] + ball * nx, p[at, 1] + ball * ny, p[at, 2] + ball * nz
    for k in range(size):
        along = nx * g[corner, k, 0] + ny * g[corner, k, 1] + nz * g[corner, k, 2]
        side = 1.0 if along >= 0.0 else -1.0
        x, y, z = (
            x + side * g[corner, k, 0],
            y + side * g[corner, k, 1],
            z + side * g[corner, k, 2],
        )
    point[0], point[1], point[2] = x, y, z
    if has_disc:
        _add_disc(body.discs[int(at >= n_corners)], nx, ny, nz, point)
    return best


@compiled
def _add_disc(
    disc: FloatArray, nx: float, ny: float, nz: float, point: FloatArray
) -> None:
    """Move a point to the farthest place along n on a disc around it."""
    along = nx * disc[0] + ny * disc[1] + nz * disc[2]
    x, y, z = nx - along * disc[0], ny - along * disc[1], nz - along * disc[2]
    # Where n is nearly the axis what is left is mostly rounding: taken across it again,
    # or dropped, so that the point lies in the disc.
    rest = x * disc[0] + y * disc[1] + z * disc[2]
    x, y, z = x - rest * disc[0], y - rest * disc[1], z - rest * disc[2]
    size = sqrt(x * x + y * y + z * z)
    if size > ALIGNED:
        share = disc[RADIUS] / size
        point[0], point[1], point[2] = (
            point[0] + share * x,
            point[1] + share * y,
            point[2] + share * z,
        )
