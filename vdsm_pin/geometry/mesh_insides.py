"""Whether a mesh winds round a point, by a ray through its hierarchy, compiled."""

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.closed_meshes import SIGNED, SINGLE, SOLID
from vdsm_pin.geometry.obstacles import STACK
from vdsm_pin.geometry.pieces import PackedPieces


@compiled
def _left_of(a: FloatArray, b: FloatArray, x: float, y: float) -> bool:
    """Whether a point of the xy plane lies left of an edge and at its height.

    The lower end belongs to the edge, the upper one does not, and the ends are put in
    order first: both triangles of an edge get the same answer.
    """
    if a[1] > b[1]:
        a, b = b, a
    if not a[1] <= y < b[1]:
        return False
    return bool((b[0] - a[0]) * (y - a[1]) > (b[1] - a[1]) * (x - a[0]))


@compiled
def _passes(pieces: PackedPieces, p: int, x: float, y: float, z: float) -> int:
    """Sense in which the ray from a point along +z passes a triangle, 0 for none."""
    start = pieces.first_point[p]
    a, b, c = (pieces.points[start], pieces.points[start + 1], pieces.points[start + 2])
    if not _left_of(a, b, x, y) ^ _left_of(b, c, x, y) ^ _left_of(c, a, x, y):
        return 0
    u = (b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)
    v = (c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)
    w = (a[0] - x) * (b[1] - y) - (a[1] - y) * (b[0] - x)
    whole = u + v + w
    if whole == 0.0 or (u * a[2] + v * b[2] + w * c[2]) / whole <= z:
        return 0
    return 1 if whole > 0.0 else -1


@compiled
def has_inside(pieces: PackedPieces, covers: IntArray, obstacle: int) -> bool:
    """Whether an obstacle is a mesh with an inside; arguments as for `encloses`."""
    return bool(covers[pieces.node_range[pieces.root[obstacle], 0]] & SOLID)


@compiled(inline=False)
def encloses(
    pieces: PackedPieces, covers: IntArray, obstacle: int, point: FloatArray
) -> bool:
    """Whether a mesh with an inside winds round a point.

    The ray from the point along +z is followed.

    Edges count half-open: a ray through an edge or corner that two triangles share
    crosses once. Heights are rounded; `geometry/winding.py` is exact.

    Args:
        pieces: The scene.
        covers: What `ClosedMesh.covers` says of each piece, 0 of what is no mesh,
            shape (n_pieces,).
        obstacle: A mesh for which `has_inside` holds.
        point: Shape (3,); [m].
    """
    x, y, z = point[0], point[1], point[2]
    stack = np.zeros(STACK, np.int64)
    stack[0] = pieces.root[obstacle]
    waiting, winding, count = 1, 0, 0
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        low, high = pieces.node_low[node], pieces.node_high[node]
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1] and z <= high[2]):
            continue
        first = pieces.node_range[node, 0]
        if pieces.node_range[node, 1] - first > 1:
            stack[waiting], stack[waiting + 1] = node + 1, pieces.node_right[node]
            waiting += 2
        else:
            sense = _passes(pieces, first, x, y, z)
            if covers[first] & SIGNED:
                winding += sense
            if covers[first] & SINGLE:
                count += sense
    return winding != 0 or count % 2 != 0
