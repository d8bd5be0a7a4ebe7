"""How far links are from the surfaces of meshes, in closed form.

A proved distance to a mesh takes a bracket for every triangle that is near. A planner
asks far too often for that, and needs no proof: here a segment is held against each
triangle in plain arithmetic. Balls round ever smaller groups of triangles, and slabs
that hold them between two planes, spare most of them.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, clock, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.mesh_insides import encloses, has_inside
from vdsm_pin.geometry.obstacles import STACK
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.scene import Obstacle, covers_of
from vdsm_pin.time_limit import NO_LIMIT, Deadline

STEP: Final = 1e-6
"""More than rounding takes from a distance beside an arm of some metres, also beside
nearly parallel edges; [m]."""
FLAT: Final = 1e-9
"""Height of a triangle, over its coordinates, below which rounding turns it; [-]."""
CROWD: Final = 4
"""At most so many triangles are looked at one by one."""


class Triangles(NamedTuple):
    """Triangles of surfaces."""

    corners: FloatArray
    """Shape (t, 3, 3); [m]."""

    planes: FloatArray
    """Their unit normals and offsets, 0 where rounding decides, shape (t, 4)."""

    edges: BoolArray
    """Which edges, each from one corner to the next, no triangle before has, shape
    (t, 3)."""


class Groups(NamedTuple):
    """Ever smaller groups of triangles.

    Group 1 has all of them, and groups 2 k and 2 k + 1 have the halves of group k.
    """

    first: IntArray
    """Where the triangles of each begin, and where they end, shape (b, 2)."""

    balls: FloatArray
    """Centres and radii of balls that hold them, shape (b, 4); [m]."""

    slabs: FloatArray
    """Unit normals of planes, and the two offsets between which they lie, shape
    (b, 5)."""


@dataclass(frozen=True)
class Surfaces:
    """What a segment is held against.

    Args:
        triangles: Of all surfaces.
        groups: Of these.
        solids: The meshes that have an inside.
        covers: What `encloses` asks of their pieces.
        step: More than rounding takes from a distance, see `STEP`; [m].
    """

    triangles: Triangles
    groups: Groups
    solids: PackedPieces
    covers: IntArray
    step: float = STEP

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
        if not len(self.triangles.corners):
            return np.full(len(ends), np.inf)
        reach = enough + self.step
        bound = nearest_triangles(
            self.triangles, self.groups, ends, floor, reach, deadline.end
        )
        deadline.check()
        bound -= self.step
        bound[bound < floor - self.step] = -np.inf
        bound[buried(self.solids, self.covers, ends, bound > 0.0)] = -np.inf
        return bound


def surfaces_of(obstacles: tuple[Obstacle, ...], step: float = STEP) -> Surfaces:
    """The surfaces of all meshes, and what is taken off a distance; [m]."""
    meshes = [obstacle for obstacle in obstacles if isinstance(obstacle, Mesh)]
    corners = np.concatenate([np.zeros((0, 3, 3)), *(m.pieces.corners for m in meshes)])
    corners = corners[coherent_order(corners.mean(axis=1))]
    solid = [mesh for mesh in meshes if mesh.has_inside]
    pieces = pack_pieces([mesh.pieces for mesh in solid])
    triangles = Triangles(corners, _planes(corners), _new_edges(corners))
    covers = covers_of(solid, pieces)
    return Surfaces(triangles, _groups(corners), pieces, covers, step)


def _new_edges(corners: FloatArray) -> BoolArray:
    """Edges as `Triangles` has them, shape (t, 3)."""
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    # Both triangles of an edge have its ends in another order.
    differ = ends[:, 0] != ends[:, 1]
    rows, axis = np.arange(len(ends)), differ.argmax(axis=1)
    turned = ends[rows, 0, axis] > ends[rows, 1, axis]
    ends[turned] = ends[turned, ::-1]
    _, number = np.unique(ends.reshape(-1, 6), axis=0, return_index=True)
    new = np.zeros(len(ends), dtype=np.bool_)
    new[number] = True
    return new.reshape(-1, 3)


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


def _groups(corners: FloatArray) -> Groups:
    """Groups of triangles, shape (t, 3, 3); [m]."""
    sides = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(sides[:, 0], sides[:, 1])
    ranges, balls = [np.zeros((1, 2), np.int64)], [np.zeros((1, 4))]
    slabs, count = [np.zeros((1, 5))], 1
    while len(corners):
        marks = np.arange(count + 1) * len(corners) // count
        sizes, at = np.diff(marks), marks[:-1]
        low = np.minimum.reduceat(corners.min(axis=1), at)
        high = np.maximum.reduceat(corners.max(axis=1), at)
        centre = (low + high) / 2.0
        off = corners - np.repeat(centre, sizes, axis=0)[:, None]
        radius = np.maximum.reduceat(np.linalg.norm(off, axis=2).max(axis=1), at)
        normal = np.add.reduceat(normals, at)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.where(size > 0.0, normal / np.where(size > 0.0, size, 1.0), 0.0)
        height = (corners * np.repeat(normal, sizes, axis=0)[:, None]).sum(axis=2)
        least = np.minimum.reduceat(height.min(axis=1), at)
        most = np.maximum.reduceat(height.max(axis=1), at)
        ranges.append(np.column_stack([at, marks[1:]]))
        balls.append(np.column_stack([centre, radius]))
        slabs.append(np.column_stack([normal, least, most]))
        if sizes.max() <= CROWD:
            break
        count *= 2
    return Groups(np.concatenate(ranges), np.concatenate(balls), np.concatenate(slabs))


@compiled
def _from_group(
    ball: FloatArray, slab: FloatArray, a: FloatArray, b: FloatArray
) -> float:
    """Lower bound of the distance of a segment from a group of triangles; [m]."""
    along = span = above = below = 0.0
    for c in range(3):
        d = b[c] - a[c]
        along += (ball[c] - a[c]) * d
        span += d * d
        above += slab[c] * a[c]
        below += slab[c] * b[c]
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    square = 0.0
    for c in range(3):
        gap = ball[c] - a[c] - t * (b[c] - a[c])
        square += gap * gap
    beside = max(min(above, below) - slab[4], slab[3] - max(above, below))
    return float(max(sqrt(square) - ball[3], beside))


@compiled
def _from_edges(
    corners: FloatArray, edges: BoolArray, a: FloatArray, b: FloatArray
) -> float:
    """Squared distance of a segment from edges of a triangle; [m^2].

    Of each edge the place nearest to the segment's line, moved to an end where it must
    be, and the place on the segment nearest to that: never less than the distance.
    """
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    uu, square = ux * ux + uy * uy + uz * uz, np.inf
    for k in range(3):
        if not edges[k]:
            continue
        p, q = corners[k], corners[(k + 1) % 3]
        vx, vy, vz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        wx, wy, wz = a[0] - p[0], a[1] - p[1], a[2] - p[2]
        vv, uv = vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
        uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
        cross = uu * vv - uv * uv
        s = min(1.0, max(0.0, (uv * vw - vv * uw) / cross)) if cross > 0.0 else 0.0
        t = (uv * s + vw) / vv if vv > 0.0 else 0.0
        if not 0.0 < t < 1.0:
            t = min(1.0, max(0.0, t))
            s = min(1.0, max(0.0, (uv * t - uw) / uu)) if uu > 0.0 else 0.0
        x, y, z = wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz
        square = min(square, x * x + y * y + z * z)
    return float(square)


@compiled
def _over(
    corners: FloatArray, plane: FloatArray, a: FloatArray, b: FloatArray, t: float
) -> bool:
    """Whether the place t from a to b is above or below a triangle, not beside it."""
    for k in range(3):
        p, q = corners[k], corners[(k + 1) % 3]
        vx, vy, vz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        x, y = a[0] + t * (b[0] - a[0]) - p[0], a[1] + t * (b[1] - a[1]) - p[1]
        z = a[2] + t * (b[2] - a[2]) - p[2]
        side = plane[0] * (vy * z - vz * y) + plane[1] * (vz * x - vx * z)
        if side + plane[2] * (vx * y - vy * x) < 0.0:
            return False
    return True


@compiled
def _of_leaf(
    triangles: Triangles, between: IntArray, a: FloatArray, b: FloatArray, best: float
) -> float:
    """Distance of a segment to some triangles in a row, at most `best`; [m].

    Nearest are an edge and the segment, or one of its ends and the triangle's inside,
    or the segment passes through it. An edge of two triangles is left to one of them.
    """
    corners, planes, edges = triangles.corners, triangles.planes, triangles.edges
    for k in range(between[0], between[1]):
        nx, ny, nz, offset = planes[k]
        above = nx * a[0] + ny * a[1] + nz * a[2] - offset
        below = nx * b[0] + ny * b[1] + nz * b[2] - offset
        if max(min(above, below), min(-above, -below)) >= best:
            continue
        square = _from_edges(corners[k], edges[k], a, b)
        if nx != 0.0 or ny != 0.0 or nz != 0.0:
            t = above / (above - below) if above * below < 0.0 else 0.0
            if t > 0.0 and _over(corners[k], planes[k], a, b, t):
                return 0.0
            most = min(square, best * best)
            if above * above < most and _over(corners[k], planes[k], a, b, 0.0):
                square = above * above
            if below * below < most and _over(corners[k], planes[k], a, b, 1.0):
                square = min(square, below * below)
        best = min(best, sqrt(square))
    return best


@compiled
def nearest_triangles(
    triangles: Triangles,
    groups: Groups,
    ends: FloatArray,
    floor: float,
    enough: float,
    until: float,
) -> FloatArray:
    """Distance of segments to the nearest of some triangles, or `enough` if it is less.

    The search begins with the triangles where the segment before found its nearest, and
    ends at the first that is nearer than `floor`.

    Args:
        triangles: The triangles.
        groups: Of these.
        ends: Shape (n, 2, 3); [m].
        floor: The least distance that matters; [m].
        enough: The largest distance that matters; [m].
        until: When to stop, by the monotonic clock; [s].

    Returns:
        Shape (n,), 0 where the time was over; [m].
    """
    triangles, groups, ends = borrowed(triangles), borrowed(groups), borrowed(ends)
    first, balls, slabs = groups.first, groups.balls, groups.slabs
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
        while waiting > 0 and best >= floor and best > 0.0:
            waiting -= 1
            group = stack[waiting]
            if gaps[waiting] >= best:
                continue
            if 2 * group >= balls.shape[0]:
                closer = _of_leaf(triangles, first[group], a, b, best)
                if closer < best:
                    best, nearest = closer, group
                continue
            near, far = 2 * group, 2 * group + 1
            gap = _from_group(balls[near], slabs[near], a, b)
            other = _from_group(balls[far], slabs[far], a, b)
            if gap > other:
                near, far, gap, other = far, near, other, gap
            for one, least in ((far, other), (near, gap)):
                if least < best:
                    stack[waiting], gaps[waiting] = one, least
                    waiting += 1
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
