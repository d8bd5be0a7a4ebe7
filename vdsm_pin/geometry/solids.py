"""Named solids, which are made of convex pieces.

Everything that measures a distance works on pieces (`geometry/convex.py`).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias, cast

import numpy as np

from vdsm_pin.geometry.arrays import (
    ByValue,
    FloatArray,
    IntArray,
    distinct_rows,
    frozen,
)
from vdsm_pin.geometry.closed_meshes import ClosedMesh, close_mesh
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Hulls, ends_of, placed_piece
from vdsm_pin.geometry.primitives import (
    BOX_CORNERS,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    NamedSolid,
    Prism,
    Sphere,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class FromFile(NamedSolid):
    """What stands in a file of its own.

    Args:
        assumed_size: Its size in words where neither its file nor the problem states
            a unit; else empty.
        notes: What else its file had, one phrase each.
    """

    assumed_size: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Mesh(FromFile):
    """Triangles, and the inside of the closed surface that they make.

    Args:
        vertices: Shape (n, 3), in the base frame; [m].
        triangles: Vertex indices, shape (m, 3), m >= 1.
        solid: Whether the problem says that there is an inside; None where it leaves
            that to the triangles.

    Example:
        >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        >>> faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> vp.Mesh("wedge", corners, faces).has_inside
        True
    """

    vertices: FloatArray
    triangles: IntArray
    solid: bool | None = None

    POINTS = ("vertices",)

    def __post_init__(self) -> None:
        """Freeze the arrays and check the indices."""
        super().__post_init__()
        self._check_rows("vertices")
        self._freeze("triangles", np.int64)
        triangles, count = self.triangles, len(self.vertices)
        self._check_rows("triangles")
        if not ((triangles >= 0) & (triangles < count)).all():
            self._refuse(f"triangles do not index {count} vertices")

    @cached_property
    def pieces(self) -> Hulls:
        """One hull per triangle."""
        return Hulls(self.vertices[self.triangles])

    @property
    def corners(self) -> FloatArray:
        """The corners of its triangles, shape (3 m, 3); [m]."""
        return np.asarray(self.vertices[self.triangles]).reshape(-1, 3)

    @cached_property
    def closed_mesh(self) -> ClosedMesh:
        """The closed surface that the triangles make, if they do."""
        return close_mesh(self.vertices, self.triangles)

    @cached_property
    def hull(self) -> "ConvexCover":
        """Its convex hull."""
        corners = distinct_rows(self.corners)
        return ConvexCover(self.name, (Hull(frozen(corners)),))

    @property
    def is_surface(self) -> bool:
        """Whether the problem says that nothing but the surface is meant."""
        return self.solid is False

    @property
    def has_inside(self) -> bool:
        """Whether an inside is asked for, and there is one."""
        return not self.is_surface and self.closed_mesh.closed


@dataclass(frozen=True, eq=False)
class ConvexCover(ByValue):
    """Convex pieces that hold a solid: a mesh's hull, or a link of another robot.

    Args:
        name: The solid's.
        pieces: The hull alone, or all that the link is made of.
    """

    name: str
    pieces: tuple[Hull | FlatCylinder, ...]

    def placed(self, pose: FloatArray) -> "ConvexCover":
        """It in another frame; `pose` is T_other_frame, shape (4, 4); [m]."""
        pieces = tuple(placed_piece(piece, pose) for piece in self.pieces)
        return ConvexCover(self.name, cast("tuple[Hull | FlatCylinder, ...]", pieces))

    @property
    def corners(self) -> FloatArray:
        """Those of its pieces, ends of cylinders among them, shape (n, 3); [m]."""
        return np.concatenate([ends_of(piece) for piece in self.pieces])

    @property
    def grown(self) -> float:
        """How far its surface lies off the hull of the corners, at most; [m]."""
        return max(piece.radius for piece in self.pieces)

    @property
    def reach(self) -> float:
        """Its largest distance from its frame's origin, at most; [m]."""
        return float(np.linalg.norm(self.corners, axis=1).max()) + self.grown


@dataclass(frozen=True, eq=False)
class PointCloud(FromFile):
    """Measured points, each a ball of the scan's error.

    Args:
        points: Shape (n, 3), n >= 1; [m].
        radius: Of the balls; [m].
    """

    points: FloatArray
    radius: float

    POINTS, SIZES = ("points",), ("radius",)

    def __post_init__(self) -> None:
        """Freeze the array and check its shape and the size."""
        super().__post_init__()
        self._check_rows("points")

    @cached_property
    def pieces(self) -> Hulls:
        """One ball per point."""
        return Hulls(self.points[:, None], self.radius)

    @property
    def grown(self) -> float:
        """The radius; [m]."""
        return self.radius


@dataclass(frozen=True, eq=False)
class Voxels(FromFile):
    """Occupied cells of a grid, each a cuboid; they need not touch.

    Args:
        centres: Shape (n, 3), n >= 1; [m].
        rotation: R_base_grid, shape (3, 3); [-].
        half_size: Half the edge lengths of a cell, shape (3,); [m].
    """

    centres: FloatArray
    rotation: FloatArray
    half_size: FloatArray

    POINTS, TURNED, SIZES = ("centres",), ("rotation",), ("half_size",)

    def __post_init__(self) -> None:
        """Freeze the arrays, check their shape and the sizes."""
        super().__post_init__()
        self._check_rows("centres")

    @cached_property
    def pieces(self) -> Hulls:
        """One cuboid per cell."""
        return Hulls(self._cells())

    @property
    def corners(self) -> FloatArray:
        """The corners of all cells, shape (8 n, 3); [m]."""
        return self._cells().reshape(-1, 3)

    @property
    def reach(self) -> float:
        """Not below that of any corner, without working out all of them; [m]."""
        far = float(np.linalg.norm(self.centres, axis=1).max())
        return far + float(np.linalg.norm(self.half_size))

    def _cells(self) -> FloatArray:
        corners = (BOX_CORNERS * self.half_size) @ self.rotation.T
        return np.asarray(self.centres[:, None] + corners)


__all__ = [
    "BOX_CORNERS",
    "Box",
    "Capsule",
    "ConvexCover",
    "Cylinder",
    "FromFile",
    "HalfSpace",
    "Mesh",
    "PointCloud",
    "Prism",
    "Solid",
    "Sphere",
    "Voxels",
]

Solid: TypeAlias = (
    Sphere | Capsule | Cylinder | Box | Prism | HalfSpace | Mesh | PointCloud | Voxels
)
