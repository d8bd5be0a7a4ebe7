"""Obstacles: named solids in the base frame, and the convex pieces they are made of.

Everything that measures a distance works on pieces (`geometry/convex.py`). A mesh is
one hull per triangle plus, where they close (`geometry/closed_meshes.py`), an inside.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, TypeAlias, cast

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct, frozen
from vdsm_pin.geometry.closed_meshes import ClosedMesh, close_mesh
from vdsm_pin.geometry.convex import (
    FlatCylinder,
    HalfSpacePiece,
    Hull,
    Hulls,
    Piece,
)
from vdsm_pin.proof.tree import Kind, Tree
from vdsm_pin.tolerances import TOLERANCES

if TYPE_CHECKING:  # it brings compiled code, for which readers need not wait
    from vdsm_pin.geometry.pieces import PackedPieces
    from vdsm_pin.proof.paths import Path

BOX_CORNERS: Final = frozen(
    [[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
)
"""Corners of the cube [-1, 1]^3, shape (8, 3); [-]."""


def _check_finite(name: str, **values: object) -> None:
    for field, value in values.items():
        if not np.isfinite(np.asarray(value, dtype=float)).all():
            message = f"obstacle {name!r}: {field} is {value}, expected finite numbers"
            raise InvalidInput(message)


def _check_positive(name: str, **values: float) -> None:
    for field, value in values.items():
        if not value > 0.0:
            message = f"obstacle {name!r}: {field} is {value} m, expected above 0"
            raise InvalidInput(message)


def _check_rows(name: str, rows: FloatArray, field: str) -> None:
    if rows.ndim != 2 or rows.shape[1:] != (3,) or not rows.size:
        message = f"obstacle {name!r}: {field} have shape {rows.shape}, expected (n, 3)"
        raise InvalidInput(message)
    if not np.isfinite(rows).all():
        message = f"obstacle {name!r}: {field} are not all finite numbers"
        raise InvalidInput(message)


def _freeze(obstacle: object, *fields: str) -> None:
    for field in fields:
        object.__setattr__(obstacle, field, frozen(getattr(obstacle, field)))


@dataclass(frozen=True)
class Sphere:
    """A ball.

    Args:
        name: Unique name.
        centre: Shape (3,); [m].
        radius: [m].
    """

    name: str
    centre: FloatArray
    radius: float

    def __post_init__(self) -> None:
        """Freeze the array and check the sizes."""
        _freeze(self, "centre")
        _check_finite(self.name, centre=self.centre, radius=self.radius)
        _check_positive(self.name, radius=self.radius)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (Hull(frozen(self.centre[None]), self.radius),)


@dataclass(frozen=True)
class Capsule:
    """A segment grown by a radius.

    Args:
        name: Unique name.
        centre: Shape (3,); [m].
        axis: Unit vector, shape (3,); [-].
        half_length: Half the distance between the cap centres; [m].
        radius: [m].
    """

    name: str
    centre: FloatArray
    axis: FloatArray
    half_length: float
    radius: float

    def __post_init__(self) -> None:
        """Freeze the arrays and check the sizes."""
        _freeze(self, "centre", "axis")
        _check_finite(self.name, centre=self.centre, axis=self.axis)
        _check_positive(self.name, radius=self.radius, half_length=self.half_length)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        offset = self.half_length * self.axis
        return (
            Hull(frozen([self.centre - offset, self.centre + offset]), self.radius),
        )


@dataclass(frozen=True)
class Cylinder:
    """A cylinder with flat ends.

    Args:
        name: Unique name.
        centre: Shape (3,); [m].
        axis: Unit vector, shape (3,); [-].
        half_length: Half the height; [m].
        radius: [m].
    """

    name: str
    centre: FloatArray
    axis: FloatArray
    half_length: float
    radius: float

    def __post_init__(self) -> None:
        """Freeze the arrays and check the sizes."""
        _freeze(self, "centre", "axis")
        _check_finite(self.name, centre=self.centre, axis=self.axis)
        _check_positive(self.name, radius=self.radius, half_length=self.half_length)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (FlatCylinder(self.centre, self.axis, self.half_length, self.radius),)


@dataclass(frozen=True)
class Box:
    """A cuboid.

    Args:
        name: Unique name.
        centre: Shape (3,); [m].
        rotation: R_base_box, shape (3, 3); [-].
        half_size: Half the edge lengths, shape (3,); [m].
    """

    name: str
    centre: FloatArray
    rotation: FloatArray
    half_size: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays and check the sizes."""
        _freeze(self, "centre", "rotation", "half_size")
        _check_finite(self.name, centre=self.centre, rotation=self.rotation)
        for value in self.half_size:
            _check_positive(self.name, half_size=float(value))

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        corners = self.centre + (BOX_CORNERS * self.half_size) @ self.rotation.T
        return (Hull(frozen(corners)),)


@dataclass(frozen=True)
class Prism:
    """A simple polygon swept along its normal.

    Args:
        name: Unique name.
        origin: Origin of the section frame, shape (3,); [m].
        rotation: R_base_section, shape (3, 3): columns are the section's two in-plane
            axes and the sweep axis; [-].
        polygon: Corners in the section plane, shape (n, 2), either sense; [m].
        span: Where the sweep starts and ends along the sweep axis; [m].
    """

    name: str
    origin: FloatArray
    rotation: FloatArray
    polygon: FloatArray
    span: tuple[float, float]

    def __post_init__(self) -> None:
        """Freeze the arrays and refuse polygons that enclose no simple area."""
        _freeze(self, "origin", "rotation", "polygon")
        _check_finite(
            self.name, origin=self.origin, polygon=self.polygon, span=self.span
        )
        if self.polygon.ndim != 2 or self.polygon.shape[0] < 3:
            message = f"obstacle {self.name!r}: polygon needs at least 3 corners"
            raise InvalidInput(message)
        import shapely  # slow to import, and only prisms need it

        shape = shapely.Polygon(self.polygon)
        if not shape.is_valid or not shape.area > 0.0:
            reason = shapely.is_valid_reason(shape)
            message = f"obstacle {self.name!r}: polygon is not simple ({reason})"
            raise InvalidInput(message)
        if not self.span[0] < self.span[1]:
            message = f"obstacle {self.name!r}: span {self.span} m, expected from < to"
            raise InvalidInput(message)

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
        hulls = []
        for section in self.convex_sections:
            ends = [
                np.column_stack([section, np.full(len(section), s)]) for s in self.span
            ]
            hulls.append(Hull(frozen(self.origin + np.vstack(ends) @ self.rotation.T)))
        return tuple(hulls)


@dataclass(frozen=True)
class HalfSpace:
    """Everything on one side of a plane: (p - point) . normal <= 0.

    Args:
        name: Unique name.
        point: A point of the plane, shape (3,); [m].
        normal: Unit vector out of the solid, shape (3,); [-].
    """

    name: str
    point: FloatArray
    normal: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        _freeze(self, "point", "normal")
        _check_finite(self.name, point=self.point, normal=self.normal)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """The convex pieces."""
        return (HalfSpacePiece(self.normal, float(self.normal @ self.point)),)


@dataclass(frozen=True)
class Mesh:
    """Triangles, and the inside of the closed surface that they make.

    Args:
        name: Unique name.
        vertices: Shape (n, 3), in the base frame; [m].
        triangles: Vertex indices, shape (m, 3), m >= 1.
        solid: Whether the problem says that there is an inside; None where it leaves
            that to the triangles.
        assumed_size: Its size in words where neither its file nor the problem states
            a unit; else empty.
        notes: What else its file had, one phrase each.
    """

    name: str
    vertices: FloatArray
    triangles: IntArray
    solid: bool | None = None
    assumed_size: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Freeze the arrays and check the indices."""
        _freeze(self, "vertices")
        object.__setattr__(self, "triangles", frozen(self.triangles, np.int64))
        _check_finite(self.name, vertices=self.vertices)
        count = len(self.vertices)
        if (
            not self.triangles.size
            or not ((self.triangles >= 0) & (self.triangles < count)).all()
        ):
            message = f"obstacle {self.name!r}: triangles do not index {count} vertices"
            raise InvalidInput(message)

    @cached_property
    def pieces(self) -> Hulls:
        """One hull per triangle."""
        return Hulls(self.vertices[self.triangles])

    @cached_property
    def closed_mesh(self) -> ClosedMesh:
        """The closed surface that the triangles make, if they do."""
        return close_mesh(self.vertices, self.triangles)

    @cached_property
    def hull(self) -> "ConvexCover":
        """Its convex hull."""
        corners = self.vertices[self.triangles].reshape(-1, 3)
        return ConvexCover(self.name, (Hull(frozen(distinct(corners, axis=0))),))

    @property
    def is_surface(self) -> bool:
        """Whether the problem says that nothing but the surface is meant."""
        return self.solid is False

    @property
    def has_inside(self) -> bool:
        """Whether an inside is asked for, and there is one."""
        return not self.is_surface and self.closed_mesh.closed


@dataclass(frozen=True)
class ConvexCover:
    """The convex hull of a mesh: its inside lies within, whatever counts as inside.

    Args:
        name: The mesh's.
        pieces: The hull alone.
    """

    name: str
    pieces: tuple[Hull]


@dataclass(frozen=True)
class PointCloud:
    """Measured points, each a ball of the scan's error.

    Args:
        name: Unique name.
        points: Shape (n, 3), n >= 1; [m].
        radius: Of the balls; [m].
        assumed_size: As of a mesh.
        notes: As of a mesh.
    """

    name: str
    points: FloatArray
    radius: float
    assumed_size: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Freeze the array and check the sizes."""
        _freeze(self, "points")
        _check_rows(self.name, self.points, "points")
        _check_finite(self.name, radius=self.radius)
        _check_positive(self.name, radius=self.radius)

    @cached_property
    def pieces(self) -> Hulls:
        """One ball per point."""
        return Hulls(self.points[:, None], self.radius)


@dataclass(frozen=True)
class Voxels:
    """Occupied cells of a grid, each a cuboid; they need not touch.

    Args:
        name: Unique name.
        centres: Shape (n, 3), n >= 1; [m].
        rotation: R_base_grid, shape (3, 3); [-].
        half_size: Half the edge lengths of a cell, shape (3,); [m].
        assumed_size: As of a mesh.
        notes: As of a mesh.
    """

    name: str
    centres: FloatArray
    rotation: FloatArray
    half_size: FloatArray
    assumed_size: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Freeze the arrays and check the sizes."""
        _freeze(self, "centres", "rotation", "half_size")
        _check_rows(self.name, self.centres, "centres")
        _check_finite(self.name, rotation=self.rotation)
        for value in self.half_size:
            _check_positive(self.name, half_size=float(value))

    @cached_property
    def pieces(self) -> Hulls:
        """One cuboid per cell."""
        corners = (BOX_CORNERS * self.half_size) @ self.rotation.T
        return Hulls(self.centres[:, None] + corners)


FromFile: TypeAlias = Mesh | PointCloud | Voxels
"""Obstacles that stand in files of their own."""

Solid: TypeAlias = Sphere | Capsule | Cylinder | Box | Prism | HalfSpace | FromFile


@dataclass(frozen=True, eq=False)
class Carrier:
    """Joints that carry obstacles about as time goes by.

    Args:
        tree: The joints, hung on the base's frame.
        path: How they move, with times; at rest before and after.
    """

    tree: Tree
    path: "Path"

    def poses(self, times: FloatArray) -> FloatArray:
        """T_base_frame of all frames at some times (m,), (m, n_frames, 4, 4); [m]."""
        return self.tree.poses(self.path.at(times))

    @cached_property
    def reach(self) -> float:
        """No frame is ever farther from the base's origin than this; [m]."""
        far, most = 0.0, self.path.reach
        for joint in self.tree.joints:
            far += float(np.linalg.norm(np.asarray(joint.placement)[:3, 3]))
            if joint.kind is Kind.PRISMATIC:
                moved = 0.0 if joint.column is None else float(most[joint.column])
                far += abs(joint.offset) + abs(joint.ratio) * moved
        return far


@dataclass(frozen=True)
class Moving:
    """A solid that moves.

    Args:
        solid: In the frame that carries it.
        carrier: What does; several solids may share one.
        frame: Which of its frames, from 1.
    """

    solid: "Solid | ConvexCover"
    carrier: Carrier
    frame: int

    @property
    def name(self) -> str:
        """The solid's."""
        return self.solid.name

    @property
    def pieces(self) -> Sequence[Piece]:
        """The convex pieces, in the frame that carries them."""
        return self.solid.pieces

    def poses(self, times: FloatArray) -> FloatArray:
        """T_base_solid at some times (m,), shape (m, 4, 4); [m]."""
        return np.asarray(self.carrier.poses(times)[:, self.frame])


Obstacle: TypeAlias = Solid | Moving


def solid_of(obstacle: Obstacle) -> Solid:
    """The solid that an obstacle is, in its own frame where it moves."""
    found = obstacle.solid if isinstance(obstacle, Moving) else obstacle
    return cast("Solid", found)


def placed(solid: Solid, pose: FloatArray) -> Solid:
    """A solid of one frame in another; `pose` is T_other_frame, (4, 4); [m]."""
    turn, shift = pose[:3, :3], pose[:3, 3]
    match solid:
        case Sphere():
            return replace(solid, centre=turn @ solid.centre + shift)
        case Capsule() | Cylinder():
            centre = turn @ solid.centre + shift
            return replace(solid, centre=centre, axis=turn @ solid.axis)
        case Box():
            centre = turn @ solid.centre + shift
            return replace(solid, centre=centre, rotation=turn @ solid.rotation)
        case Prism():
            origin = turn @ solid.origin + shift
            return replace(solid, origin=origin, rotation=turn @ solid.rotation)
        case HalfSpace():
            point, normal = turn @ solid.point + shift, turn @ solid.normal
            return replace(solid, point=point, normal=normal)
        case Mesh():
            return replace(solid, vertices=solid.vertices @ turn.T + shift)
        case PointCloud():
            return replace(solid, points=solid.points @ turn.T + shift)
        case Voxels():
            centres = solid.centres @ turn.T + shift
            return replace(solid, centres=centres, rotation=turn @ solid.rotation)


def reach_of(obstacle: Obstacle | ConvexCover) -> float:
    """Largest distance of a solid's stated points from the base's origin; [m].

    Not below that of its own points; of a half-space that of the stated point alone.
    """
    if isinstance(obstacle, Moving):
        return reach_of(obstacle.solid) + obstacle.carrier.reach
    if not isinstance(obstacle, Solid):  # a hull, or pieces of any origin
        hulls = [piece for piece in obstacle.pieces if isinstance(piece, Hull)]
        return max((_reach_of_hull(hull) for hull in hulls), default=0.0)
    if isinstance(obstacle, Voxels):
        points, grown = obstacle.centres, math.hypot(*obstacle.half_size.tolist())
    else:
        points, grown = corners_of(obstacle)
    return float(np.linalg.norm(points, axis=1).max()) + grown


def _reach_of_hull(hull: Hull) -> float:
    return float(np.linalg.norm(hull.points, axis=1).max()) + hull.radius


@dataclass(frozen=True)
class Scene:
    """All obstacles of one problem, in the base frame.

    Args:
        obstacles: Any number, names unique, within `TOLERANCES.scene_extent`.

    Raises:
        InvalidInput: If two share a name, or one is too far from the base.
    """

    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        """Refuse duplicate names, and what distances are not proved for."""
        for obstacle in self.obstacles:
            if not (reach := reach_of(obstacle)) <= TOLERANCES.scene_extent:
                message = (
                    f"obstacle {obstacle.name!r} reaches {reach:.6g} m from the base, "
                    f"expected at most {TOLERANCES.scene_extent:g} m"
                )
                raise InvalidInput(message)
        seen: set[str] = set()
        for name in self.names:
            if name in seen:
                message = f"two obstacles are named {name!r}; names are unique"
                raise InvalidInput(message)
            seen.add(name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names in file order."""
        return tuple(obstacle.name for obstacle in self.obstacles)

    @property
    def moving(self) -> tuple[Moving, ...]:
        """The obstacles that move, in file order."""
        return tuple(one for one in self.obstacles if isinstance(one, Moving))

    @property
    def at_rest(self) -> "Scene":
        """The obstacles that do not."""
        still = (one for one in self.obstacles if not isinstance(one, Moving))
        return Scene(tuple(still)) if self.moving else self

    @property
    def rest_time(self) -> float:
        """From when on nothing moves; -inf where nothing ever does; [s]."""
        ends = (one.path.own_times[-1] for one in self.carriers)
        return float(max(ends, default=-np.inf))

    @property
    def start_time(self) -> float:
        """When the first one begins to move; inf where nothing ever does; [s]."""
        begins = (one.path.own_times[0] for one in self.carriers)
        return float(min(begins, default=np.inf))

    def at_time(self, time: float) -> "Scene":
        """The scene as it stands at a time, nothing of it moving any more; [s]."""
        when = np.array([time])
        return Scene(
            tuple(
                placed(solid_of(one), one.poses(when)[0])
                if isinstance(one, Moving)
                else one
                for one in self.obstacles
            )
        )

    @property
    def carriers(self) -> tuple[Carrier, ...]:
        """What carries them, each once."""
        return tuple(dict.fromkeys(one.carrier for one in self.moving))


def corners_of(solid: Solid) -> tuple[FloatArray, float]:
    """Points, shape (n, 3), whose hull grown by a radius holds a solid; [m].

    Of a half-space the point that it is given by.
    """
    match solid:
        case HalfSpace():
            return solid.point[None], 0.0
        case Mesh():
            return solid.vertices[solid.triangles].reshape(-1, 3), 0.0
        case PointCloud():
            return solid.points, solid.radius
        case Voxels():
            cell = (BOX_CORNERS * solid.half_size) @ solid.rotation.T
            return (solid.centres[:, None] + cell).reshape(-1, 3), 0.0
        case Prism():
            ends = [np.insert(solid.polygon, 2, s, axis=1) for s in solid.span]
            return solid.origin + np.vstack(ends) @ solid.rotation.T, 0.0
        case Sphere():
            return solid.centre[None], solid.radius
        case Box():
            corners = (BOX_CORNERS * solid.half_size) @ solid.rotation.T
            return solid.centre + corners, 0.0
        case Cylinder() | Capsule():
            arm = solid.half_length * solid.axis
            return np.array([solid.centre + arm, solid.centre - arm]), solid.radius


def with_hulls(scene: Scene, names: Collection[str]) -> Scene:
    """A scene with the convex hulls of some meshes in their places.

    For whoever asks obstacles for their names and pieces alone: proofs and planners.

    Args:
        scene: All obstacles.
        names: Of meshes.
    """
    obstacles: list[Obstacle | ConvexCover] = []
    for one in scene.obstacles:
        solid = solid_of(one)
        if not isinstance(solid, Mesh) or one.name not in names:
            obstacles.append(one)
        elif isinstance(one, Moving):
            obstacles.append(replace(one, solid=solid.hull))
        else:
            obstacles.append(solid.hull)
    return Scene(tuple(cast("list[Obstacle]", obstacles)))


def covers_of(obstacles: Sequence[Obstacle], pieces: "PackedPieces") -> IntArray:
    """How the pieces of obstacles count where an inside is asked for, (n_pieces,).

    Args:
        obstacles: Any.
        pieces: Theirs, packed.
    """
    covers = np.zeros(len(pieces.kind), np.int64)
    for k, mesh in enumerate(obstacles):
        if isinstance(mesh, Mesh) and mesh.has_inside:
            mine = slice(pieces.first_piece[k], pieces.first_piece[k + 1])
            covers[mine] = mesh.closed_mesh.covers[pieces.order[mine]]
    return covers
