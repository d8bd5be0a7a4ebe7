"""Triangles to draw an obstacle with; for pictures only, never for distances."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.scene import (
    BOX_CORNERS,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    Obstacle,
    Prism,
    Sphere,
)

_AROUND: Final = 48  # corners of a drawn circle
_UP: Final = 12  # rings of a drawn half ball
_MOST_TRIANGLES: Final = 20_000  # of a drawn mesh; keeps a page below a megabyte
_BOX_FACES: Final = (
    (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3),
)  # fmt: skip


@dataclass(frozen=True)
class Surface:
    """Triangles with their corners.

    Args:
        vertices: Shape (n, 3), base frame; [m].
        triangles: Vertex indices, counter-clockwise from outside, shape (m, 3).
        round: Whether shared corners are to be shaded smoothly.
    """

    vertices: FloatArray
    triangles: IntArray
    round: bool = False


def surface(obstacle: Obstacle, extent: float) -> Surface:
    """The surface of an obstacle.

    Args:
        obstacle: Any shape.
        extent: Half the width of the square drawn for a half-space; [m].
    """
    match obstacle:
        case Sphere():
            return _capsule(obstacle.centre, np.eye(3)[2], 0.0, obstacle.radius)
        case Capsule():
            return _capsule(
                obstacle.centre, obstacle.axis, obstacle.half_length, obstacle.radius
            )
        case Cylinder():
            return _cylinder(obstacle)
        case Box():
            corners = BOX_CORNERS * obstacle.half_size @ obstacle.rotation.T
            return _polygons(obstacle.centre + corners, _BOX_FACES)
        case Prism():
            return _prism(obstacle)
        case HalfSpace():
            return _plane(obstacle, extent)
        case Mesh():
            return _coarse(obstacle)


def frame_along(axis: FloatArray) -> FloatArray:
    """A right-handed frame whose third column is the axis, shape (3, 3); [-]."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])


def _rings(radii: FloatArray, heights: FloatArray) -> FloatArray:
    """Circles about z, shape (rings * _AROUND, 3); [m]."""
    turn = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    x, y = np.outer(radii, np.cos(turn)), np.outer(radii, np.sin(turn))
    z = np.broadcast_to(heights[:, None], x.shape)
    return np.stack([x, y, z], axis=2).reshape(-1, 3)


def _between(n_rings: int) -> IntArray:
    """Triangles between consecutive rings."""
    ring, k = np.meshgrid(np.arange(n_rings - 1), np.arange(_AROUND), indexing="ij")
    a, b = ring * _AROUND + k, ring * _AROUND + (k + 1) % _AROUND
    c, d = a + _AROUND, b + _AROUND
    lower, upper = np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)
    return np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])


def _capsule(
    centre: FloatArray, axis: FloatArray, half_length: float, radius: float
) -> Surface:
    rise = np.linspace(0.0, np.pi / 2.0, _UP)
    up = half_length + radius * np.sin(rise)
    heights = np.concatenate([-up[::-1], up])
    radii = radius * np.concatenate([np.cos(rise)[::-1], np.cos(rise)])
    points = _rings(radii, heights) @ frame_along(axis).T
    return Surface(centre + points, _between(2 * _UP), round=True)


def _cylinder(solid: Cylinder) -> Surface:
    # Rim corners appear twice, so that shading breaks at the edge.
    heights = solid.half_length * np.array([-1.0, -1.0, 1.0, 1.0])
    tube = _rings(np.full(2, solid.radius), heights[[0, 2]])
    caps = [_rings(np.array([0.0, solid.radius]), heights[:2]),
            _rings(np.array([solid.radius, 0.0]), heights[2:])]  # fmt: skip
    points = np.vstack([tube, *caps]) @ frame_along(solid.axis).T
    strip, count = _between(2), 2 * _AROUND
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
    joined = _joined(parts)
    points = solid.origin + joined.vertices @ solid.rotation.T
    return Surface(points, joined.triangles)


def _cap(section: FloatArray, height: float) -> Surface:
    corners = np.column_stack([section, np.full(len(section), height)])
    return _polygons(corners, (tuple(range(len(section))),))


def _joined(parts: list[Surface]) -> Surface:
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    triangles = [part.triangles + s for part, s in zip(parts, starts, strict=True)]
    points = np.vstack([part.vertices for part in parts])
    return Surface(points, np.concatenate(triangles))


def _plane(solid: HalfSpace, extent: float) -> Surface:
    across = frame_along(solid.normal)[:, :2]
    middle = solid.normal * float(solid.normal @ solid.point)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * extent
    return _polygons(middle + signs @ across.T, ((0, 1, 2, 3),))


def _coarse(solid: Mesh) -> Surface:
    """The mesh, its corners merged on a grid until few enough triangles are left."""
    vertices, triangles = solid.vertices, solid.triangles
    low = vertices.min(axis=0)
    size = float(np.max(vertices.max(axis=0) - low))
    cells = 512
    while len(triangles) > _MOST_TRIANGLES and cells > 1:
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
