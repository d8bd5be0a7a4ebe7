"""Proof that two bodies meet: a ball that lies in both.

The clearance of two hulls that meet is known to be 0 at most, which refutes no required
clearance of 0. Coal proposes a point in both; the corners of a small tetrahedron around
it are proved to lie in a piece of each, so its ball does too.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Piece
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.tolerances import TOLERANCES

CORNERS: Final = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 3**0.5
"""Of a tetrahedron about the origin whose inner ball has a third of their distance."""

SHARES: Final = (0.5, 0.2, 0.05, 0.01)
"""Sizes that are tried, as parts of the depth that Coal measures; [-]."""

MOST_PIECES: Final = 64
"""Of bodies of more pieces no common ball is looked for."""


def common_ball(
    one: Sequence[Piece], other: Sequence[Piece], point: FloatArray, depth: float
) -> float:
    """Radius of a ball proved to lie in a piece of each body; 0 if none is found; [m].

    Args:
        one: Pieces in the world's frame.
        other: Of the other body.
        point: Where it is looked for, shape (3,); [m].
        depth: How deep the bodies seem to meet; [m].
    """
    if max(len(one), len(other)) > MOST_PIECES or not np.isfinite(point).all():
        return 0.0
    lost = TOLERANCES.bracket_gap + TOLERANCES.arithmetic
    for share in SHARES:
        size = share * depth
        corners = point + size * CORNERS
        radius = size / 3.0 - lost
        if radius > 0.0 and _hold(one, corners, lost) and _hold(other, corners, lost):
            return radius
    return 0.0


def _hold(pieces: Sequence[Piece], corners: FloatArray, lost: float) -> bool:
    """Whether one of the pieces holds all corners, to within what is lost."""
    n = len(pieces)
    packed = pack_pieces([[piece] for piece in pieces])
    ends = np.ascontiguousarray(np.repeat(np.tile(corners, (n, 1))[:, None], 2, axis=1))
    number = np.repeat(np.arange(n), len(corners))
    off = row_brackets(packed, ends, number, TOLERANCES.bracket_gap)[:, 1]
    return bool((off.reshape(n, -1) <= lost).all(axis=1).any())


def in_world(pieces: Sequence[Piece], placement: FloatArray) -> list[Piece]:
    """Pieces of a link where it stands.

    Args:
        pieces: In the frame of the link.
        placement: T_world_link, shape (4, 4); [m].
    """
    turn, shift = placement[:3, :3], placement[:3, 3]
    found: list[Piece] = []
    for piece in pieces:
        assert not isinstance(piece, HalfSpacePiece)  # links have none
        if isinstance(piece, Hull):
            found.append(Hull(piece.points @ turn.T + shift, piece.radius))
            continue
        centre, axis = turn @ piece.centre + shift, turn @ piece.axis
        found.append(FlatCylinder(centre, axis, piece.half_length, piece.radius))
    return found
