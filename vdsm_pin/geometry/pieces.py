"""A scene's convex pieces in flat arrays, with a hierarchy of boxes over each obstacle.

The hierarchy halves ranges: the node of pieces [first, last) has the children
[first, middle) and [middle, last), middle = (first + last) // 2. It is as good as the
order of the pieces is coherent, so `coherent_order` sorts a mesh's triangles once.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Piece

HULL: Final = 0
CYLINDER: Final = 1
HALF_SPACE: Final = 2
SHORT: Final = 8
"""Up to so many pieces an obstacle keeps their order."""


class PackedPieces(NamedTuple):
    """Every piece of every obstacle, as compiled code reads it.

    Pieces of an obstacle with many of them stand in an order of their own (`order`).

    Args:
        order: Number within its obstacle of each piece as it was given, (n_pieces,).
        kind: HULL, CYLINDER or HALF_SPACE, shape (n_pieces,).
        first_point: Where a piece's points start, shape (n_pieces + 1,).
        points: Corners of all hulls in order, shape (n_points, 3); [m].
        radius: Rounding radius of a hull or radius of a cylinder, (n_pieces,); [m].
        centre: Centre of a cylinder, a point in any other piece, (n_pieces, 3); [m].
        axis: Unit axis of a cylinder, outward normal of a half-space, (n_pieces, 3).
        extent: Half height of a cylinder, offset of a half-space, (n_pieces,); [m].
        first_piece: Where an obstacle's pieces start, shape (n_obstacles + 1,).
        root: Root node of each obstacle, shape (n_obstacles,).
        node_range: Pieces [first, last) of a node, shape (n_nodes, 2).
        node_right: Right child; the left one is the next node, (n_nodes,).
        node_low: Lower corner of the box of a node, shape (n_nodes, 3); [m].
        node_high: Upper corner, shape (n_nodes, 3); [m].
    """

    order: IntArray
    kind: IntArray
    first_point: IntArray
    points: FloatArray
    radius: FloatArray
    centre: FloatArray
    axis: FloatArray
    extent: FloatArray
    first_piece: IntArray
    root: IntArray
    node_range: IntArray
    node_right: IntArray
    node_low: FloatArray
    node_high: FloatArray


def coherent_order(points: FloatArray) -> IntArray:
    """An order in which every halved range is compact: a k-d tree's leaves.

    Args:
        points: Shape (n, 3); [m].

    Returns:
        Permutation of 0..n-1, shape (n,); ties keep the given order.
    """
    order = np.arange(len(points))
    ranges = [(0, len(points))]
    while ranges:
        first, last = ranges.pop()
        if last - first <= 2:
            continue
        part = points[order[first:last]]
        axis = int(np.argmax(np.ptp(part, axis=0)))
        order[first:last] = order[first:last][np.argsort(part[:, axis], kind="stable")]
        middle = (first + last) // 2
        ranges += [(first, middle), (middle, last)]
    return order


def _boxes(pieces: Sequence[Piece]) -> FloatArray:
    """Lower and upper corners of the pieces' boxes, shape (n, 2, 3); [m]."""
    boxes = np.zeros((len(pieces), 2, 3))
    for box, piece in zip(boxes, pieces, strict=True):
        if isinstance(piece, Hull):
            box[0] = piece.points.min(axis=0) - piece.radius
            box[1] = piece.points.max(axis=0) + piece.radius
        elif isinstance(piece, FlatCylinder):
            # Not sqrt(1 - axis^2): it loses half the digits along the axis.
            across = np.hypot(np.roll(piece.axis, 1), np.roll(piece.axis, 2))
            half = piece.half_length * np.abs(piece.axis) + piece.radius * across
            # A box must hold the solid: half an ulp lost to the square root is given.
            half = half * (1.0 + 4.0 * np.finfo(float).eps)
            box[0], box[1] = piece.centre - half, piece.centre + half
        else:
            box[0], box[1] = -np.inf, np.inf
    return boxes


def _hierarchy(
    boxes: FloatArray, offset: int, start: int
) -> tuple[list[tuple[int, int]], list[int], list[FloatArray]]:
    """Nodes over one obstacle in depth-first order: ranges, right children, boxes."""
    ranges: list[tuple[int, int]] = []
    rights: list[int] = []
    hulls: list[FloatArray] = []
    waiting = [(0, len(boxes), -1)]
    while waiting:
        first, last, parent = waiting.pop()
        node = start + len(ranges)
        if parent >= 0:
            rights[parent] = node
        ranges.append((first + offset, last + offset))
        rights.append(-1)
        part = boxes[first:last]
        hulls.append(np.stack([part[:, 0].min(axis=0), part[:, 1].max(axis=0)]))
        if last - first > 1:
            middle = (first + last) // 2
            waiting += [(middle, last, len(ranges) - 1), (first, middle, -1)]
    return ranges, rights, hulls


def _order(group: Sequence[Piece]) -> IntArray:
    """The order in which an obstacle's pieces are packed."""
    if len(group) <= SHORT or not all(isinstance(piece, Hull) for piece in group):
        return np.arange(len(group))
    hulls = [piece for piece in group if isinstance(piece, Hull)]
    return coherent_order(np.array([hull.points.mean(axis=0) for hull in hulls]))


def pack_pieces(obstacles: Sequence[Sequence[Piece]]) -> PackedPieces:
    """Pack the pieces of every obstacle, in the given order.

    Args:
        obstacles: The pieces of each obstacle.

    Returns:
        Flat arrays; empty ones for no obstacle.
    """
    orders = [_order(group) for group in obstacles]
    obstacles = [
        [group[k] for k in order]
        for group, order in zip(obstacles, orders, strict=True)
    ]
    pieces = [piece for group in obstacles for piece in group]
    n = len(pieces)
    kind, radius, extent = np.zeros(n, np.int64), np.zeros(n), np.zeros(n)
    centre, axis = np.zeros((n, 3)), np.zeros((n, 3))
    counts, points = np.zeros(n + 1, np.int64), [np.zeros((0, 3))]
    for k, piece in enumerate(pieces):
        if isinstance(piece, Hull):
            kind[k], radius[k] = HULL, piece.radius
            centre[k] = piece.points.mean(axis=0)
            counts[k + 1] = len(piece.points)
            points.append(piece.points)
        elif isinstance(piece, FlatCylinder):
            kind[k], radius[k], extent[k] = CYLINDER, piece.radius, piece.half_length
            centre[k], axis[k] = piece.centre, piece.axis
        elif isinstance(piece, HalfSpacePiece):
            kind[k], extent[k], axis[k] = HALF_SPACE, piece.offset, piece.normal
            centre[k] = piece.offset * piece.normal
    sizes = [0, *(len(group) for group in obstacles)]
    first_piece = np.cumsum(sizes)
    ranges: list[tuple[int, int]] = []
    rights: list[int] = []
    hulls: list[FloatArray] = [np.zeros((0, 2, 3))]
    roots = []
    for group, offset in zip(obstacles, first_piece[:-1], strict=True):
        roots.append(len(ranges))
        tree = _hierarchy(_boxes(group), int(offset), len(ranges))
        ranges += tree[0]
        rights += tree[1]
        hulls.append(np.array(tree[2]))
    nodes = np.concatenate(hulls)
    return PackedPieces(
        order=np.concatenate([np.zeros(0, np.int64), *orders]),
        kind=kind,
        first_point=np.cumsum(counts),
        points=np.ascontiguousarray(np.concatenate(points)),
        radius=radius,
        centre=centre,
        axis=axis,
        extent=extent,
        first_piece=first_piece.astype(np.int64),
        root=np.array(roots, dtype=np.int64),
        node_range=np.array(ranges, dtype=np.int64).reshape(-1, 2),
        node_right=np.array(rights, dtype=np.int64),
        node_low=np.ascontiguousarray(nodes[:, 0]),
        node_high=np.ascontiguousarray(nodes[:, 1]),
    )
