"""Proof that two bodies meet: a ball that lies in both.

The clearance of two hulls that meet is known to be 0 at most, which refutes no required
clearance of 0. A climb finds a point that is deep in both; the corners of a small
icosahedron around it are proved to lie in a piece of each, so its ball does too. Of a
piece without an inside, as a triangle is, the ball is about a point of it and lies in
the other body.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import (
    FlatCylinder,
    HalfSpacePiece,
    Hull,
    Hulls,
    Piece,
    placed_piece,
)
from vdsm_pin.geometry.depths import (
    CAPSULE,
    CYLINDER,
    PLANES,
    Inside,
    climb,
    deepest_of,
)
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.proof.tree import IDENTITY
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_hulls import hull_planes

GOLDEN: Final = (1.0 + 5.0**0.5) / 2.0
CORNERS: Final = np.array(
    [
        np.roll([0.0, i, j * GOLDEN], k) / (1.0 + GOLDEN**2) ** 0.5
        for i, j, k in product((-1, 1), (-1, 1), range(3))
    ]
)
"""Of an icosahedron about the origin, shape (12, 3): unit vectors."""

INNER: Final = 0.7946
"""Radius of a ball that it holds: its own inner one is sqrt((5 + 2 sqrt(5)) / 15)."""

SHARES: Final = (0.9, 0.5, 0.1)
"""Sizes that are tried, as parts of the depth that was climbed to; [-]."""

MOST_PIECES: Final = 64
"""Of bodies of more pieces those nearest to the witness are looked at."""

KEPT: Final = 128
"""Hulls whose planes are kept."""


MEETING: Final = 2.0 * TOLERANCES.bracket_gap
"""Bodies that come so near may meet; [m]."""

NEXT: Final = 0.01
"""From the moment at which bodies meet to the next one that is looked at; [-]."""

BESIDE: Final = NEXT * np.array([0.0, 1.0, -1.0, 5.0, -5.0])
"""Where a ball in both is looked for, beside the moment at which bodies meet; [-]."""

HALVINGS: Final = 12
"""Of steps to deeper moments where bodies meet for a shorter while; [-]."""


class Placed(NamedTuple):
    """Pieces of a body in a frame that stands somewhere in the world.

    Args:
        pieces: In the frame.
        pose: T_world_frame, shape (4, 4); [m].
    """

    pieces: Sequence[Piece]
    pose: FloatArray = IDENTITY


def common_ball(
    one: Placed, other: Placed, point: FloatArray, enough: float = np.inf
) -> tuple[float, FloatArray]:
    """A ball proved to lie in a piece of each body.

    Args:
        one: A body.
        other: The other one.
        point: Where it is looked for first, in the world, shape (3,); [m].
        enough: Depth beyond which none deeper is looked for; [m].

    Returns:
        Radius, 0 if none is found, and centre; [m]. Where one of the pieces has no
        inside the centre is in it and the ball in the other.
    """
    if not np.isfinite(point).all():
        return 0.0, point
    lost = TOLERANCES.bracket_gap + TOLERANCES.arithmetic
    for mine, theirs in _meeting(one, other, point):
        thick = [near.piece for near in (mine, theirs) if near.inside is not None]
        depth, centre = _deepest(mine, theirs, point, enough)
        for share in SHARES:
            radius = INNER * share * depth - lost
            if radius > 0.0 and _hold(thick, centre + share * depth * CORNERS, lost):
                return radius, centre
    return 0.0, point


def seeming_depth(one: Placed, other: Placed, point: FloatArray) -> float:
    """How deep a point seems to lie in a piece of each body at most; [m].

    It is below 0 where they seem apart, -inf where not even their boxes meet. Arguments
    are those of `common_ball`.
    """
    if not np.isfinite(point).all():
        return -np.inf
    pairs = _meeting(one, other, point)
    depths = (_deepest(*pair, point, np.inf)[0] for pair in pairs)
    return max(depths, default=-np.inf)


class _Near:
    """A piece in the world and its inside, worked out when it is asked for.

    Args:
        own: The piece in its frame.
        pose: T_world_frame, shape (4, 4); [m].
    """

    def __init__(self, own: Piece, pose: FloatArray) -> None:
        self._own, self._pose = own, pose
        self.piece = placed_piece(own, pose)

    @cached_property
    def inside(self) -> Inside | None:
        """What bounds it; None of one without an inside."""
        piece = self.piece
        if isinstance(piece, HalfSpacePiece):
            normals, offsets = piece.normal[None].copy(), np.array([piece.offset])
            return Inside(PLANES, 0.0, normals, offsets)
        if isinstance(piece, FlatCylinder):
            spine = np.array([piece.centre, piece.axis])
            length = piece.half_length
            return Inside(CYLINDER, piece.radius, spine=spine, half_length=length)
        first, last = piece.points[0], piece.points[-1]
        if len(piece.points) <= 2 and piece.radius > 0.0:
            spine = np.array([first, last - first])
            return Inside(CAPSULE, piece.radius, spine=spine)
        assert isinstance(self._own, Hull)
        planes = _planes(np.asarray(self._own.points, np.float64).tobytes())
        if planes is None:
            return None
        normals = planes[0] @ self._pose[:3, :3].T
        offsets = planes[1] + normals @ self._pose[:3, 3]
        return Inside(PLANES, piece.radius, normals, offsets)


@lru_cache(maxsize=KEPT)
def _planes(content: bytes) -> tuple[FloatArray, FloatArray] | None:
    """The planes of the hull of points, given as their bytes."""
    return hull_planes(np.frombuffer(content).reshape(-1, 3))


def _near(body: Placed, point: FloatArray) -> list[_Near]:
    """The pieces of a body that are nearest to a point of the world."""
    seen = (point - body.pose[:3, 3]) @ body.pose[:3, :3]
    return [_Near(piece, body.pose) for piece in nearest_pieces(body.pieces, seen)]


def _meeting(
    one: Placed, other: Placed, point: FloatArray
) -> Iterator[tuple[_Near, _Near]]:
    """Pieces near a point whose boxes meet, of which one at least has an inside."""
    mine, theirs = _near(one, point), _near(other, point)
    (low, high), (least, most) = (
        np.swapaxes([_box(near.piece) for near in some], 0, 1)
        for some in (mine, theirs)
    )
    meet = (low[:, None] <= most) & (least <= high[:, None])
    for j, k in np.argwhere(meet.all(axis=2)).tolist():
        if mine[j].inside is not None or theirs[k].inside is not None:
            yield mine[j], theirs[k]


def _deepest(
    one: _Near, other: _Near, point: FloatArray, enough: float
) -> tuple[float, FloatArray]:
    """A point deep in two pieces of which one at least has an inside; how deep."""
    where = np.zeros(3)
    if one.inside is not None and other.inside is not None:
        return climb(one.inside, other.inside, np.array(point), enough, where), where
    flat, thick = (one, other.inside) if one.inside is None else (other, one.inside)
    assert isinstance(flat.piece, Hull) and thick is not None  # all others have one
    return deepest_of(np.array(flat.piece.points), thick, where), where


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
    """Two corners of a box that holds a piece."""
    if isinstance(piece, HalfSpacePiece):
        return np.full(3, -np.inf), np.full(3, np.inf)
    if isinstance(piece, Hull):
        low, high = piece.points.min(axis=0), piece.points.max(axis=0)
        return low - piece.radius, high + piece.radius
    reach = piece.half_length + piece.radius
    return piece.centre - reach, piece.centre + reach


def _hold(pieces: Sequence[Piece], corners: FloatArray, lost: float) -> bool:
    """Whether each piece holds all corners, to within what is lost."""
    ends = np.repeat(np.tile(corners, (len(pieces), 1))[:, None], 2, axis=1)
    number = np.repeat(np.arange(len(pieces)), len(corners))
    packed = pack_pieces([[piece] for piece in pieces])
    off = row_brackets(packed, ends, number, TOLERANCES.bracket_gap)[:, 1]
    return bool((off <= lost).all())
