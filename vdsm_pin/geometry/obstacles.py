"""Distance between a body and a whole obstacle."""

from math import sqrt
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import RADIUS, Body, body_reach
from vdsm_pin.geometry.kernels import (
    BRACKET,
    LOWER,
    NEAR,
    NORMAL,
    SCRATCH_ROWS,
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

Middle: TypeAlias = tuple[float, float, float]
"""A point; [m]."""


class Measuring(NamedTuple):
    """Working space of a distance, and the distance.

    Args:
        scratch: Shape (SCRATCH_ROWS + 2, 3).
        stack: Nodes still to look at, shape (STACK,).
        trial: The bracket of one piece, shape (BRACKET + 4,).
        out: The bracket, shape (BRACKET + 4,).
    """

    scratch: FloatArray
    stack: IntArray
    trial: FloatArray
    out: FloatArray


@compiled
def new_measuring() -> Measuring:
    """Fresh working space, its guess of n along x."""
    out = np.zeros(BRACKET + 4)
    out[NORMAL] = 1.0
    scratch = np.zeros((SCRATCH_ROWS + 2, 3))
    return Measuring(scratch, np.zeros(STACK, np.int64), np.zeros(BRACKET + 4), out)


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


@compiled(inline=False)
def obstacle_bracket(
    pieces: PackedPieces, obstacle: int, body: Body, goal: float, work: Measuring
) -> None:
    """Distance between a body and an obstacle's pieces.

    Args:
        pieces: The scene.
        obstacle: Number of the obstacle.
        body: The body, not grown.
        goal: Width of the bracket at which to stop; [m].
        work: Its `out` is as for `bracket`: the guess of n on entry, on return the
            least lower and the least upper bound over the pieces, with n of the former
            and the witness points of the latter.
    """
    stack, trial, out = work.stack, work.trial, work.out
    scratch = work.scratch
    root = pieces.root[obstacle]
    first = pieces.node_range[root, 0]
    if pieces.node_range[root, 1] - first == 1:
        bracket(pieces, first, body, goal, scratch, out)
        return
    low, high = scratch[-2], scratch[-1]
    box_of(body, low, high)
    middle = middle_of(body)
    trial[NORMAL:NEAR] = out[NORMAL:NEAR]
    out[LOWER] = out[UPPER] = np.inf
    stack[0] = root
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if box_distance(pieces, node, low, high) >= out[LOWER]:
            continue
        if _plane_gap(pieces, node, body, middle, scratch[0]) >= out[LOWER]:
            continue
        first = pieces.node_range[node, 0]
        if pieces.node_range[node, 1] - first > 1:
            waiting = push_children(pieces, node, low, high, stack, waiting)
            continue
        bracket(pieces, first, body, goal, scratch, trial)
        keep_least(trial, out)


@compiled(inline=False)
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


@compiled(inline=False)
def middle_of(body: Body) -> Middle:
    """The mean of a body's points; [m]."""
    points, count = body.points, body.used[0]
    x = y = z = 0.0
    for k in range(count):
        x, y, z = x + points[k, 0], y + points[k, 1], z + points[k, 2]
    return x / count, y / count, z / count


@compiled
def _along_axis(
    low: FloatArray, high: FloatArray, points: FloatArray, n: FloatArray
) -> None:
    """From the nearest point of a segment, of its two ends, to a box; n is written."""
    span = along = 0.0
    for c in range(3):
        d = points[1, c] - points[0, c]
        span += d * d
        along += d * (0.5 * (low[c] + high[c]) - points[0, c])
    for _ in range(TURNS):
        t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
        along = 0.0
        for c in range(3):
            start = points[0, c]
            d = points[1, c] - start
            at = start + t * d
            inside = min(max(at, low[c]), high[c])
            n[c] = inside - at
            along += d * (inside - start)


@compiled
def facing(
    pieces: PackedPieces, node: int, body: Body, middle: Middle, n: FloatArray
) -> bool:
    """A guess of n towards a node's box: from the axis or the middle of a body.

    Of an axis the point of the box nearest to a point of it, the point of the axis
    nearest to that one, and so on: a few turns come near the two nearest points.

    Args:
        pieces: The scene.
        node: The node.
        body: The body; one of two corners is its axis.
        middle: As `middle_of` has it.
        n: Result, unit vector, shape (3,).

    Returns:
        Whether there is such a direction; there is none where they seem to meet.
    """
    low, high = pieces.node_low[node], pieces.node_high[node]
    if body.used[1] == 2:
        _along_axis(low, high, body.points, n)
    else:
        x, y, z = middle
        n[0] = min(max(x, low[0]), high[0]) - x
        n[1] = min(max(y, low[1]), high[1]) - y
        n[2] = min(max(z, low[2]), high[2]) - z
    length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if not 0.0 < length < np.inf:
        return False
    for c in range(3):
        n[c] /= length
    return True


@compiled
def _plane_gap(
    pieces: PackedPieces, node: int, body: Body, middle: Middle, n: FloatArray
) -> float:
    """Gap of one plane between a body and a node's box; a lower bound; [m]."""
    if not facing(pieces, node, body, middle, n):
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
