"""STL (binary and text) and OBJ files to triangles, in the order of the file.

No vertex is moved: corners are joined only where they are equal to the last bit, so
that a proof about these triangles is a proof about the file.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.io.schema_types import LARGEST
from vdsm_pin.io.source import decode, read_bytes

MAX_MESH_BYTES: Final = 1 << 30
MAX_TRIANGLES: Final = 5_000_000

_STL_HEADER: Final = 80
_STL_RECORD: Final = np.dtype(
    [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
)


@dataclass(frozen=True)
class MeshData:
    """Triangles as a file has them.

    Args:
        vertices: Shape (n, 3), in the unit of the file.
        triangles: Vertex indices, shape (m, 3), m >= 1.
        watertight: Whether the triangles enclose an inside, see `is_closed`.
        content: The bytes of the file.
    """

    vertices: FloatArray
    triangles: IntArray
    watertight: bool
    content: bytes


def read_mesh(path: Path) -> MeshData:
    """The triangles of an STL or OBJ file.

    Raises:
        InvalidFile: If the file cannot be read, is of another kind, is damaged, has no
            triangle, or has a coordinate that is not finite.
    """
    kind = path.suffix.lower()
    if kind not in (".stl", ".obj"):
        problem = f"has the ending {kind!r}, expected .stl or .obj"
        raise InvalidFile(file=path, problem=problem)
    content = read_bytes(path, limit=MAX_MESH_BYTES)
    if kind == ".obj":
        corners = _obj_corners(decode(content, path), path)
    elif _is_binary_stl(content):
        corners = _binary_stl_corners(content, path)
    else:
        corners = _text_stl_corners(content, path)
    _check_corners(corners, path)
    vertices, indices = _joined(corners.reshape(-1, 3))
    triangles = indices.reshape(-1, 3)
    return MeshData(vertices, triangles, is_closed(triangles), content)


def is_closed(triangles: IntArray) -> bool:
    """Whether every edge belongs to an even number of triangles, none degenerate.

    Then a ray from a point crosses the triangles an even number of times or an odd one,
    whatever its direction: the triangles part space into an outside and an inside.
    """
    starts, ends = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    if (starts == ends).any() or starts.size % 2:
        return False
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    edges = np.sort(low * (int(high.max()) + 1) + high)
    return bool((edges[0::2] == edges[1::2]).all())


def _joined(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """The different points among points, shape (n, 3), and which one each is."""
    index = np.zeros(len(points), dtype=np.int64)
    first = index
    for column in points.T:  # several times faster than numpy's unique rows
        _, rank = np.unique(column, return_inverse=True)
        key = index * (int(rank.max()) + 1) + rank
        _, first, index = np.unique(key, return_index=True, return_inverse=True)
    return points[first], index


def _check_corners(corners: FloatArray, path: Path) -> None:
    if not len(corners):
        raise InvalidFile(file=path, problem="has no triangle")
    if len(corners) > MAX_TRIANGLES:
        problem = f"has {len(corners)} triangles, the most is {MAX_TRIANGLES}"
        raise InvalidFile(file=path, problem=problem)
    good = (np.abs(corners) <= LARGEST).all(axis=(1, 2))
    if not good.all():
        first = int(np.argmin(good)) + 1
        problem = f"has a coordinate that is not a number up to {LARGEST:g}"
        raise InvalidFile(file=path, where=f"triangle {first}", problem=problem)


def _is_binary_stl(content: bytes) -> bool:
    """Text files begin with `solid`; so do some binary ones, whose size tells."""
    size = len(content) - _STL_HEADER - 4
    if size >= 0:
        count = int.from_bytes(content[_STL_HEADER : _STL_HEADER + 4], "little")
        if size == count * _STL_RECORD.itemsize:
            return True
    return not content.lstrip()[:5].lower() == b"solid"


def _binary_stl_corners(content: bytes, path: Path) -> FloatArray:
    size = len(content) - _STL_HEADER - 4
    if size < 0:
        problem = f"is neither text nor binary STL: only {len(content)} bytes"
        raise InvalidFile(file=path, problem=problem)
    count = int.from_bytes(content[_STL_HEADER : _STL_HEADER + 4], "little")
    expected = count * _STL_RECORD.itemsize
    if size != expected:
        problem = (
            f"is damaged: its header promises {count} triangles, {expected} bytes, "
            f"but {size} bytes follow"
        )
        raise InvalidFile(file=path, problem=problem)
    records = np.frombuffer(content, dtype=_STL_RECORD, offset=_STL_HEADER + 4)
    return np.asarray(records["corners"], dtype=np.float64)


def _text_stl_corners(content: bytes, path: Path) -> FloatArray:
    corners: list[list[float]] = []
    in_loop, last = 0, ""
    for number, line in enumerate(decode(content, path).splitlines(), 1):
        words = line.split()
        if not words:
            continue
        last = words[0].lower()
        if last == "outer":
            in_loop = len(corners)
        elif last == "vertex":
            corners.append(_numbers(words[1:], 3, path, number))
        elif last == "endloop" and len(corners) - in_loop != 3:
            problem = f"the facet has {len(corners) - in_loop} corners, expected 3"
            raise InvalidFile(file=path, where=f"line {number}", problem=problem)
    if last != "endsolid" or len(corners) % 3:
        raise InvalidFile(
            file=path, problem="is truncated: it does not end in endsolid"
        )
    return np.array(corners, dtype=np.float64).reshape(-1, 3, 3)


def _obj_corners(text: str, path: Path) -> FloatArray:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    polygons: list[tuple[int, slice]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        if words[0] == "v":
            vertices.append(_numbers(words[1:4], 3, path, number))
        elif words[0] == "f":
            face = [_index(word, len(vertices), path, number) for word in words[1:]]
            if len(face) < 3:
                problem = f"a face has {len(face)} corners, expected 3 or more"
                raise InvalidFile(file=path, where=f"line {number}", problem=problem)
            fan = [(face[0], b, c) for b, c in pairwise(face[1:])]
            polygons.append((number, slice(len(faces), len(faces) + len(fan))))
            faces += fan
    if not faces:
        return np.zeros((0, 3, 3))
    corners: FloatArray = np.array(vertices, dtype=np.float64)[np.array(faces)]
    _check_corners(corners, path)
    _check_fans(corners, polygons, path)
    return corners


def _check_fans(
    corners: FloatArray, polygons: list[tuple[int, slice]], path: Path
) -> None:
    """A fan about the first corner fills a face only if the face is convex."""
    for number, part in polygons:
        if part.stop - part.start > 1:
            sides = np.diff(corners[part], axis=1)
            normals = np.cross(sides[:, 0], sides[:, 1])
            if not (normals @ normals[0] >= 0.0).all():
                problem = "the face is not convex; expected triangles or convex faces"
                raise InvalidFile(file=path, where=f"line {number}", problem=problem)


def _index(word: str, count: int, path: Path, number: int) -> int:
    """Vertex index of a face corner such as 7, 7/1 or -2//3, counted from 0."""
    try:
        index = int(word.split("/", 1)[0])
    except ValueError:
        index = 0
    index = index - 1 if index > 0 else count + index
    if not 0 <= index < count:
        problem = f"the face corner {word!r} names none of the {count} vertices above"
        raise InvalidFile(file=path, where=f"line {number}", problem=problem)
    return index


def _numbers(words: list[str], count: int, path: Path, number: int) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) != count:
        problem = f"found {' '.join(words)!r}, expected {count} numbers"
        raise InvalidFile(file=path, where=f"line {number}", problem=problem)
    return values
