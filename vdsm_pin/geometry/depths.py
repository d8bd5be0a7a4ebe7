"""How deep points lie in convex pieces, and the deepest point of two, compiled.

Depths are concave, so that shortening steps up their slopes lead near the top, and cuts
by them to it. Nothing here has to be exact: whoever asks proves what is found.
"""

from math import exp, sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
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

CUTS: Final = 500
"""Of an ellipsoid, which each shrinks by a twenty-fifth of its size at least."""

FINEST: Final = 1e-10
"""How much deeper a point may lie that is not looked for; [m]."""

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


@compiled(inline=False)
def _depth(inside: Inside, x: FloatArray, way: FloatArray) -> float:
    """How deep a point lies in a piece at most, and the way to lie deeper, (3,)."""
    if inside.kind == PLANES:
        return _in_planes(inside, x, way)
    return _in_round(inside, x, way)


@compiled
def climb(
    one: Inside, other: Inside, start: FloatArray, enough: float, where: FloatArray
) -> float:
    """The deepest point in two pieces, as far as cuts by their slopes find it.

    Steps up the slope of the lesser depth lead near it, and the ellipsoid method from
    there to it, however flat the room in both is (Shor 1977; deep cuts as in Bland,
    Goldfarb and Todd 1981).

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
    at, up = start.copy(), np.zeros(3)
    where[:] = start
    best = _depth_in_both(one, other, at, up)
    step = max(LONGEST, abs(best))
    if not step < np.inf:
        return -np.inf
    reach = step / (1.0 - SHORTER)
    for _ in range(STEPS):
        if best > enough:
            return best
        for c in range(3):
            at[c] += step * up[c]
        step *= SHORTER
        depth = _depth_in_both(one, other, at, up)
        if depth > best:
            best = depth
            where[:] = at
    return _refined(one, other, reach, enough, where)


@compiled
def _depth_in_both(one: Inside, other: Inside, x: FloatArray, way: FloatArray) -> float:
    """The lesser depth of a point, and the way to have more of it, (3,)."""
    second = np.zeros(3)
    first_depth, second_depth = _depth(one, x, way), _depth(other, x, second)
    if first_depth <= second_depth:
        return first_depth
    way[:] = second
    return second_depth


@compiled
def _refined(
    one: Inside, other: Inside, reach: float, enough: float, where: FloatArray
) -> float:
    """The depth of the deepest point within reach of one, which it takes the place of.

    What is deeper than the best point lies in an ellipsoid, of which every slope cuts
    off a part.
    """
    one, other = borrowed(one), borrowed(other)
    centre, up, towards = where.copy(), np.zeros(3), np.zeros(3)
    shape, best = reach * reach * np.eye(3), -np.inf
    for _ in range(CUTS):
        depth = _depth_in_both(one, other, centre, up)
        if depth > best:
            best = depth
            where[:] = centre
        squared = 0.0
        for c in range(3):
            towards[c] = 0.0
            for d in range(3):
                towards[c] += shape[c, d] * up[d]
            squared += up[c] * towards[c]
        # No point of the ellipsoid is deeper by more than this.
        more = sqrt(max(squared, 0.0))
        if best > enough or not more > best - depth + FINEST:
            break
        off = (best - depth) / more
        grown, thinner = (
            1.125 * (1.0 - off * off),
            0.5 * (1.0 + 3.0 * off) / (1.0 + off),
        )
        for c in range(3):
            towards[c] /= more
            centre[c] += 0.25 * (1.0 + 3.0 * off) * towards[c]
        for c in range(3):
            for d in range(3):
                cut = thinner * towards[c] * towards[d]
                shape[c, d] = grown * (shape[c, d] - cut)
    return best


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
