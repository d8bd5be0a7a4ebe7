"""A scene's convex pieces in flat arrays, with a hierarchy of boxes over each obstacle.

The hierarchy halves ranges: the node of pieces [first, last) has the children
[first, middle) and [middle, last), middle = (first + last) // 2. It is as good as the
order of the pieces is coherent, so `coherent_order` sorts a mesh's triangles once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Hulls, Piece
from vdsm_pin.geometry.ordering import coherent_order

HELD: Final = 1.0 + 4.0 * float(np.finfo(float).eps)
"""Times half its size a box holds a solid, whose size is rounded; [-]."""

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


def _order(group: Sequence[Piece]) -> IntArray:
    """The order in which an obstacle's pieces are packed."""
    if isinstance(group, Hulls):
        centres = group.corners.mean(axis=1)
    elif len(group) <= SHORT or not all(isinstance(piece, Hull) for piece in group):
        return np.arange(len(group))
    else:
        hulls = [piece for piece in group if isinstance(piece, Hull)]
        centres = np.array([hull.points.mean(axis=0) for hull in hulls])
    return coherent_order(centres) if len(group) > SHORT else np.arange(len(group))


@dataclass
class _Table:
    """Pieces as columns, while they are collected."""

    kind: list[int] = field(default_factory=list)
    radius: list[float] = field(default_factory=list)
    n_points: list[int] = field(default_factory=list)
    points: list[FloatArray] = field(default_factory=lambda: [np.zeros((0, 3))])
    centres: list[FloatArray] = field(default_factory=lambda: [np.zeros((0, 3))])
    flat: dict[int, FlatCylinder | HalfSpacePiece] = field(default_factory=dict)

    def add_hulls(self, corners: FloatArray, radius: float) -> None:
        """Append hulls, corners of shape (n, k, 3), grown by a radius; [m]."""
        n = len(corners)
        self.kind += [HULL] * n
        self.radius += [radius] * n
        self.n_points += [corners.shape[1]] * n
        self.points.append(corners.reshape(-1, 3))
        self.centres.append(corners.mean(axis=1))

    def add(self, piece: Piece) -> None:
        """Append a piece."""
        if isinstance(piece, Hull):
            self.kind.append(HULL)
            self.radius.append(piece.radius)
            self.n_points.append(len(piece.points))
            self.points.append(piece.points)
            self.centres.append(np.add.reduce(piece.points)[None] / len(piece.points))
            return
        self.flat[len(self.kind)] = piece
        self.n_points.append(0)
        if isinstance(piece, FlatCylinder):
            self.kind.append(CYLINDER)
            self.radius.append(piece.radius)
            self.centres.append(piece.centre[None])
        else:
            self.kind.append(HALF_SPACE)
            self.radius.append(0.0)
            self.centres.append((piece.offset * piece.normal)[None])


def _collect(obstacles: Sequence[Sequence[Piece]], orders: list[IntArray]) -> _Table:
    table = _Table()
    for group, order in zip(obstacles, orders, strict=True):
        if isinstance(group, Hulls):
            table.add_hulls(group.corners[order], group.radius)
        else:
            for k in order:
                table.add(group[k])
    return table


def _boxes(
    table: _Table, points: FloatArray, first_point: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corners of the pieces' boxes, shape (n, 3) each; [m]."""
    n = len(table.kind)
    low, high = np.full((n, 3), -np.inf), np.full((n, 3), np.inf)
    hulls = np.flatnonzero(np.array(table.kind, dtype=np.int64) == HULL)
    if hulls.size:
        # The other kinds have no points: hulls follow each other without a gap.
        start = first_point[hulls]
        radius = np.array(table.radius)[hulls, None]
        low[hulls] = np.minimum.reduceat(points, start) - radius
        high[hulls] = np.maximum.reduceat(points, start) + radius
    for k, piece in table.flat.items():
        if isinstance(piece, FlatCylinder):
            half = piece.half_length * np.abs(piece.axis)
            half = (half + piece.radius * disc_extent(piece.axis)) * HELD
            low[k], high[k] = piece.centre - half, piece.centre + half
    return low, high


def disc_extent(normal: FloatArray) -> FloatArray:
    """How far a disc of radius 1 reaches along each axis, to an ulp, shape (3,); [-].

    Args:
        normal: Of length 1, shape (3,); [-].
    """
    # Not sqrt(1 - normal^2), which loses half the digits along the normal.
    return np.hypot(normal[[2, 0, 1]], normal[[1, 2, 0]])


def _levels(n: int) -> list[tuple[IntArray, IntArray, IntArray]]:
    """Nodes over n pieces, level by level: their numbers, first and last pieces.

    Numbers go depth first: the left child follows its parent, the right one comes
    after the 2 k - 1 nodes over the k pieces of the left one.
    """
    node, first, last = np.zeros(1, np.int64), np.zeros(1, np.int64), np.full(1, n)
    levels = []
    while node.size:
        levels.append((node, first, last))
        inner = last - first > 1
        node, first, last = node[inner], first[inner], last[inner]
        middle = (first + last) // 2
        node = np.concatenate([node + 1, node + 2 * (middle - first)])
        first, last = np.concatenate([first, middle]), np.concatenate([middle, last])
    return levels


def _fill_tree(
    nodes: tuple[IntArray, IntArray, FloatArray, FloatArray],
    root: int,
    offset: int,
    boxes: tuple[FloatArray, FloatArray],
) -> None:
    """Write the nodes over one obstacle: ranges, right children, boxes.

    Args:
        nodes: Arrays of all nodes, to be written from `root` on.
        root: Number of the root.
        offset: Number of the obstacle's first piece.
        boxes: Of its pieces, shape (n, 3) each; [m].
    """
    ranges, rights, low, high = nodes
    for node, first, last in reversed(_levels(len(boxes[0]))):
        at, inner = root + node, last - first > 1
        ranges[at, 0], ranges[at, 1] = offset + first, offset + last
        leaf = ~inner
        low[at[leaf]], high[at[leaf]] = boxes[0][first[leaf]], boxes[1][first[leaf]]
        at, middle = at[inner], ((first + last) // 2)[inner]
        left, right = at + 1, at + 2 * (middle - first[inner])
        rights[at] = right
        low[at] = np.minimum(low[left], low[right])
        high[at] = np.maximum(high[left], high[right])


def first_groups(pieces: PackedPieces, count: int) -> PackedPieces:
    """The first so many obstacles of packed ones, as views."""
    n = int(pieces.first_piece[count])
    nodes = max(0, 2 * n - count)
    return PackedPieces(
        order=pieces.order[:n],
        kind=pieces.kind[:n],
        first_point=pieces.first_point[: n + 1],
        points=pieces.points[: pieces.first_point[n]],
        radius=pieces.radius[:n],
        centre=pieces.centre[:n],
        axis=pieces.axis[:n],
        extent=pieces.extent[:n],
        first_piece=pieces.first_piece[: count + 1],
        root=pieces.root[:count],
        node_range=pieces.node_range[:nodes],
        node_right=pieces.node_right[:nodes],
        node_low=pieces.node_low[:nodes],
        node_high=pieces.node_high[:nodes],
    )


def joined_pieces(first: PackedPieces, then: PackedPieces) -> PackedPieces:
    """Packed obstacles, then those of others; what counts in them counts on."""
    n_pieces, n_points = len(first.kind), len(first.points)
    shifts = {"root": len(first.node_range), "node_range": n_pieces}
    found = {
        name: np.concatenate([one, other + shifts.get(name, 0)])
        for name, one, other in zip(first._fields, first, then, strict=True)
    }
    right = then.node_right
    right = np.where(right < 0, right, right + len(first.node_range))
    return PackedPieces(**found)._replace(
        first_point=np.append(first.first_point, then.first_point[1:] + n_points),
        first_piece=np.append(first.first_piece, then.first_piece[1:] + n_pieces),
        node_right=np.append(first.node_right, right),
    )


def pack_pieces(obstacles: Sequence[Sequence[Piece]]) -> PackedPieces:
    """Pack the pieces of every obstacle, in the given order.

    Args:
        obstacles: The pieces of each obstacle.

    Returns:
        Flat arrays; empty ones for no obstacle.
    """
    orders = [_order(group) for group in obstacles]
    table = _collect(obstacles, orders)
    n = len(table.kind)
    axis, extent = np.zeros((n, 3)), np.zeros(n)
    points = np.ascontiguousarray(np.concatenate(table.points))
    first_point = np.cumsum([0, *table.n_points])
    low, high = _boxes(table, points, first_point)
    for k, piece in table.flat.items():
        if isinstance(piece, FlatCylinder):
            extent[k], axis[k] = piece.half_length, piece.axis
        else:
            extent[k], axis[k] = piece.offset, piece.normal
    sizes = np.array([len(group) for group in obstacles], dtype=np.int64)
    first_piece = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes)])
    # A tree over n pieces has 2 n - 1 nodes.
    root = 2 * first_piece[:-1] - np.arange(len(sizes))
    n_nodes = int(2 * first_piece[-1] - len(sizes))
    nodes = (
        np.zeros((n_nodes, 2), np.int64),
        np.full(n_nodes, -1, np.int64),
        np.zeros((n_nodes, 3)),
        np.zeros((n_nodes, 3)),
    )
    single, only = root[sizes == 1], first_piece[:-1][sizes == 1]
    nodes[0][single, 0], nodes[0][single, 1] = only, only + 1
    nodes[2][single], nodes[3][single] = low[only], high[only]
    for k in np.flatnonzero(sizes > 1).tolist():
        first, last = first_piece[k], first_piece[k + 1]
        _fill_tree(nodes, root[k], first, (low[first:last], high[first:last]))
    return PackedPieces(
        order=np.concatenate([np.zeros(0, np.int64), *orders]),
        kind=np.array(table.kind, dtype=np.int64),
        first_point=first_point.astype(np.int64),
        points=points,
        radius=np.array(table.radius, dtype=np.float64),
        centre=np.concatenate(table.centres),
        axis=axis,
        extent=extent,
        first_piece=first_piece,
        root=root,
        node_range=nodes[0],
        node_right=nodes[1],
        node_low=nodes[2],
        node_high=nodes[3],
    )
