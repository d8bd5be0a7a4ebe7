"""Distance between a body and a whole obstacle."""

from math import sqrt
from typing import Final

import numpy as np

from vdsm_pin.compiled import apart, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import RADIUS, Body, body_reach
from vdsm_pin.geometry.closed_meshes import SIGNED, SINGLE, SOLID
from vdsm_pin.geometry.kernels import (
    LOWER,
    NEAR,
    NORMAL,
    UPPER,
    bracket,
    keep_least,
    piece_support,
    rounding_radius,
)
from vdsm_pin.geometry.pieces import HALF_SPACE, PackedPieces

STACK: Final = 64
"""Depth of the hierarchy's waiting list: pieces are halved, so 2^60 are enough."""

TURNS: Final = 3
"""How often `facing` goes from a segment to a box and back."""


@compiled
def box_of(body: Body, low: FloatArray, high: FloatArray) -> None:
    """The box of a body's points and discs, written, shape (3,) each; [m]."""
    points, grown = body.points, body.discs[0, RADIUS]
    for c in range(3):
        low[c] = high[c] = points[0, c]
        for k in range(1, body.used[0]):
            low[c] = min(low[c], points[k, c])
            high[c] = max(high[c], points[k, c])
        low[c] -= grown
        high[c] += grown


@compiled
def box_distance(
    pieces: PackedPieces, node: int, low: FloatArray, high: FloatArray
) -> float:
    """Distance between a node's box and another box, 0 where they meet; [m]."""
    squared = 0.0
    for c in range(3):
        gap = max(
            pieces.node_low[node, c] - high[c], low[c] - pieces.node_high[node, c]
        )
        if gap > 0.0:
            squared += gap * gap
    return sqrt(squared)


@compiled
def box_support(
    pieces: PackedPieces, node: int, nx: float, ny: float, nz: float
) -> float:
    """Least n.x over a node's box; -inf for a half-space; [m] for a unit n."""
    low, high = pieces.node_low[node], pieces.node_high[node]
    if np.isinf(low[0]):
        return -np.inf
    x = nx * (low[0] if nx > 0.0 else high[0])
    y = ny * (low[1] if ny > 0.0 else high[1])
    z = nz * (low[2] if nz > 0.0 else high[2])
    return float(x + y + z)


@compiled
def obstacle_bracket(
    pieces: PackedPieces,
    obstacle: int,
    body: Body,
    goal: float,
    scratch: FloatArray,
    stack: IntArray,
    trial: FloatArray,
    out: FloatArray,
) -> None:
    """Distance between a body and an obstacle's pieces.

    Args:
        pieces: The scene.
        obstacle: Number of the obstacle.
        body: The body, not grown.
        goal: Width of the bracket at which to stop; [m].
        scratch: Working space, shape (SCRATCH_ROWS + 2, 3).
        stack: Working space, shape (STACK,).
        trial: Working space, shape (BRACKET + 4,).
        out: As for `bracket`: the guess of n on entry, on return the least lower and
            the least upper bound over the pieces, with n of the former and the witness
            points of the latter.
    """
    apart()
    root = pieces.root[obstacle]
    first = pieces.node_range[root, 0]
    if pieces.node_range[root, 1] - first == 1:
        bracket(pieces, first, body, goal, scratch, out)
        return
    low, high = scratch[-2], scratch[-1]
    box_of(body, low, high)
    trial[NORMAL:NEAR] = out[NORMAL:NEAR]
    out[LOWER] = out[UPPER] = np.inf
    stack[0] = root
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if box_distance(pieces, node, low, high) >= out[LOWER]:
            continue
        if _plane_gap(pieces, node, body, scratch[0]) >= out[LOWER]:
            continue
        first = pieces.node_range[node, 0]
        if pieces.node_range[node, 1] - first > 1:
            waiting = push_children(pieces, node, low, high, stack, waiting)
            continue
        bracket(pieces, first, body, goal, scratch, trial)
        keep_least(trial, out)


@compiled
def node_support(
    pieces: PackedPieces, node: int, n: FloatArray, stack: IntArray, point: FloatArray
) -> float:
    """Least n.x over all pieces of a node, n of unit length; [m].

    Args:
        pieces: The scene.
        node: The node. A half-space has one direction, the negative of its normal,
            which n is taken to be.
        n: Shape (3,); [-].
        stack: Working space, shape (STACK,).
        point: Working space, shape (3,).
    """
    apart()
    least = np.inf
    stack[0] = node
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        p = pieces.node_range[node, 0]
        if pieces.node_range[node, 1] - p == 1:
            if pieces.kind[p] == HALF_SPACE:
                return float(-pieces.extent[p])
            core = piece_support(pieces, p, n[0], n[1], n[2], point)
            least = min(least, core - rounding_radius(pieces, p))
            continue
        left, right = node + 1, pieces.node_right[node]
        at_left = box_support(pieces, left, n[0], n[1], n[2])
        at_right = box_support(pieces, right, n[0], n[1], n[2])
        if at_left > at_right:
            left, right, at_left, at_right = right, left, at_right, at_left
        if at_right < least:
            stack[waiting] = right
            waiting += 1
        if at_left < least:
            stack[waiting] = left
            waiting += 1
    return least


@compiled
def _spine(body: Body, c: int) -> tuple[float, float]:
    """Coordinate c of both ends of a segment in a body: an axis, or the middle."""
    points = body.points
    if body.used[1] == 2:
        return points[0, c], points[1, c]
    middle = 0.0
    for k in range(body.used[0]):
        middle += points[k, c]
    middle /= body.used[0]
    return middle, middle


@compiled
def facing(pieces: PackedPieces, node: int, body: Body, n: FloatArray) -> bool:
    """A guess of n towards a node's box, from a segment in the body.

    The point of the box nearest to a point of the segment, the point of the segment
    nearest to that one, and so on: a few turns come near the two nearest points.

    Args:
        pieces: The scene.
        node: The node.
        body: The body.
        n: Result, unit vector, shape (3,).

    Returns:
        Whether there is such a direction; there is none where they seem to meet.
    """
    low, high = pieces.node_low[node], pieces.node_high[node]
    span = along = 0.0
    for c in range(3):
        start, end = _spine(body, c)
        d = end - start
        span += d * d
        along += d * (0.5 * (low[c] + high[c]) - start)
    squared = 0.0
    for _ in range(TURNS):
        t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
        squared = along = 0.0
        for c in range(3):
            start, end = _spine(body, c)
            d = end - start
            at = start + t * d
            inside = min(max(at, low[c]), high[c])
            n[c] = inside - at
            squared += n[c] * n[c]
            along += d * (inside - start)
    length = sqrt(squared)
    if not 0.0 < length < np.inf:
        return False
    for c in range(3):
        n[c] /= length
    return True


@compiled
def _plane_gap(pieces: PackedPieces, node: int, body: Body, n: FloatArray) -> float:
    """Gap of one plane between a body and a node's box; a lower bound; [m]."""
    if not facing(pieces, node, body, n):
        return -np.inf
    reach = body_reach(body, n[0], n[1], n[2])
    return box_support(pieces, node, n[0], n[1], n[2]) - reach


@compiled
def push_children(
    pieces: PackedPieces,
    node: int,
    low: FloatArray,
    high: FloatArray,
    stack: IntArray,
    waiting: int,
) -> int:
    """Push both children, the nearer one last so that it is seen first."""
    left, right = node + 1, pieces.node_right[node]
    left_gap = box_distance(pieces, left, low, high)
    right_gap = box_distance(pieces, right, low, high)
    if left_gap <= right_gap:
        stack[waiting], stack[waiting + 1] = right, left
    else:
        stack[waiting], stack[waiting + 1] = left, right
    return waiting + 2


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
    a, b, c = (
        pieces.points[start],
        pieces.points[start + 1],
        pieces.points[start + 2],
    )
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


@compiled
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
    apart()
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
