"""Capsules inside obstacles: a link that comes too near one of them is blocked.

A capsule in a solid proves in a few operations that a link is too near; that spares
most distances that a search would ask for only to throw the configuration away.
"""

import itertools
from math import sqrt

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Piece
from vdsm_pin.geometry.segments import squared_gap
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.tolerances import TOLERANCES

MOST_POINTS = 16
"""Hulls of more points have a core of no thickness; their faces are not looked for."""
TRIES = 33
"""Lengths tried for the line inside a hull."""
NEARER = 0.9
"""Distance of its ends from the faces over that of its middle; [-]."""
MOST_PIECES = 16
"""Obstacles of more pieces, as meshes are, have no cores."""


def cores_of(obstacles: tuple[Obstacle, ...]) -> FloatArray:
    """Capsules inside the obstacles: both ends and a radius, shape (n, 7); [m]."""
    cores = [
        _core(piece)
        for obstacle in obstacles
        if len(obstacle.pieces) <= MOST_PIECES
        for piece in obstacle.pieces
        if not isinstance(piece, HalfSpacePiece)
    ]
    return np.array(cores).reshape(-1, 7)


def _core(piece: Piece) -> FloatArray:
    """A capsule inside a convex piece, shape (7,); [m]."""
    if isinstance(piece, FlatCylinder):
        radius = min(piece.radius, piece.half_length)
        half = (piece.half_length - radius) * piece.axis
        return np.array([*(piece.centre - half), *(piece.centre + half), radius])
    assert isinstance(piece, Hull)
    ends, radius = piece.points[[0, -1]], 0.0
    if len(piece.points) > 2:
        ends, radius = _inside_hull(piece.points)
    return np.array([*ends.ravel(), radius + piece.radius])


def _inside_hull(points: FloatArray) -> tuple[FloatArray, float]:
    """A line inside the hull of some points and its least distance from the faces.

    The line runs along the hull's longest extent and ends where it would come much
    nearer to a face than its middle is.

    Args:
        points: Shape (n, 3); [m].

    Returns:
        Ends of the line, shape (2, 3) [m]; the distance [m].
    """
    centre = points.mean(axis=0)
    along = np.linalg.svd(points - centre)[2][0]
    ahead = (points - centre) @ along > 0.0
    ends = np.stack([points[~ahead].mean(axis=0), points[ahead].mean(axis=0)])
    normals, offsets = _faces(points)
    if not len(normals):
        return ends, 0.0
    share = np.linspace(1.0, 0.0, TRIES)[:, None, None]
    lines = centre + share * (ends - centre)
    depth = (offsets - lines @ normals.T).min(axis=(1, 2)) - TOLERANCES.bracket_gap
    best = int(np.argmax(depth >= NEARER * depth[-1]))
    return lines[best], max(0.0, float(depth[best]))


def _faces(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Outward normals and offsets of the faces of a hull of few points.

    Args:
        points: Shape (n, 3); [m].

    Returns:
        Shape (f, 3) [-] and (f,) [m]; none where they are too many to be looked for.
    """
    if not 4 <= len(points) <= MOST_POINTS:
        return np.zeros((0, 3)), np.zeros(0)
    corners = points[np.array(list(itertools.combinations(range(len(points)), 3)))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(normals, axis=1)
    wide = sizes > TOLERANCES.parallel * sizes.max()
    normals, base = normals[wide] / sizes[wide, None], corners[wide, 0]
    # A plane through three corners is a face if no point lies beyond it.
    both, bases = np.concatenate([normals, -normals]), np.concatenate([base, base])
    offsets = (bases * both).sum(axis=1)
    face = (points @ both.T).max(axis=0) <= offsets + TOLERANCES.bracket_gap
    return both[face], offsets[face]


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
