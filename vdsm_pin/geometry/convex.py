"""The three kinds of convex piece that every solid is made of.

The hull of a few points grown by a radius, a flat-ended cylinder, and a half-space. A
sphere, capsule, box, convex prism and triangle are hulls.
"""

from dataclasses import dataclass
from typing import TypeAlias

from vdsm_pin.geometry.arrays import FloatArray


@dataclass(frozen=True)
class Hull:
    """Convex hull of points, grown by a radius.

    Args:
        points: Shape (n, 3), n >= 1; [m].
        radius: 0 or more; [m].
    """

    points: FloatArray
    radius: float = 0.0


@dataclass(frozen=True)
class FlatCylinder:
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


@dataclass(frozen=True)
class HalfSpacePiece:
    """Points p with normal . p <= offset.

    Args:
        normal: Outward unit vector, shape (3,); [-].
        offset: [m].
    """

    normal: FloatArray
    offset: float


Piece: TypeAlias = Hull | FlatCylinder | HalfSpacePiece
