"""Solids of few numbers, and the convex pieces that they are made of."""

import re
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Final, NoReturn, Self

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import (
    ByValue,
    FloatArray,
    called,
    frozen,
    is_rotation,
    is_unit,
)
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Piece
from vdsm_pin.text import UNSEEN

BOX_CORNERS: Final = frozen(
    [[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
)
"""Corners of the cube [-1, 1]^3, shape (8, 3); [-]."""


_UNSEEN: Final = re.compile(f"[{UNSEEN}]")
_SHAPES: Final = (
    dict.fromkeys(("centre", "origin", "point", "axis", "normal", "half_size"), (3,))
    | dict.fromkeys(("radius", "half_length"), ())
    | {"rotation": (3, 3)}
)
"""Of the fields of solids that have one shape."""


@dataclass(frozen=True, eq=False)
class NamedSolid(ByValue):
    """What all solids have in common; each says which of its fields are what.

    Args:
        name: Unique name.
    """

    name: str

    POINTS: ClassVar[tuple[str, ...]]
    """Points, shape (.., 3); [m]."""
    TURNED: ClassVar[tuple[str, ...]] = ()
    """What turns with the frame: unit vectors and rotations; [-]."""
    SIZES: ClassVar[tuple[str, ...]] = ()
    """Above zero; [m]."""

    def __post_init__(self) -> None:
        """Freeze the arrays, check shapes, and that numbers are what they are to be."""
        if not isinstance(self.name, str) or _UNSEEN.search(self.name):
            message = f"name of a solid is {self.name!r}, expected signs that are seen"
            raise InvalidInput(message)
        for field in (*self.POINTS, *self.TURNED, *self.SIZES):
            self._freeze(field)
            value = getattr(self, field)
            if not np.isfinite(value).all():
                self._refuse(f"{field} is {value}, expected finite numbers")
            shape = _SHAPES.get(field, value.shape)
            if value.shape != shape:
                self._refuse(f"{field} has shape {value.shape}, expected {shape}")
            if not value.ndim:
                object.__setattr__(self, field, float(value))
        for field in self.TURNED:
            value = getattr(self, field)
            if value.ndim == 1 and not is_unit(value):
                self._refuse(f"{field} is {value}, expected a unit vector")
            if value.ndim == 2 and not is_rotation(value):
                self._refuse(f"{field} is {value.tolist()}, expected a rotation")
        for field in self.SIZES:
            value = getattr(self, field)
            if not (np.asarray(value) > 0.0).all():
                self._refuse(f"{field} is {value} m, expected above 0")

    def placed(self, pose: FloatArray) -> Self:
        """It in another frame; `pose` is T_other_frame, shape (4, 4); [m]."""
        turn, shift = pose[:3, :3], pose[:3, 3]
        moved = {name: getattr(self, name) @ turn.T + shift for name in self.POINTS}
        turned = {name: turn @ getattr(self, name) for name in self.TURNED}
        return replace(self, **moved, **turned)

    @property
    def corners(self) -> FloatArray:
        """Points whose hull, grown by `grown`, holds the solid, shape (n, 3); [m].

        Of a half-space the point that it is given by.
        """
        return np.asarray(getattr(self, self.POINTS[0])).reshape(-1, 3)

    @property
    def grown(self) -> float:
        """What to grow that hull by; [m]."""
        return 0.0

    @property
    def reach(self) -> float:
        """Largest distance of its corners, grown, from its frame's origin; [m]."""
        return float(np.linalg.norm(self.corners, axis=1).max()) + self.grown

    def _refuse(self, reason: str) -> NoReturn:
        message = f"obstacle {self.name!r}: {reason}"
        raise InvalidInput(message)

    def _freeze(self, field: str, dtype: type[Any] = np.float64) -> None:
        with called(f"obstacle {self.name!r}: {field}"):
            object.__setattr__(self, field, frozen(getattr(self, field), dtype))

    def _check_rows(self, field: str) -> None:
        rows = getattr(self, field)
        if rows.ndim != 2 or rows.shape[1:] != (3,) or not rows.size:
            self._refuse(f"{field} have shape {rows.shape}, expected (n, 3)")


@dataclass(frozen=True, eq=False)
class Sphere(NamedSolid):
    """A ball.

    Args:
        centre: Shape (3,); [m].
        radius: [m].

    Example:
        >>> vp.Sphere("ball", np.array([1.0, 0.5, 0.0]), 0.1).radius
        0.1
    """

    centre: FloatArray
    radius: float

    POINTS, SIZES = ("centre",), ("radius",)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (Hull(self.corners, self.radius),)

    @property
    def grown(self) -> float:
        """Its radius; [m]."""
        return self.radius


@dataclass(frozen=True, eq=False)
class _Axial(NamedSolid):
    """A solid of revolution."""

    centre: FloatArray
    axis: FloatArray
    half_length: float
    radius: float

    POINTS, TURNED, SIZES = ("centre",), ("axis",), ("radius", "half_length")

    @property
    def corners(self) -> FloatArray:
        """The centres of its ends, shape (2, 3); [m]."""
        offset = self.half_length * self.axis
        return frozen([self.centre - offset, self.centre + offset])

    @property
    def grown(self) -> float:
        """Its radius; [m]."""
        return self.radius


class Capsule(_Axial):
    """A segment grown by a radius.

    Args:
        centre: Shape (3,); [m].
        axis: Unit vector, shape (3,); [-].
        half_length: Half the distance between the centres of its ends; [m].
        radius: [m].

    Example:
        >>> rod = vp.Capsule("rod", np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.5, 0.02)
        >>> rod.corners.shape
        (2, 3)
    """

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (Hull(self.corners, self.radius),)


class Cylinder(_Axial):
    """A cylinder with flat ends.

    Args:
        centre: Shape (3,); [m].
        axis: Unit vector, shape (3,); [-].
        half_length: Half the height; [m].
        radius: [m].

    Example:
        >>> up = np.array([0.0, 0.0, 1.0])
        >>> vp.Cylinder("pillar", np.array([1.5, 0.4, 0.0]), up, 2.0, 0.1).half_length
        2.0
    """

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (FlatCylinder(self.centre, self.axis, self.half_length, self.radius),)


@dataclass(frozen=True, eq=False)
class Box(NamedSolid):
    """A cuboid.

    Args:
        centre: Shape (3,); [m].
        rotation: R_base_box, shape (3, 3); [-].
        half_size: Half the edge lengths, shape (3,); [m].

    Example:
        >>> box = vp.Box("crate", np.zeros(3), np.eye(3), np.array([0.2, 0.1, 0.1]))
        >>> float(box.corners[:, 0].max())
        0.2
    """

    centre: FloatArray
    rotation: FloatArray
    half_size: FloatArray

    POINTS, TURNED, SIZES = ("centre",), ("rotation",), ("half_size",)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (Hull(self.corners),)

    @property
    def corners(self) -> FloatArray:
        """Its corners, shape (8, 3); [m]."""
        return frozen(self.centre + (BOX_CORNERS * self.half_size) @ self.rotation.T)


@dataclass(frozen=True, eq=False)
class Prism(NamedSolid):
    """A simple polygon swept along its normal.

    Args:
        origin: Origin of the section frame, shape (3,); [m].
        rotation: R_base_section, shape (3, 3): columns are the section's two in-plane
            axes and the sweep axis; [-].
        polygon: Corners in the section plane, shape (n, 2), either sense; [m].
        span: Where the sweep starts and ends along the sweep axis; [m].

    Example:
        >>> section = np.array([[0.0, 0.0], [0.2, 0.0], [0.0, 0.1]])
        >>> wedge = vp.Prism("wedge", np.zeros(3), np.eye(3), section, (0.0, 0.5))
        >>> wedge.corners.shape
        (6, 3)
    """

    origin: FloatArray
    rotation: FloatArray
    polygon: FloatArray
    span: tuple[float, float]

    POINTS, TURNED = ("origin",), ("rotation",)

    def __post_init__(self) -> None:
        """Freeze the arrays and refuse polygons that enclose no simple area."""
        super().__post_init__()
        self._freeze("polygon")
        object.__setattr__(self, "span", tuple(frozen(self.span).tolist()))
        if not np.isfinite(self.polygon).all() or not np.isfinite(self.span).all():
            self._refuse("polygon and span have other than finite numbers")
        if self.polygon.shape != (max(len(self.polygon), 3), 2) or len(self.span) != 2:
            self._refuse("polygon needs at least 3 corners of 2 numbers, span 2 ends")
        import shapely  # slow to import, and only prisms need it

        shape = shapely.Polygon(self.polygon)
        if not shape.is_valid or not shape.area > 0.0:
            self._refuse(f"polygon is not simple ({shapely.is_valid_reason(shape)})")
        if not self.span[0] < self.span[1]:
            self._refuse(f"span {self.span} m, expected from < to")

    @cached_property
    def convex_sections(self) -> tuple[FloatArray, ...]:
        """The section as convex polygons, each of shape (k, 2); [m]."""
        import shapely

        shape = shapely.Polygon(self.polygon)
        if shape.equals(shape.convex_hull):
            return (frozen(self.polygon),)
        triangles = shapely.constrained_delaunay_triangles(shape)
        return tuple(
            frozen(np.asarray(part.exterior.coords)[:3]) for part in triangles.geoms
        )

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return tuple(Hull(self._swept(section)) for section in self.convex_sections)

    @property
    def corners(self) -> FloatArray:
        """Its corners, shape (n, 3); [m]."""
        return self._swept(self.polygon)

    def _swept(self, section: FloatArray) -> FloatArray:
        """The corners of a section at both ends of the sweep, shape (2 k, 3); [m]."""
        ends = [np.insert(section, 2, s, axis=1) for s in self.span]
        return frozen(self.origin + np.vstack(ends) @ self.rotation.T)


@dataclass(frozen=True, eq=False)
class HalfSpace(NamedSolid):
    """Everything on one side of a plane: (p - point) . normal <= 0.

    Args:
        point: A point of the plane, shape (3,); [m].
        normal: Unit vector out of the solid, shape (3,); [-].

    Example:
        >>> floor = vp.HalfSpace("floor", np.zeros(3), np.array([0.0, 0.0, 1.0]))
        >>> floor.name
        'floor'
    """

    point: FloatArray
    normal: FloatArray

    POINTS, TURNED = ("point",), ("normal",)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (HalfSpacePiece(self.normal, float(self.normal @ self.point)),)
