"""Convex hulls of points by Coal (Qhull), made covers of all the points."""

from typing import Any, Final

import numpy as np

from vdsm_pin.arm.bodies import outer_points
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.tolerances import TOLERANCES

FLAT: Final = 1e-6
"""Coal's hull of points flatter than this part of their size ends the process; [-]."""

MOST_GROWN: Final = 1e-6
"""By how much a hull may be grown to hold what Qhull takes for its surface; [m]."""


def covering_hull(points: FloatArray) -> Hull:
    """A hull of few of the points, grown until it is proved to hold all of them.

    Args:
        points: Shape (n, 3); [m].
    """
    if is_solid(points):
        corners = np.array(coal_hull(points).points())
        pieces = pack_pieces([[Hull(corners)]])
        ends = np.ascontiguousarray(np.repeat(points[:, None], 2, axis=1))
        none = np.zeros(len(points), np.int64)
        off = row_brackets(pieces, ends, none, TOLERANCES.bracket_gap)[:, 1]
        grown = float(max(off.max(), 0.0))
        if grown <= MOST_GROWN:
            return Hull(corners, grown)
    return Hull(outer_points(points))


def is_solid(points: FloatArray) -> bool:
    """Whether points are far enough from one plane for Coal's hull."""
    if len(points) < 4:
        return False
    _, sizes, _ = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return bool(sizes[-1] > FLAT * sizes[0])


def coal_hull(points: FloatArray) -> Any:
    """The hull as a coal.Convex, of points for which `is_solid` holds."""
    import coal

    vertices = coal.StdVec_Vec3s()
    vertices.extend([np.array(point) for point in points])
    return coal.Convex.convexHull(vertices, True, "Qt")


def hull_planes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Planes n.x = d of the faces of a hull, of points for which `is_solid` holds.

    Returns:
        Outward unit normals, shape (n_faces, 3), and offsets, shape (n_faces,); [m].
    """
    hull = coal_hull(points)
    return np.array(hull.normals()), -np.array(hull.offsets()).ravel()
