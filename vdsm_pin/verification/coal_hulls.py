"""Convex pieces as Coal has them: hulls of points, balls, capsules, cylinders."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, turn_z_to
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Piece
from vdsm_pin.geometry.solids import ConvexCover, Solid
from vdsm_pin.problem.scene import Obstacle, solid_of
from vdsm_pin.verification.coal_bodies import CoalBody, CoalObstacle, coal_bodies

FLAT: Final = 1e-6
"""Coal's hull of points flatter than this part of their size ends the process; [-]."""


def coal_obstacle(obstacle: Obstacle) -> CoalObstacle | None:
    """An obstacle as Coal has it; None where Coal cannot take a piece of it.

    Raises:
        VerificationFailed: If Coal refuses the shape.
    """
    solid: Solid | ConvexCover = solid_of(obstacle)
    if isinstance(solid, ConvexCover):
        return coal_parts(solid.pieces)
    return coal_bodies(solid)


def coal_parts(pieces: Sequence[Piece]) -> tuple[CoalBody, ...] | None:
    """Convex pieces of a link as Coal's shapes; None where Coal cannot take one."""
    import coal

    found = []
    for piece in pieces:
        if isinstance(piece, FlatCylinder):
            shape = coal.Cylinder(piece.radius, 2.0 * piece.half_length)
            pose = coal.Transform3s(turn_z_to(piece.axis), np.array(piece.centre))
        elif isinstance(piece, Hull) and len(piece.points) == 1:
            shape = coal.Sphere(piece.radius)
            pose = coal.Transform3s(np.eye(3), np.array(piece.points[0]))
        elif isinstance(piece, Hull) and len(piece.points) == 2:
            way = piece.points[1] - piece.points[0]
            length = float(np.linalg.norm(way))
            if not length > 0.0:
                return None
            shape = coal.Capsule(piece.radius, length)
            middle = piece.points.mean(axis=0)
            pose = coal.Transform3s(turn_z_to(way / length), middle)
        elif isinstance(piece, Hull) and (shape := coal_hull(piece.points)):
            pose = coal.Transform3s(np.eye(3), np.zeros(3))
        else:
            return None
        found.append(CoalBody(shape, pose))
    return tuple(found)


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
    vertices.extend([np.array(point) for point in points])
    # A face of hundreds of corners, cut into a fan, has more neighbours at its tip than
    # Coal can count; of joggled points it is cut otherwise.
    for how in ("Qt", "QJ"):
        try:
            return coal.Convex.convexHull(vertices, True, how)
        except RuntimeError:
            continue
    return None
