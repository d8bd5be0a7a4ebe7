"""How far links are from the surfaces of meshes, in closed form.

A proved distance to a mesh takes a bracket for every triangle that is near. A planner
asks far too often for that, and needs no proof: here a segment is held against each
triangle in plain arithmetic, and balls round ever smaller groups of triangles spare
most of them.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Final

import numpy as np

from vdsm_pin.compiled import borrowed, clock, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.mesh_insides import encloses, has_inside
from vdsm_pin.geometry.obstacles import STACK
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.geometry.segments import squared_gap
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.scene import Obstacle, covers_of
from vdsm_pin.time_limit import NO_LIMIT, Deadline

STEP: Final = 1e-6
"""More than rounding takes from a distance, also beside nearly parallel edges; [m]."""
FLAT: Final = 1e-9
"""Height of a triangle, over its coordinates, below which rounding turns it; [-]."""
CROWD: Final = 4
"""At most so many triangles are looked at one by one."""


@dataclass(frozen=True)
class Surfaces:
    """Triangles of surfaces, and balls round ever smaller groups of them.

    Ball 1 holds all triangles, and balls 2 k and 2 k + 1 hold the halves of those of
    ball k.

    Args:
        corners: Shape (t, 3, 3); [m].
        planes: Their unit normals and offsets, 0 where rounding decides, shape (t, 4).
        first: Where the triangles of each ball begin, and where they end, shape (b, 2).
        balls: Centres and radii, shape (b, 4); [m].
        solids: The meshes that have an inside.
        covers: What `encloses` asks of their pieces.
    """

    corners: FloatArray
    planes: FloatArray
    first: IntArray
    balls: FloatArray
    solids: PackedPieces
    covers: IntArray

    def least(
        self,
        ends: FloatArray,
        floor: float,
        enough: float,
        deadline: Deadline = NO_LIMIT,
    ) -> FloatArray:
        """Lower bounds of the distance of segments to the meshes, shape (n,); [m].

        Each is less than two steps below the distance; -inf within a solid, and where
        the distance is below `floor`.

        Args:
            ends: Shape (n, 2, 3); [m].
            floor: A distance below which nothing need be known; [m].
            enough: A bound from which on more need not be known; [m].
            deadline: When to give up.

        Raises:
            OutOfTime: If the time is over.
        """
        if not len(self.corners):
            return np.full(len(ends), np.inf)
        reach = enough + STEP
        bound = nearest_triangles(
            (self.corners, self.planes),
            self.first,
            self.balls,
            ends,
            floor,
            reach,
            deadline.end,
        )
        deadline.check()
        bound -= STEP
        bound[bound < floor - STEP] = -np.inf
        bound[buried(self.solids, self.covers, ends, bound > 0.0)] = -np.inf
        return bound


def surfaces_of(obstacles: tuple[Obstacle, ...]) -> Surfaces:
    """The surfaces of all meshes."""
    meshes = [obstacle for obstacle in obstacles if isinstance(obstacle, Mesh)]
    corners = np.concatenate([np.zeros((0, 3, 3)), *(m.pieces.corners for m in meshes)])
    corners = corners[coherent_order(corners.mean(axis=1))]
    solid = [mesh for mesh in meshes if mesh.has_inside]
    pieces = pack_pieces([mesh.pieces for mesh in solid])
    balls = _balls(corners)
    return Surfaces(corners, _planes(corners), *balls, pieces, covers_of(solid, pieces))


def _planes(corners: FloatArray) -> FloatArray:
    """Planes of triangles as `Surfaces` has them, shape (t, 4)."""
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    size = np.linalg.norm(normal, axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1, initial=0.0)
    wide = size > FLAT * longest * np.maximum(longest, np.abs(corners).max((1, 2)))
    normal = normal[wide] / size[wide, None]
    planes = np.zeros((len(corners), 4))
    planes[wide, :3] = normal
    planes[wide, 3] = (normal * corners[wide, 0]).sum(axis=1)
    return planes


def _balls(corners: FloatArray) -> tuple[IntArray, FloatArray]:
    """Triangles and balls as `Surfaces` has them, shape (b, 2) and (b, 4); [m]."""
    ranges, balls = [np.zeros((1, 2), np.int64)], [np.zeros((1, 4))]
    count = 1
    while len(corners):
        marks = np.arange(count + 1) * len(corners) // count
        sizes = np.diff(marks)
        low = np.minimum.reduceat(corners.min(axis=1), marks[:-1])
        high = np.maximum.reduceat(corners.max(axis=1), marks[:-1])
        centre = (low + high) / 2.0
        off = np.linalg.norm(
            corners - np.repeat(centre, sizes, axis=0)[:, None], axis=2
        )
        radius = np.maximum.reduceat(off.max(axis=1), marks[:-1])
        ranges.append(np.column_stack([marks[:-1], marks[1:]]))
        balls.append(np.column_stack([centre, radius]))
        if sizes.max() <= CROWD:
            break
        count *= 2
    return np.concatenate(ranges), np.concatenate(balls)


@compiled
def _from_ball(ball: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """Distance of a segment from a ball, negative within it; [m]."""
    along = span = 0.0
    for c in range(3):
        d = b[c] - a[c]
        along += (ball[c] - a[c]) * d
        span += d * d
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    square = 0.0
    for c in range(3):
        gap = ball[c] - a[c] - t * (b[c] - a[c])
        square += gap * gap
    return float(sqrt(square) - ball[3])


@compiled
def _from_triangle(corners: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """Squared distance of a segment from a triangle; [m^2].

    Nearest are an edge and the segment, or one of its ends and the triangle's inside,
    or the segment passes through it.
    """
    p, q, r = corners
    square = min(squared_gap(a, b, p, q), squared_gap(a, b, q, r))
    square = min(square, squared_gap(a, b, r, p))
    nx = (q[1] - p[1]) * (r[2] - p[2]) - (q[2] - p[2]) * (r[1] - p[1])
    ny = (q[2] - p[2]) * (r[0] - p[0]) - (q[0] - p[0]) * (r[2] - p[2])
    nz = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    size = nx * nx + ny * ny + nz * nz
    if not size > 0.0:
        return square
    above = nx * (a[0] - p[0]) + ny * (a[1] - p[1]) + nz * (a[2] - p[2])
    below = nx * (b[0] - p[0]) + ny * (b[1] - p[1]) + nz * (b[2] - p[2])
    normal = (nx, ny, nz)
    if above * below < 0.0 and _over(corners, normal, a, b, above / (above - below)):
        return 0.0
    if above * above < square * size and _over(corners, normal, a, b, 0.0):
        square = above * above / size
    if below * below < square * size and _over(corners, normal, a, b, 1.0):
        square = below * below / size
    return square


@compiled
def _over(
    corners: FloatArray,
    normal: tuple[float, float, float],
    a: FloatArray,
    b: FloatArray,
    t: float,
) -> bool:
    """Whether the place t from a to b is above or below a triangle, not beside it."""
    for k in range(3):
        p, q = corners[k], corners[(k + 1) % 3]
        side = 0.0
        for c in range(3):
            d, e = (c + 1) % 3, (c + 2) % 3
            x = a[d] + t * (b[d] - a[d]) - p[d]
            y = a[e] + t * (b[e] - a[e]) - p[e]
            side += normal[c] * ((q[d] - p[d]) * y - (q[e] - p[e]) * x)
        if side < 0.0:
            return False
    return True


@compiled
def _from_plane(plane: FloatArray, a: FloatArray, b: FloatArray) -> float:
    """Distance of a segment from a plane; [m]."""
    above = plane[0] * a[0] + plane[1] * a[1] + plane[2] * a[2] - plane[3]
    other = plane[0] * b[0] + plane[1] * b[1] + plane[2] * b[2] - plane[3]
    return float(max(min(above, other), min(-above, -other)))


@compiled
def _of_leaf(
    triangles: tuple[FloatArray, FloatArray],
    between: IntArray,
    a: FloatArray,
    b: FloatArray,
    best: float,
) -> float:
    """Distance of a segment to the triangles of a ball, at most `best`; [m]."""
    corners, planes = triangles
    for k in range(between[0], between[1]):
        if _from_plane(planes[k], a, b) < best:
            best = min(best, sqrt(_from_triangle(corners[k], a, b)))
    return best


@compiled
def nearest_triangles(
    triangles: tuple[FloatArray, FloatArray],
    first: IntArray,
    balls: FloatArray,
    ends: FloatArray,
    floor: float,
    enough: float,
    until: float,
) -> FloatArray:
    """Distance of segments to the nearest of some triangles, or `enough` if it is less.

    The search begins with the triangles where the segment before found its nearest, and
    ends at the first that is nearer than `floor`.

    Args:
        triangles: Their corners and planes, see `Surfaces`.
        first: See `Surfaces`.
        balls: See `Surfaces`.
        ends: Shape (n, 2, 3); [m].
        floor: The least distance that matters; [m].
        enough: The largest distance that matters; [m].
        until: When to stop, by the monotonic clock; [s].

    Returns:
        Shape (n,), 0 where the time was over; [m].
    """
    triangles, balls, ends = borrowed(triangles), borrowed(balls), borrowed(ends)
    result = np.zeros(ends.shape[0])
    stack, gaps = np.zeros(STACK, np.int64), np.zeros(STACK)
    nearest = balls.shape[0] - 1
    for n in range(ends.shape[0]):
        if clock() > until:
            break
        a, b = ends[n]
        best = enough
        if nearest > 0:
            best = _of_leaf(triangles, first[nearest], a, b, best)
        stack[0], gaps[0], waiting = 1, -np.inf, int(nearest > 0)
        while waiting > 0 and best >= floor:
            waiting -= 1
            ball = stack[waiting]
            if gaps[waiting] >= best:
                continue
            if 2 * ball >= balls.shape[0]:
                closer = _of_leaf(triangles, first[ball], a, b, best)
                if closer < best:
                    best, nearest = closer, ball
                continue
            near, far = 2 * ball, 2 * ball + 1
            gap, other = _from_ball(balls[near], a, b), _from_ball(balls[far], a, b)
            if gap > other:
                near, far, gap, other = far, near, other, gap
            stack[waiting], gaps[waiting] = far, other
            stack[waiting + 1], gaps[waiting + 1] = near, gap
            waiting += 2
        result[n] = best
    return result


@compiled
def buried(
    solids: PackedPieces, covers: IntArray, ends: FloatArray, asked: BoolArray
) -> BoolArray:
    """Which of the segments asked for begin within a solid, shape (n,).

    Args:
        solids: Meshes with an inside.
        covers: As for `encloses`.
        ends: Shape (n, 2, 3); [m].
        asked: Shape (n,).
    """
    solids = borrowed(solids)
    inside = np.zeros(ends.shape[0], dtype=np.bool_)
    for n in range(ends.shape[0]):
        if not asked[n]:
            continue
        for o in range(solids.root.size):
            if has_inside(solids, covers, o) and encloses(
                solids, covers, o, ends[n, 0]
            ):
                inside[n] = True
    return inside
