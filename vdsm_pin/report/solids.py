"""Triangles to draw an obstacle with; for pictures only, never for distances."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct_rows, turn_z_to
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Piece
from vdsm_pin.geometry.solids import (
    BOX_CORNERS,
    Box,
    Capsule,
    ConvexCover,
    Cylinder,
    HalfSpace,
    Mesh,
    PointCloud,
    Prism,
    Solid,
    Sphere,
    Voxels,
)
from vdsm_pin.robots.hulls import hull_triangles

_PAGE_TRIANGLES: Final = 60_000  # of all obstacles of a page: about two megabytes
_MOST_TRIANGLES: Final = 20_000  # of one drawn mesh
_LEAST_TRIANGLES: Final = 200  # below, a mesh is no longer recognised
_ROUNDNESS: Final = ((48, 12), (32, 8), (24, 6), (16, 4), (12, 3))
_SMALLEST: Final = 1e-4  # radius that a corner of a flat body is drawn with; [m]
_BOX_FACES: Final = (
    (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3),
)  # fmt: skip


@dataclass(frozen=True)
class Detail:
    """How finely a solid is drawn.

    Args:
        around: Corners of a circle.
        up: Rings of half a ball.
        triangles: The most a mesh may have.
    """

    around: int
    up: int
    triangles: int


def detail(n_obstacles: int) -> Detail:
    """The detail that many obstacles can have together."""
    share = _PAGE_TRIANGLES // max(n_obstacles, 1)
    fitting = (one for one in _ROUNDNESS if 2 * one[0] * (2 * one[1] - 1) <= share)
    around, up = next(fitting, _ROUNDNESS[-1])
    return Detail(around, up, min(max(share, _LEAST_TRIANGLES), _MOST_TRIANGLES))


FINE: Final = detail(1)
"""For an obstacle by itself."""


@dataclass(frozen=True)
class Surface:
    """Triangles with their corners.

    Args:
        vertices: Shape (n, 3), in the solid's frame; [m].
        triangles: Vertex indices, counter-clockwise from outside, shape (m, 3).
        round: Whether shared corners are to be shaded smoothly.
        creased: Whether it has edges to be drawn.
    """

    vertices: FloatArray
    triangles: IntArray
    round: bool = False
    creased: bool = True


def surface(
    obstacle: Solid | ConvexCover, extent: float, fine: Detail = FINE
) -> Surface:
    """The surface of an obstacle.

    Args:
        obstacle: Any shape.
        extent: Half the width of the square drawn for a half-space; [m].
        fine: How finely round solids and meshes are drawn.
    """
    match obstacle:
        case Sphere():
            frame, half_length = np.eye(3), 0.0
            return _capsule(obstacle, frame, half_length, fine)
        case Capsule():
            frame = turn_z_to(obstacle.axis)
            return _capsule(obstacle, frame, obstacle.half_length, fine)
        case Cylinder():
            return _cylinder(obstacle, fine.around)
        case Box():
            corners = BOX_CORNERS * obstacle.half_size @ obstacle.rotation.T
            return _polygons(obstacle.centre + corners, _BOX_FACES)
        case Prism():
            return _prism(obstacle)
        case HalfSpace():
            return _plane(obstacle, extent)
        case Mesh():
            return coarse(obstacle.vertices, obstacle.triangles, fine.triangles)
        case PointCloud():
            half = np.full(3, obstacle.radius)
            return _cells(obstacle.points, np.eye(3), half, fine.triangles)
        case Voxels():
            turn, half = obstacle.rotation, obstacle.half_size
            return _cells(obstacle.centres, turn, half, fine.triangles)
        case ConvexCover():
            return joined([piece_surface(piece) for piece in obstacle.pieces])


def piece_surface(piece: Piece) -> Surface:
    """The surface of a piece of a link, in its frame; not of a half-space."""
    if isinstance(piece, FlatCylinder):
        axis, half = piece.axis, piece.half_length
        return surface(Cylinder("", piece.centre, axis, half, piece.radius), 1.0, FINE)
    assert isinstance(piece, Hull)  # links have no half-spaces
    points = piece.points
    if (hull := hull_triangles(points)) is not None:
        return Surface(*hull)
    way = points[-1] - points[0]
    length = float(np.linalg.norm(way))
    if len(points) == 2 and length > 0.0:
        middle, radius = points.mean(axis=0), piece.radius
        return surface(Capsule("", middle, way / length, length / 2.0, radius), 1.0)
    radius = max(piece.radius, _SMALLEST)
    return joined([surface(Sphere("", point, radius), 1.0) for point in points])


def obj_text(solid: Solid) -> str:
    """The surface as an OBJ file, corners of prisms and meshes to the last bit; [m]."""
    skin = solid if isinstance(solid, Mesh) else surface(solid, 1.0)
    corners = [f"v {x!r} {y!r} {z!r}" for x, y, z in skin.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (skin.triangles + 1).tolist()]
    return "\n".join([*corners, *faces]) + "\n"


def _rings(radii: FloatArray, heights: FloatArray, around: int) -> FloatArray:
    """Circles about z, shape (rings * around, 3); [m]."""
    turn = 2.0 * np.pi * np.arange(around) / around
    x, y = np.outer(radii, np.cos(turn)), np.outer(radii, np.sin(turn))
    z = np.broadcast_to(heights[:, None], x.shape)
    return np.stack([x, y, z], axis=2).reshape(-1, 3)


def _between(n_rings: int, around: int) -> IntArray:
    """Triangles between consecutive rings."""
    ring, k = np.meshgrid(np.arange(n_rings - 1), np.arange(around), indexing="ij")
    a, b = ring * around + k, ring * around + (k + 1) % around
    c, d = a + around, b + around
    lower, upper = np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)
    return np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])


def _capsule(
    solid: Sphere | Capsule, frame: FloatArray, half_length: float, fine: Detail
) -> Surface:
    rise = np.linspace(0.0, np.pi / 2.0, fine.up)
    up = half_length + solid.radius * np.sin(rise)
    heights = np.concatenate([-up[::-1], up])
    radii = solid.radius * np.concatenate([np.cos(rise)[::-1], np.cos(rise)])
    points = _rings(radii, heights, fine.around) @ frame.T
    triangles = _between(2 * fine.up, fine.around)
    return Surface(solid.centre + points, triangles, round=True, creased=False)


def _cylinder(solid: Cylinder, around: int) -> Surface:
    # Rim corners appear twice, so that shading breaks at the edge.
    heights = solid.half_length * np.array([-1.0, -1.0, 1.0, 1.0])
    tube = _rings(np.full(2, solid.radius), heights[[0, 2]], around)
    caps = [_rings(np.array([0.0, solid.radius]), heights[:2], around),
            _rings(np.array([solid.radius, 0.0]), heights[2:], around)]  # fmt: skip
    points = np.vstack([tube, *caps]) @ turn_z_to(solid.axis).T
    strip, count = _between(2, around), 2 * around
    triangles = np.concatenate([strip, strip + count, strip + 2 * count])
    return Surface(solid.centre + points, triangles, round=True)


def _polygons(corners: FloatArray, faces: tuple[tuple[int, ...], ...]) -> Surface:
    fans = [[f[0], f[i], f[i + 1]] for f in faces for i in range(1, len(f) - 1)]
    return Surface(corners, np.array(fans, dtype=np.int64))


def _prism(solid: Prism) -> Surface:
    polygon = solid.polygon
    following = np.roll(polygon, -1, axis=0)
    turned = polygon[:, 0] @ following[:, 1] - polygon[:, 1] @ following[:, 0]
    if turned < 0.0:
        polygon = polygon[::-1]
    n = len(polygon)
    rim = [np.column_stack([polygon, np.full(n, height)]) for height in solid.span]
    walls = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    parts = [_polygons(np.vstack(rim), tuple(tuple(wall) for wall in walls))]
    for section in solid.convex_sections:
        parts += [_cap(section, solid.span[0]), _cap(section, solid.span[1])]
    whole = joined(parts)
    points = solid.origin + whole.vertices @ solid.rotation.T
    return Surface(points, whole.triangles)


def _cap(section: FloatArray, height: float) -> Surface:
    corners = np.column_stack([section, np.full(len(section), height)])
    return _polygons(corners, (tuple(range(len(section))),))


def joined(parts: list[Surface]) -> Surface:
    """Several surfaces as one; round where all are."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    triangles = [part.triangles + s for part, s in zip(parts, starts, strict=True)]
    points = np.vstack([part.vertices for part in parts])
    smooth = all(part.round for part in parts)
    return Surface(points, np.concatenate(triangles), smooth)


def _plane(solid: HalfSpace, extent: float) -> Surface:
    across = turn_z_to(solid.normal)[:, :2]
    middle = solid.normal * float(solid.normal @ solid.point)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * extent
    return _polygons(middle + signs @ across.T, ((0, 1, 2, 3),))


def _cells(
    centres: FloatArray, turn: FloatArray, half: FloatArray, most: int
) -> Surface:
    """A cuboid at each point; of too many points larger ones that hold several."""
    while len(centres) * 2 * len(_BOX_FACES) > most:
        half = 2.0 * half
        grid = np.floor(centres @ turn / (2.0 * half))
        centres = (distinct_rows(grid) + 0.5) * (2.0 * half) @ turn.T
    cube = _polygons(BOX_CORNERS * half @ turn.T, _BOX_FACES)
    starts = len(cube.vertices) * np.arange(len(centres))
    triangles = (starts[:, None, None] + cube.triangles).reshape(-1, 3)
    vertices = (centres[:, None] + cube.vertices).reshape(-1, 3)
    return Surface(vertices, triangles)


def coarse(vertices: FloatArray, triangles: IntArray, most: int) -> Surface:
    """A mesh, its corners merged on a grid until few enough triangles are left.

    Args:
        vertices: Shape (n, 3); [m].
        triangles: Vertex indices, shape (m, 3).
        most: So many.
    """
    low = vertices.min(axis=0)
    size = float(np.max(vertices.max(axis=0) - low))
    cells = 512
    while len(triangles) > most and cells > 1:
        grid = np.round((vertices - low) / size * cells).astype(np.int64)
        _, first, place = np.unique(
            grid, axis=0, return_index=True, return_inverse=True
        )
        merged = place.reshape(-1)[triangles]
        distinct = (
            (merged[:, 0] != merged[:, 1])
            & (merged[:, 1] != merged[:, 2])
            & (merged[:, 2] != merged[:, 0])
        )
        vertices, triangles = vertices[first], merged[distinct]
        cells //= 2
    return Surface(vertices, triangles)
