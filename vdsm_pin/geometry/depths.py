"""How deep points lie in convex pieces, and the deepest point of two, compiled.

Depths are concave, so that shortening steps up their slopes lead near the top. Nothing
here has to be exact: whoever asks proves what is found.
"""

from math import exp, sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import apart, borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray

PLANES: Final = 0
CYLINDER: Final = 1
CAPSULE: Final = 2
"""What bounds an inside."""

STEPS: Final = 200
"""Of a climb."""

SHORTER: Final = 0.97
"""How much shorter each step is than the one before; [-]."""

LONGEST: Final = 1e-3
"""The first step, where depths do not ask for a longer one; [m]."""

FIRST_RATE: Final = 10.0
"""Of the weights of corners; [-]."""

LEAST_WEIGHT: Final = 1e-9
"""Of a corner, so that it can grow again; [-]."""


class Inside(NamedTuple):
    """What bounds the inside of a convex piece.

    Args:
        kind: PLANES, CYLINDER or CAPSULE.
        radius: Of a cylinder, or by which the rest is grown; [m].
        normals: Outward unit normals of its planes, shape (m, 3); [-].
        offsets: n.x on them, shape (m,); [m].
        spine: Centre and axis of a cylinder, start and way to the end of a capsule's
            segment, shape (2, 3).
        half_length: Of a cylinder; [m].
    """

    kind: int
    radius: float
    normals: FloatArray = np.zeros((0, 3))
    offsets: FloatArray = np.zeros(0)
    spine: FloatArray = np.zeros((2, 3))
    half_length: float = 0.0


@compiled
def _in_planes(inside: Inside, x: FloatArray, way: FloatArray) -> float:
    normals, offsets = inside.normals, inside.offsets
    least, at = np.inf, 0
    for k in range(offsets.size):
        n = normals[k]
        room = offsets[k] - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2])
        if room < least:
            least, at = room, k
    for c in range(3):
        way[c] = -normals[at, c]
    return least + inside.radius


@compiled
def _in_round(inside: Inside, x: FloatArray, way: FloatArray) -> float:
    """Of a cylinder or a capsule."""
    first, axis = inside.spine[0], inside.spine[1]
    along = squared = length = 0.0
    for c in range(3):
        along += axis[c] * (x[c] - first[c])
        length += axis[c] * axis[c]
    share = along
    if inside.kind == CAPSULE:
        share = min(1.0, max(0.0, along / length)) if length > 0.0 else 0.0
    for c in range(3):
        way[c] = first[c] + share * axis[c] - x[c]
        squared += way[c] * way[c]
    far = sqrt(squared)
    side, end = inside.radius - far, inside.half_length - abs(along)
    if inside.kind == CYLINDER and end < side:
        sense = -1.0 if along >= 0.0 else 1.0
        for c in range(3):
            way[c] = sense * axis[c]
        return end
    for c in range(3):
        way[c] = way[c] / far if far > 0.0 else 0.0
    return side


@compiled
def _depth(inside: Inside, x: FloatArray, way: FloatArray) -> float:
    """How deep a point lies in a piece at most, and the way to lie deeper, (3,)."""
    apart()
    if inside.kind == PLANES:
        return _in_planes(inside, x, way)
    return _in_round(inside, x, way)


@compiled
def climb(
    one: Inside, other: Inside, start: FloatArray, enough: float, where: FloatArray
) -> float:
    """The deepest point in two pieces that steps along slopes find.

    Steps up the slope of the lesser depth lead near its top, and steps up both slopes
    at once along the ridge on which both are equal.

    Args:
        one: A piece.
        other: Another one.
        start: Where to begin, shape (3,); [m].
        enough: Depth beyond which none deeper is looked for; [m].
        where: The point, written, shape (3,); [m].

    Returns:
        How deep it seems to lie in both; [m].
    """
    one, other = borrowed(one), borrowed(other)
    at, up, ways = np.zeros(3), np.zeros(3), np.zeros((2, 3))
    where[:] = start
    best, depths = -np.inf, np.zeros(2)
    depths[0], depths[1] = _depth(one, start, ways[0]), _depth(other, start, ways[1])
    longest = max(LONGEST, abs(depths[0]), abs(depths[1]))
    if not longest < np.inf:
        return best
    for along_ridge in (False, True):
        at[:], step = where, longest
        for _ in range(STEPS):
            depths[0], depths[1] = _depth(one, at, ways[0]), _depth(other, at, ways[1])
            lesser = 0 if depths[0] <= depths[1] else 1
            up[:] = ways[lesser]
            if depths[lesser] > best:
                best = depths[lesser]
                where[:] = at
                if best > enough:
                    return float(best)
            elif along_ridge:
                at[:] = where
                depths[0] = _depth(one, at, ways[0])
                depths[1] = _depth(other, at, ways[1])
            squared = 0.0
            for c in range(3):
                squared += (ways[0, c] + ways[1, c]) ** 2
            level = abs(depths[0] - depths[1]) <= step
            if along_ridge and level and squared > 0.0:
                for c in range(3):
                    up[c] = (ways[0, c] + ways[1, c]) / sqrt(squared)
            for c in range(3):
                at[c] += step * up[c]
            step *= SHORTER
    return float(best)


@compiled
def deepest_of(points: FloatArray, inside: Inside, where: FloatArray) -> float:
    """The point of a flat hull that lies deepest in a piece, as far as steps find it.

    The weights of its corners grow with how far each lies up the slope.

    Args:
        points: Corners, shape (n, 3); [m].
        inside: The piece.
        where: The point, written, shape (3,); [m].

    Returns:
        How deep it seems to lie; [m].
    """
    points, inside = borrowed(points), borrowed(inside)
    n, best, rate, size = points.shape[0], -np.inf, FIRST_RATE, 0.0
    for c in range(3):
        size = max(size, points[:, c].max() - points[:, c].min())
    weights, up = np.full(n, 1.0 / n), np.zeros(n)
    at, way = np.zeros(3), np.zeros(3)
    where[:] = points[0]
    for _ in range(STEPS):
        for c in range(3):
            at[c] = 0.0
            for k in range(n):
                at[c] += weights[k] * points[k, c]
        depth = _depth(inside, at, way)
        if depth > best:
            best = depth
            where[:] = at
        most, total = -np.inf, 0.0
        for k in range(n):
            p = points[k]
            up[k] = p[0] * way[0] + p[1] * way[1] + p[2] * way[2]
            most = max(most, up[k])
        for k in range(n):
            share = (up[k] - most) / size if size > 0.0 else 0.0
            weights[k] = max(LEAST_WEIGHT, weights[k] * exp(rate * share))
            total += weights[k]
        for k in range(n):
            weights[k] /= total
        rate *= SHORTER
    return best
