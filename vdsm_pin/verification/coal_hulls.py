"""Convex pieces as Coal's shapes.

`coal.Convex.convexHull` ends the process where points are flat, so that these are
looked at first; of a swept polygon Coal is told the faces.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, turn_z_to
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Piece

FLAT: Final = 1e-6
"""Coal's hull of points flatter than this part of their size ends the process; [-]."""


@dataclass(frozen=True, eq=False)
class CoalBody:
    """One Coal geometry at its place; an obstacle is one or more of them.

    Args:
        geometry: A coal.CollisionGeometry.
        pose: Its coal.Transform3s in the base frame.
    """

    geometry: Any
    pose: Any

    @cached_property
    def place(self) -> tuple[FloatArray, FloatArray]:
        """R, shape (3, 3), and p, shape (3,), of its pose; [-], [m]."""
        return self.pose.getRotation(), self.pose.getTranslation()

    @cached_property
    def ball(self) -> tuple[FloatArray, float]:
        """Middle, shape (3,), and radius of Coal's ball about it, inf for none; [m]."""
        self.geometry.computeLocalAABB()
        radius = float(self.geometry.aabb_radius)
        if not radius < np.inf:  # a half-space, whose middle is out of all bounds
            return np.zeros(3), np.inf
        return self.pose.transform(self.geometry.aabb_center), radius


def placed(
    geometry: Any, p: FloatArray | None = None, R: FloatArray | None = None
) -> CoalBody:
    """A geometry at a place, or at the origin of its frame."""
    import coal

    turn, shift = np.eye(3) if R is None else R, np.zeros(3) if p is None else p
    return CoalBody(geometry, coal.Transform3s(np.array(turn), np.array(shift)))


def coal_parts(pieces: Sequence[Piece]) -> tuple[CoalBody, ...] | None:
    """Convex pieces as Coal's shapes; None where Coal cannot take one."""
    found = [_coal_part(piece) for piece in pieces]
    known = tuple(part for part in found if part)
    return known if len(known) == len(found) else None


def _coal_part(piece: Piece) -> CoalBody | None:
    import coal

    if isinstance(piece, FlatCylinder):
        rod = coal.Cylinder(piece.radius, 2.0 * piece.half_length)
        return placed(rod, piece.centre, turn_z_to(piece.axis))
    if not isinstance(piece, Hull):
        return None
    points = piece.points
    if len(points) == 1:
        return placed(coal.Sphere(piece.radius), points[0])
    if len(points) == 2:
        way = points[1] - points[0]
        length = float(np.linalg.norm(way))
        if not length > 0.0:
            return None
        rod = coal.Capsule(piece.radius, length)
        return placed(rod, points.mean(axis=0), turn_z_to(way / length))
    hull = coal_hull(points)
    return None if hull is None else placed(hull)


def is_solid(points: FloatArray) -> bool:
    """Whether points are far enough from one plane for Coal's hull."""
    if len(points) < 4:
        return False
    _, sizes, _ = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return bool(sizes[-1] > FLAT * sizes[0])


def coal_hull(points: FloatArray) -> Any | None:
    """The hull as a coal.Convex; None where the points are flat or Qhull gives up."""
    import coal

    if not is_solid(points):
        return None
    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(points))
    # A face of hundreds of corners, cut into a fan, has more neighbours at its tip than
    # Coal can count; of joggled points it is cut otherwise.
    for how in ("Qt", "QJ"):
        try:
            return coal.Convex.convexHull(vertices, True, how)
        except RuntimeError:
            continue
    return None


def swept_polygon(corners: FloatArray) -> Any:
    """A convex polygon swept along a line, by its corners at both ends, (2 k, 3).

    A corner may have below 256 neighbours, so the ends are cut in zigzag.
    """
    import coal

    k = len(corners) // 2
    zigzag = [i // 2 if i % 2 == 0 else k - 1 - i // 2 for i in range(k)]
    faces: list[tuple[int, int, int]] = []
    for i, (a, b, c) in enumerate(zip(zigzag, zigzag[1:], zigzag[2:], strict=False)):
        low = (a, c, b) if i % 2 else (a, b, c)
        faces += [low, (k + low[0], k + low[2], k + low[1])]
    for i in range(k):
        j = (i + 1) % k
        faces += [(i, j, k + j), (i, k + j, k + i)]
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend(list(corners))
    triangles.extend([coal.Triangle(*face) for face in faces])
    return coal.Convex(points, triangles)


def hull_planes(points: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """Planes n.x = d of the faces of a hull; None where `coal_hull` has none.

    Returns:
        Outward unit normals, shape (n_faces, 3), and offsets, shape (n_faces,); [m].
    """
    hull = coal_hull(points)
    if hull is None:
        return None
    return np.array(hull.normals()), -np.array(hull.offsets()).ravel()
