"""Proof that two bodies meet: a ball that lies in both.

The clearance of two hulls that meet is known to be 0 at most, which refutes no required
clearance of 0. A climb finds a point that is deep in both; the corners of a small
tetrahedron around it are proved to lie in a piece of each, so its ball does too. Of a
piece without an inside, as a triangle is, the ball is about a point of it and lies in
the other body.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Hulls, Piece
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.robots.hulls import hull_planes
from vdsm_pin.tolerances import TOLERANCES

CORNERS: Final = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
"""Of a tetrahedron about the origin whose inner ball has a third of their distance."""

SHARES: Final = (0.9, 0.5, 0.1)
"""Sizes that are tried, as parts of the depth that was climbed to; [-]."""

MOST_PIECES: Final = 64
"""Of bodies of more pieces those nearest to the witness are looked at."""

STEPS: Final = 200
"""Of a climb."""

SHORTER: Final = 0.97
"""How much shorter each step is than the one before; [-]."""

FIRST_RATE: Final = 10.0
"""Of the weights of corners; [-]."""

LEAST_WEIGHT: Final = 1e-9
"""Of a corner, so that it can grow again; [-]."""

Slack: TypeAlias = Callable[[FloatArray], tuple[float, FloatArray]]
"""How deep a point lies in a piece, at most, and the way to lie deeper; [m], [-]."""


def common_ball(
    one: Sequence[Piece],
    other: Sequence[Piece],
    point: FloatArray,
    enough: float = np.inf,
) -> tuple[float, FloatArray]:
    """A ball proved to lie in a piece of each body.

    Args:
        one: Pieces in the world's frame.
        other: Of the other body.
        point: Where it is looked for first, shape (3,); [m].
        enough: Depth beyond which none deeper is looked for; [m].

    Returns:
        Radius, 0 if none is found, and centre; [m]. Where one of the pieces has no
        inside the centre is in it and the ball in the other.
    """
    if not np.isfinite(point).all():
        return 0.0, point
    lost = TOLERANCES.bracket_gap + TOLERANCES.arithmetic
    near = [
        [(piece, _slack(piece)) for piece in nearest_pieces(body, point)]
        for body in (one, other)
    ]
    for both in product(*near):
        if not _may_meet(both[0][0], both[1][0]):
            continue
        thick = [(piece, slack) for piece, slack in both if slack is not None]
        if not thick:
            continue
        if len(thick) == 2:
            depth, centre = _climb((thick[0][1], thick[1][1]), point, enough)
        else:
            (flat,) = (piece for piece, slack in both if slack is None)
            assert isinstance(flat, Hull)  # all others have an inside
            depth, centre = _deepest_of(flat.points, thick[0][1])
        for share in SHARES:
            corners = centre + share * depth * CORNERS
            radius = share * depth / 3.0 - lost
            if radius > 0.0 and all(_holds(piece, corners, lost) for piece, _ in thick):
                return radius, centre
    return 0.0, point


def nearest_pieces(pieces: Sequence[Piece], point: FloatArray) -> list[Piece]:
    """All pieces, or of many those whose boxes are nearest to a point."""
    if len(pieces) <= MOST_PIECES:
        return list(pieces)
    if isinstance(pieces, Hulls):
        low, high = pieces.corners.min(axis=1), pieces.corners.max(axis=1)
    else:
        boxes = np.array([_box(piece) for piece in pieces])
        low, high = boxes[:, 0], boxes[:, 1]
    gaps = np.linalg.norm(
        np.maximum(np.maximum(low - point, point - high), 0.0), axis=1
    )
    nearest = np.argsort(gaps, kind="stable")[:MOST_PIECES]
    return [pieces[k] for k in nearest.tolist()]


def _box(piece: Piece) -> tuple[FloatArray, FloatArray]:
    """Two corners of a box that holds a piece with bounds."""
    if isinstance(piece, Hull):
        return piece.points.min(axis=0), piece.points.max(axis=0)
    assert isinstance(piece, FlatCylinder)  # a half-space is alone
    reach = piece.half_length + piece.radius
    return piece.centre - reach, piece.centre + reach


def _may_meet(one: Piece, other: Piece) -> bool:
    """Whether the boxes of two pieces meet."""
    if isinstance(one, HalfSpacePiece) or isinstance(other, HalfSpacePiece):
        return True
    (low, high), (least, most) = _box(one), _box(other)
    grown = sum(piece.radius for piece in (one, other) if isinstance(piece, Hull))
    return bool((low <= most + grown).all() and (least <= high + grown).all())


def _deepest_of(points: FloatArray, slack: Slack) -> tuple[float, FloatArray]:
    """The point of a flat hull that lies deepest in a piece, as far as steps find it.

    The weights of its corners grow with how far each lies up the slope.
    """
    weights = np.full(len(points), 1.0 / len(points))
    best, where, rate = -np.inf, points[0], FIRST_RATE
    size = max(float(np.ptp(points, axis=0).max()), TOLERANCES.arithmetic)
    for _ in range(STEPS):
        at = weights @ points
        depth, way = slack(at)
        if depth > best:
            best, where = depth, at
        up = points @ way / size
        weights = np.maximum(weights * np.exp(rate * (up - up.max())), LEAST_WEIGHT)
        weights, rate = weights / weights.sum(), SHORTER * rate
    return best, where


def _climb(
    slacks: tuple[Slack, Slack], start: FloatArray, enough: float
) -> tuple[float, FloatArray]:
    """The deepest point that steps along slopes find, and how deep it seems to lie.

    The lesser of two concave depths is concave: shortening steps up its slope lead near
    its top, and steps up both slopes at once along the ridge on which both are equal.
    """
    best, where = -np.inf, start
    longest = max(1e-3, *(abs(slack(start)[0]) for slack in slacks))
    if not np.isfinite(longest):
        return best, where
    for along_ridge in (False, True):
        at, step = where, longest
        for _ in range(STEPS):
            found = [slack(at) for slack in slacks]
            depth, way = min(found, key=lambda one: one[0])
            if depth > best:
                best, where = depth, at
                if best > enough:
                    return best, where
            elif along_ridge:
                at, found = where, [slack(where) for slack in slacks]
            both = found[0][1] + found[1][1]
            size = float(both @ both) ** 0.5
            level = abs(found[0][0] - found[1][0]) <= step
            if along_ridge and level and size > 0.0:
                way = both / size
            at, step = at + step * way, SHORTER * step
    return best, where


def _slack(piece: Piece) -> Slack | None:
    """How deep points lie in a piece; None of one without an inside."""
    if isinstance(piece, HalfSpacePiece):
        return lambda x: (piece.offset - float(piece.normal @ x), -piece.normal)
    if isinstance(piece, FlatCylinder):
        return lambda x: _in_cylinder(piece, x)
    if len(piece.points) <= 2 and piece.radius > 0.0:
        return lambda x: _in_capsule(piece, x)
    planes = hull_planes(piece.points)
    if planes is None:
        return None
    normals, offsets = planes
    inward = -normals

    def in_hull(x: FloatArray) -> tuple[float, FloatArray]:
        rooms = offsets - normals @ x
        k = int(rooms.argmin())
        return float(rooms[k]) + piece.radius, inward[k]

    return in_hull


def _in_cylinder(piece: FlatCylinder, x: FloatArray) -> tuple[float, FloatArray]:
    along = float(piece.axis @ (x - piece.centre))
    across = x - piece.centre - along * piece.axis
    far = float(np.linalg.norm(across))
    end, side = piece.half_length - abs(along), piece.radius - far
    if end < side:
        return end, -np.copysign(1.0, along) * piece.axis
    return side, -across / far if far > 0.0 else np.zeros(3)


def _in_capsule(piece: Hull, x: FloatArray) -> tuple[float, FloatArray]:
    first, way = piece.points[0], piece.points[-1] - piece.points[0]
    length = float(way @ way)
    share = float(np.clip((x - first) @ way / length, 0.0, 1.0)) if length else 0.0
    off = first + share * way - x
    far = float(np.linalg.norm(off))
    return piece.radius - far, off / far if far > 0.0 else np.zeros(3)


def _holds(piece: Piece, corners: FloatArray, lost: float) -> bool:
    """Whether a piece holds all corners, to within what is lost."""
    ends = np.ascontiguousarray(np.repeat(corners[:, None], 2, axis=1))
    none = np.zeros(len(corners), np.int64)
    packed = pack_pieces([[piece]])
    off = row_brackets(packed, ends, none, TOLERANCES.bracket_gap)[:, 1]
    return bool((off <= lost).all())


def in_world(pieces: Sequence[Piece], placement: FloatArray) -> Iterator[Piece]:
    """Pieces of a body where it stands.

    Args:
        pieces: In the frame that it rides on.
        placement: T_world_frame, shape (4, 4); [m].
    """
    turn, shift = placement[:3, :3], placement[:3, 3]
    for piece in pieces:
        if isinstance(piece, HalfSpacePiece):
            normal = turn @ piece.normal
            yield HalfSpacePiece(normal, piece.offset + float(normal @ shift))
        elif isinstance(piece, Hull):
            yield Hull(piece.points @ turn.T + shift, piece.radius)
        else:
            centre, axis = turn @ piece.centre + shift, turn @ piece.axis
            yield FlatCylinder(centre, axis, piece.half_length, piece.radius)
