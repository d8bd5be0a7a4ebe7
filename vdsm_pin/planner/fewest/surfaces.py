"""Points all over the surfaces of meshes: how far a link is from them, but for a step.

A distance to a mesh takes a walk through its triangles. A point of its surface tells
from above how far the mesh is, and as no place of the surface is farther than a step
from a point, the nearest of them tells it from below too.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import borrowed, compiled
from vdsm_pin.geometry.obstacles import STACK, crossings
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.scene import Mesh, Obstacle

STEP: Final = 0.01
"""No place of a surface is farther from a point, if that takes few enough; [m]."""
MOST: Final = 40_000
"""Points at which the step is doubled."""
CROWD: Final = 12
"""At most so many points are looked at one by one."""


@dataclass(frozen=True)
class Surfaces:
    """Points on surfaces, and balls round ever smaller groups of them.

    Ball 1 holds all points, and balls 2 k and 2 k + 1 hold the halves of those of
    ball k.

    Args:
        points: Shape (n, 3); [m].
        first: Where the points of each ball begin, and where they end, shape (b, 2).
        balls: Centres and radii, shape (b, 4); [m].
        step: No place of a surface is farther from the nearest point; [m].
        solids: The meshes that have an inside.
    """

    points: FloatArray
    first: IntArray
    balls: FloatArray
    step: float
    solids: PackedPieces

    def least(self, ends: FloatArray, enough: float) -> FloatArray:
        """Lower bounds of the distance of segments to the meshes, shape (n,); [m].

        Each is less than a step below the distance; -inf within a solid.

        Args:
            ends: Shape (n, 2, 3); [m].
            enough: A bound from which on more need not be known; [m].
        """
        if not len(self.points):
            return np.full(len(ends), np.inf)
        reach = enough + self.step
        bound = nearest_points(self.points, self.first, self.balls, ends, reach)
        bound -= self.step
        bound[buried(self.solids, ends, bound > 0.0)] = -np.inf
        return bound


def surfaces_of(obstacles: tuple[Obstacle, ...]) -> Surfaces:
    """The surfaces of all meshes."""
    meshes = [obstacle for obstacle in obstacles if isinstance(obstacle, Mesh)]
    corners = np.concatenate([np.zeros((0, 3, 3)), *(m.pieces.corners for m in meshes)])
    points, step = _spread(corners)
    points = points[coherent_order(points)]
    solids = pack_pieces([mesh.pieces for mesh in meshes if mesh.watertight])
    return Surfaces(points, *_balls(points), step, solids)


def _spread(corners: FloatArray) -> tuple[FloatArray, float]:
    """Points of triangles, shape (n, 3), and the step they keep; [m].

    Args:
        corners: Shape (t, 3, 3); [m].
    """
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    longest = sides.max(axis=1, initial=0.0)
    step = STEP
    while True:
        # No point of a triangle is farther from a corner than its longest side by
        # sqrt(3): so it is in the small ones that n parts of each side make.
        parts = np.maximum(1, np.ceil(longest / (step * sqrt(3.0)))).astype(np.int64)
        if ((parts + 1) * (parts + 2)).sum() // 2 <= max(MOST, 3 * len(corners)):
            break
        step *= 2.0
    points = [np.zeros((0, 3))]
    for count in np.unique(parts).tolist():
        a, b = np.triu_indices(count + 1)
        shares = np.column_stack([a, b - a, count - b]) / count
        points.append((shares @ corners[parts == count]).reshape(-1, 3))
    return np.unique(np.concatenate(points), axis=0), step


def _balls(points: FloatArray) -> tuple[IntArray, FloatArray]:
    """Points and balls as `Surfaces` has them, shape (b, 2) and (b, 4); [m]."""
    ranges, balls = [np.zeros((1, 2), np.int64)], [np.zeros((1, 4))]
    count = 1
    while len(points):
        marks = np.arange(count + 1) * len(points) // count
        sizes = np.diff(marks)
        low = np.minimum.reduceat(points, marks[:-1])
        high = np.maximum.reduceat(points, marks[:-1])
        centre = (low + high) / 2.0
        off = np.linalg.norm(points - np.repeat(centre, sizes, axis=0), axis=1)
        radius = np.maximum.reduceat(off, marks[:-1])
        ranges.append(np.column_stack([marks[:-1], marks[1:]]))
        balls.append(np.column_stack([centre, radius]))
        if sizes.max() <= CROWD:
            break
        count *= 2
    return np.concatenate(ranges), np.concatenate(balls)


@compiled
def _gap(point: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """Distance of a point from a segment; [m]."""
    along = span = 0.0
    for c in range(3):
        d = b[c] - a[c]
        along += (point[c] - a[c]) * d
        span += d * d
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    square = 0.0
    for c in range(3):
        gap = point[c] - a[c] - t * (b[c] - a[c])
        square += gap * gap
    return sqrt(square)


@compiled
def nearest_points(
    points: FloatArray,
    first: IntArray,
    balls: FloatArray,
    ends: FloatArray,
    enough: float,
) -> FloatArray:
    """Distance of segments to the nearest of some points, or `enough` if it is less.

    Args:
        points: See `Surfaces`.
        first: See `Surfaces`.
        balls: See `Surfaces`.
        ends: Shape (n, 2, 3); [m].
        enough: The largest distance that matters; [m].

    Returns:
        Shape (n,); [m].
    """
    points, balls, ends = borrowed(points), borrowed(balls), borrowed(ends)
    result = np.zeros(ends.shape[0])
    stack, gaps = np.zeros(STACK, np.int64), np.zeros(STACK)
    for n in range(ends.shape[0]):
        a, b = ends[n]
        best = enough
        stack[0], gaps[0], waiting = 1, -np.inf, int(balls.shape[0] > 1)
        while waiting > 0:
            waiting -= 1
            ball = stack[waiting]
            if gaps[waiting] >= best:
                continue
            if 2 * ball >= balls.shape[0]:
                for k in range(first[ball, 0], first[ball, 1]):
                    best = min(best, _gap(points[k], a, b))
                continue
            near, far = 2 * ball, 2 * ball + 1
            gap = _gap(balls[near, :3], a, b) - balls[near, 3]
            other = _gap(balls[far, :3], a, b) - balls[far, 3]
            if gap > other:
                near, far, gap, other = far, near, other, gap
            stack[waiting], gaps[waiting] = far, other
            stack[waiting + 1], gaps[waiting + 1] = near, gap
            waiting += 2
        result[n] = best
    return result


@compiled
def buried(solids: PackedPieces, ends: FloatArray, asked: BoolArray) -> BoolArray:
    """Which of the segments asked for begin within a solid, shape (n,).

    Args:
        solids: Watertight meshes.
        ends: Shape (n, 2, 3); [m].
        asked: Shape (n,).
    """
    solids = borrowed(solids)
    inside = np.zeros(ends.shape[0], dtype=np.bool_)
    for n in range(ends.shape[0]):
        if not asked[n]:
            continue
        x, y, z = ends[n, 0]
        for o in range(solids.root.size):
            if crossings(solids, o, x, y, z) % 2 == 1:
                inside[n] = True
    return inside
