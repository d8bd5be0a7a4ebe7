"""Capsules inside obstacles: a link that comes too near one of them is blocked.

A capsule in a solid proves in a few operations that a link is too near; that spares
most distances that a search would ask for only to throw the configuration away.
"""

from math import sqrt

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
from vdsm_pin.geometry.segments import squared_gap
from vdsm_pin.problem.scene import Obstacle

MOST_PIECES = 16
"""Obstacles of more pieces, as meshes are, have no cores."""


def cores_of(obstacles: tuple[Obstacle, ...]) -> FloatArray:
    """Capsules inside the obstacles: both ends and a radius, shape (n, 7); [m]."""
    cores = [
        _core_of_cylinder(piece)
        if isinstance(piece, FlatCylinder)
        else _core_of_hull(piece)
        for obstacle in obstacles
        if len(obstacle.pieces) <= MOST_PIECES
        for piece in obstacle.pieces
        if not isinstance(piece, HalfSpacePiece)
    ]
    return np.array(cores).reshape(-1, 7)


def _core_of_cylinder(piece: FlatCylinder) -> FloatArray:
    """A capsule inside a cylinder, shape (7,); [m]."""
    radius = min(piece.radius, piece.half_length)
    half = (piece.half_length - radius) * piece.axis
    return np.array([*(piece.centre - half), *(piece.centre + half), radius])


def _core_of_hull(piece: Hull) -> FloatArray:
    """A capsule inside a hull, between the middles of its halves, shape (7,); [m]."""
    points = piece.points
    off = points - points.mean(axis=0)
    ahead = off @ np.linalg.svd(off, full_matrices=False)[2][0] > 0.0
    ends = points[[0, -1]]
    if len(points) > 2 and ahead.any():
        ends = np.stack([points[~ahead].mean(axis=0), points[ahead].mean(axis=0)])
    return np.array([*ends.ravel(), piece.radius])


@compiled
def blocked_by(cores: FloatArray, ends: FloatArray, reach: float) -> BoolArray:
    """Which segments are proved to be nearer to a solid than `reach`.

    Args:
        cores: Capsules inside solids, shape (n, 7); [m].
        ends: Segments, shape (s, 2, 3); [m].
        reach: The distance; [m].

    Returns:
        Shape (s,).
    """
    cores, ends = borrowed(cores), borrowed(ends)
    blocked = np.zeros(ends.shape[0], dtype=np.bool_)
    for s in range(ends.shape[0]):
        for n in range(cores.shape[0]):
            least = reach + cores[n, 6]
            a, b = cores[n, :3], cores[n, 3:6]
            if sqrt(squared_gap(a, b, ends[s, 0], ends[s, 1])) < least:
                blocked[s] = True
                break
    return blocked
