"""Faces of any number of corners to triangles between these corners.

A face is the fan about its first corner where no triangle of the fan is flat or turned
over; any other is cut by a constrained Delaunay triangulation, seen along the axis to
which its area is largest. Either way the directed edges of the triangles cancel to the
face's own edges and no triangle is turned over, so round every point they wind as often
as the face does: they cover it and nothing else. What cannot be cut like this has no
area or crosses itself; it stays a fan, which covers every point the face winds round.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class CutFaces:
    """Faces as triangles.

    Args:
        triangles: Vertex indices, shape (m, 3), face by face.
        bend: The largest distance between two corners of one face along its normal.
        crossed: How many faces cross themselves.
    """

    triangles: IntArray
    bend: float = 0.0
    crossed: int = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """What is worth telling."""
        if not self.crossed:
            return ()
        faces = "1 face crosses itself" if self.crossed == 1 else (
            f"{self.crossed} faces cross themselves"
        )  # fmt: skip
        return (f"{faces} and may be covered too widely",)


def cut_faces(vertices: FloatArray, corners: IntArray, sizes: IntArray) -> CutFaces:
    """Triangles that cover faces.

    Args:
        vertices: Shape (n, 3), finite.
        corners: Vertex indices of all faces, one after the other.
        sizes: How many corners each face has, 3 or more.

    Returns:
        The triangles in the order of the faces. A corner at the place of the one
        before counts once where a face is not a plain fan.
    """
    if (sizes == 3).all():
        return CutFaces(corners.reshape(-1, 3))
    starts, cuts = np.cumsum(sizes) - sizes, sizes - 2
    firsts = np.cumsum(cuts) - cuts
    apex = np.repeat(starts, cuts)
    second = apex + 1 + np.arange(len(apex)) - np.repeat(firsts, cuts)
    triangles = corners[np.column_stack([apex, second, second + 1])]
    areas = _areas(vertices[triangles])
    normals = np.add.reduceat(areas, firsts, axis=0)
    turned = np.einsum("ij,ij->i", areas, np.repeat(normals, cuts, axis=0)) <= 0.0
    doubtful = np.flatnonzero(np.logical_or.reduceat(turned, firsts) & (sizes > 3))
    keep, crossed = np.ones(len(triangles), dtype=np.bool_), 0
    for face in doubtful:
        loop = _without_repeats(
            corners[starts[face] : starts[face] + sizes[face]], vertices
        )
        cut = _cut(vertices[loop], normals[face])
        first, last = firsts[face], firsts[face] + cuts[face]
        if cut is None:
            crossed += bool(areas[first:last].any())
            continue
        triangles[first : first + len(cut)] = loop[cut]
        keep[first + len(cut) : last] = False
    bend = _bend(vertices, corners, sizes, normals)
    return CutFaces(triangles[keep], bend, crossed)


def _without_repeats(loop: IntArray, vertices: FloatArray) -> IntArray:
    """Corners without those at the place of the one before, cyclically."""
    points = vertices[loop]
    differ = (points != np.roll(points, 1, axis=0)).any(axis=1)
    return np.asarray(loop[differ])


def _areas(corners: FloatArray) -> FloatArray:
    """Twice the area vectors of triangles, shape (m, 3, 3) to (m, 3)."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _bend(
    vertices: FloatArray, corners: IntArray, sizes: IntArray, normals: FloatArray
) -> float:
    lengths = np.linalg.norm(normals, axis=1)
    flat = (sizes == 3) | ~(lengths > 0.0)
    units = normals / np.where(flat, np.inf, lengths)[:, None]
    starts = np.cumsum(sizes) - sizes
    offsets = vertices[corners] - np.repeat(vertices[corners[starts]], sizes, axis=0)
    heights = np.einsum("ij,ij->i", offsets, np.repeat(units, sizes, axis=0))
    highest = np.maximum.reduceat(heights, starts)
    return float((highest - np.minimum.reduceat(heights, starts)).max())


def _cut(points: FloatArray, normal: FloatArray) -> IntArray | None:
    """The triangles of one face by corner numbers, shape (k - 2, 3), or None.

    Args:
        points: Its corners in order, shape (k, 3).
        normal: Its area vector, shape (3,).
    """
    import shapely  # slow to import, and few meshes need it

    if len(points) < 3:
        return None
    seen = np.delete(points, int(np.argmax(np.abs(normal))), axis=1)
    number: dict[tuple[float, float], int] = {}
    loop = [number.setdefault((u, v), i) for i, (u, v) in enumerate(seen.tolist())]
    if (points[loop] != points).any():
        return None  # two corners one above the other
    try:
        parts = shapely.constrained_delaunay_triangles(shapely.Polygon(seen)).geoms
        found = [[number[p] for p in part.exterior.coords[:3]] for part in parts]
    except (shapely.errors.GEOSException, KeyError):
        return None
    cut = np.array(found, dtype=np.int64).reshape(-1, 3)
    down = _areas(points[cut]) @ normal < 0.0
    cut[down] = cut[down, ::-1]
    whole = len(cut) == len(points) - 2 and _edges(cut.tolist()) == _edges([loop])
    return cut if whole else None


def _edges(loops: list[list[int]]) -> dict[tuple[int, int], int]:
    """How much oftener loops run along each edge than back."""
    ahead = Counter(pair for loop in loops for pair in pairwise([*loop, loop[0]]))
    return ahead - Counter((j, i) for i, j in ahead.elements())
