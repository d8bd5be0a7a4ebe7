"""The three kinds of convex piece that every solid is made of.

The hull of a few points grown by a radius, a flat-ended cylinder, and a half-space. A
sphere, capsule, box, convex prism and triangle are hulls.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, overload

import numpy as np

from vdsm_pin.geometry.arrays import ByValue, FloatArray, frozen


@dataclass(frozen=True, eq=False)
class FewCorners(ByValue):
    """Some corners of a hull that nearly span it.

    Args:
        points: Shape (n, 3); [m].
        missed: How far the hull's points are from theirs at most; [m].
    """

    points: FloatArray
    missed: float


@dataclass(frozen=True, eq=False)
class Hull(ByValue):
    """Convex hull of points, grown by a radius.

    Args:
        points: Shape (n, 3), n >= 1; [m].
        radius: 0 or more; [m].
        few: Some of its corners, where it has many, and more of them.
    """

    points: FloatArray
    radius: float = 0.0
    few: tuple[FewCorners, ...] = ()


@dataclass(frozen=True, eq=False)
class FlatCylinder(ByValue):
    """Solid cylinder with flat ends.

    Args:
        centre: Shape (3,); [m].
        axis: Unit vector, shape (3,); [-].
        half_length: Half the height; [m].
        radius: [m].
    """

    centre: FloatArray
    axis: FloatArray
    half_length: float
    radius: float


def ends_of(piece: Hull | FlatCylinder) -> FloatArray:
    """Corners of a hull, or the centres of a cylinder's ends, shape (n, 3); [m]."""
    if isinstance(piece, Hull):
        return piece.points
    along = piece.half_length * piece.axis
    return np.stack([piece.centre - along, piece.centre + along])


@dataclass(frozen=True, eq=False)
class HalfSpacePiece(ByValue):
    """Points p with normal . p <= offset.

    Args:
        normal: Outward unit vector, shape (3,); [-].
        offset: [m].
    """

    normal: FloatArray
    offset: float


Piece: TypeAlias = Hull | FlatCylinder | HalfSpacePiece


def placed_piece(piece: Piece, pose: FloatArray) -> Piece:
    """A piece in another frame; `pose` is T_other_frame, shape (4, 4); [m]."""
    turn, shift = pose[:3, :3], pose[:3, 3]
    if isinstance(piece, HalfSpacePiece):
        normal = turn @ piece.normal
        return HalfSpacePiece(normal, piece.offset + float(normal @ shift))
    if isinstance(piece, Hull):
        return Hull(frozen(piece.points @ turn.T + shift), piece.radius)
    centre, axis = frozen(turn @ piece.centre + shift), frozen(turn @ piece.axis)
    return replace(piece, centre=centre, axis=axis)


class Hulls(Sequence[Hull]):
    """Many hulls of as many points; each is made one only when it is asked for.

    Args:
        corners: Shape (n, k, 3): k is 3 for triangles, 1 for balls; [m].
        radius: By which all are grown; [m].
    """

    def __init__(self, corners: FloatArray, radius: float = 0.0) -> None:
        """Keep the corners, read-only."""
        self.corners, self.radius = frozen(corners), radius

    def __len__(self) -> int:
        """Number of hulls."""
        return len(self.corners)

    @overload
    def __getitem__(self, index: int) -> Hull: ...

    @overload
    def __getitem__(self, index: slice) -> "Hulls": ...

    def __getitem__(self, index: int | slice) -> "Hull | Hulls":
        """One hull, or some."""
        if isinstance(index, slice):
            return Hulls(self.corners[index], self.radius)
        return Hull(self.corners[index], self.radius)
