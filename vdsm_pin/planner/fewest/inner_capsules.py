"""Capsules inside obstacles: a link that comes too near one of them is blocked.

A capsule in a solid proves in a few operations that a link is too near; that spares
most distances that a search would ask for only to throw the configuration away.
"""

import itertools
from math import sqrt

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
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
BLOCK = 256
"""Hulls looked at together."""


def cores_of(obstacles: tuple[Obstacle, ...]) -> FloatArray:
    """Capsules inside the obstacles: both ends and a radius, shape (n, 7); [m]."""
    pieces = [
        piece
        for obstacle in obstacles
        if len(obstacle.pieces) <= MOST_PIECES
        for piece in obstacle.pieces
        if not isinstance(piece, HalfSpacePiece)
    ]
    cores = np.zeros((len(pieces), 7))
    alike: dict[int, list[int]] = {}
    for k, piece in enumerate(pieces):
        if isinstance(piece, FlatCylinder):
            cores[k] = _core_of_cylinder(piece)
        else:
            alike.setdefault(len(piece.points), []).append(k)
    for numbers in alike.values():
        for first in range(0, len(numbers), BLOCK):
            some = numbers[first : first + BLOCK]
            hulls = [piece for k in some if isinstance(piece := pieces[k], Hull)]
            cores[some] = _cores_of_hulls(hulls)
    return cores


def _core_of_cylinder(piece: FlatCylinder) -> FloatArray:
    """A capsule inside a cylinder, shape (7,); [m]."""
    radius = min(piece.radius, piece.half_length)
    half = (piece.half_length - radius) * piece.axis
    return np.array([*(piece.centre - half), *(piece.centre + half), radius])


def _cores_of_hulls(hulls: list[Hull]) -> FloatArray:
    """Capsules inside hulls of as many points each, shape (n, 7); [m]."""
    points = np.array([hull.points for hull in hulls])
    ends, radii = points[:, [0, -1]], np.zeros(len(hulls))
    if points.shape[1] > 2:
        ends, radii = _inside_hulls(points)
    radii = radii + [hull.radius for hull in hulls]
    return np.concatenate([ends.reshape(-1, 6), radii[:, None]], axis=1)


def _inside_hulls(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A line inside the hull of some points and its least distance from the faces.

    The line runs along the hull's longest extent and ends where it would come much
    nearer to a face than its middle is.

    Args:
        points: Of n hulls, shape (n, k, 3); [m].

    Returns:
        Ends of the lines, shape (n, 2, 3) [m]; the distances, shape (n,) [m].
    """
    n, centre = np.arange(len(points)), points.mean(axis=1, keepdims=True)
    along = np.linalg.svd(points - centre, full_matrices=False)[2][:, 0, :, None]
    ahead = (points - centre) @ along > 0.0
    sides = ~ahead, ahead
    sums = [(points * side).sum(axis=1) / side.sum(axis=1) for side in sides]
    away = np.stack(sums, axis=1) - centre
    normals, offsets = _faces(points)
    share = np.linspace(1.0, 0.0, TRIES)[:, None, None]
    lines = centre[:, None] + share * away[:, None]
    heights = lines.reshape(len(n), -1, 3) @ normals.swapaxes(1, 2)
    depth = (offsets[:, None] - heights).min(axis=2, initial=np.inf)
    depth = depth.reshape(len(n), TRIES, 2).min(axis=2) - TOLERANCES.bracket_gap
    best = np.argmax(depth >= NEARER * depth[:, -1:], axis=1)
    deep = depth[n, best]
    return lines[n, best], np.where(np.isfinite(deep), np.maximum(0.0, deep), 0.0)


def _faces(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Outward normals and offsets of the faces of hulls of few points.

    Args:
        points: Shape (n, k, 3); [m].

    Returns:
        Shape (n, f, 3) [-] and (n, f) [m], infinite offsets where a hull has fewer
        faces; none where they are too many to be looked for.
    """
    n, k = points.shape[:2]
    if not 4 <= k <= MOST_POINTS:
        return np.zeros((n, 0, 3)), np.zeros((n, 0))
    corners = points[:, np.array(list(itertools.combinations(range(k), 3)))]
    base = corners[:, :, 0]
    normals = np.cross(corners[:, :, 1] - base, corners[:, :, 2] - base)
    sizes = np.linalg.norm(normals, axis=2, keepdims=True)
    wide = sizes > TOLERANCES.parallel * sizes.max(axis=1, keepdims=True)
    normals = np.divide(normals, sizes, out=np.zeros_like(normals), where=wide)
    # A plane through three corners is a face if no point lies beyond it.
    both, bases = np.concatenate([normals, -normals], 1), np.concatenate([base] * 2, 1)
    offsets = (bases * both).sum(axis=2)
    face = (points @ both.swapaxes(1, 2)).max(
        axis=1
    ) <= offsets + TOLERANCES.bracket_gap
    face &= np.concatenate([wide, wide], axis=1)[:, :, 0]
    order = np.argsort(~face, axis=1, kind="stable")[:, : face.sum(axis=1).max()]
    both = np.take_along_axis(both, order[:, :, None], axis=1)
    return both, np.take_along_axis(np.where(face, offsets, np.inf), order, axis=1)


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
