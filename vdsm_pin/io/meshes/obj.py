"""Wavefront OBJ: vertices and faces, line by line.

Groups, materials, normals and texture are passed over; lines and points have no
surface. What has one and is not read is refused.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from vdsm_pin.io.meshes.faces import cut_faces
from vdsm_pin.io.meshes.raw import MAX_MESH_LINE, MeshStream, RawMesh

_FREE_FORM: Final = frozenset({"cstype", "curv", "curv2", "surf", "bzp", "bsp", "cdp"})
_ELSEWHERE: Final = frozenset({"call", "csh"})


@dataclass
class _Faces:
    """What was read so far: flat arrays, so that memory stays near the mesh's own."""

    vertices: "array[float]" = field(default_factory=lambda: array("d"))
    corners: "array[int]" = field(default_factory=lambda: array("q"))
    sizes: "array[int]" = field(default_factory=lambda: array("q"))
    lines: int = 0


def read_obj(stream: MeshStream) -> RawMesh:
    """The triangles of an OBJ file.

    Raises:
        InvalidFile: If a vertex or face is damaged, or a surface is of another kind.
    """
    faces = _Faces()
    for number, line in _whole_lines(stream):
        words = line.split()
        match words[0] if words else "":
            case "v":
                faces.vertices.extend(stream.numbers(words[1:4], 3, number))
                stream.check_room(len(faces.vertices) // 3)
            case "f" | "fo":
                _read_face(words[1:], faces, stream, number)
            case "l" | "p":
                faces.lines += 1
            case word if word in _FREE_FORM:
                fault = f"has a free-form curve or surface ({word}), expected faces"
                raise stream.invalid(fault, line=number)
            case word if word in _ELSEWHERE:
                fault = f"takes in another file ({word}), expected all in one"
                raise stream.invalid(fault, line=number)
    return _mesh(faces, stream)


def _mesh(faces: _Faces, stream: MeshStream) -> RawMesh:
    vertices = np.array(faces.vertices, dtype=np.float64).reshape(-1, 3)
    corners = np.array(faces.corners, dtype=np.int64)
    sizes = np.array(faces.sizes, dtype=np.int64)
    stream.check_count(len(corners) - 2 * len(sizes))
    stream.check_numbers(vertices, "vertex", used=corners)
    cut = cut_faces(vertices, corners, sizes)
    lines = (f"lines and points left out: {faces.lines}",) if faces.lines else ()
    return RawMesh(vertices, cut.triangles, bend=cut.bend, notes=(*cut.notes, *lines))


def _whole_lines(stream: MeshStream) -> Iterator[tuple[int, str]]:
    """Lines without remarks; one that ends in a backslash goes on in the next."""
    first, begun, length = 0, list[str](), 0
    for number, line in stream.lines():
        plain, remark, _ = line.partition("#")
        plain = plain.rstrip()
        goes_on = plain.endswith("\\") and not remark
        if not begun and not goes_on:
            yield number, plain
            continue
        first, length = first or number, length + len(plain)
        begun.append(plain[:-1] if goes_on else plain)
        if length > MAX_MESH_LINE:
            fault = f"goes on for more than {MAX_MESH_LINE} characters"
            raise stream.invalid(fault, line=first)
        if not goes_on:
            yield first, " ".join(begun)
            first, begun, length = 0, [], 0
    if begun:
        yield first, " ".join(begun)


def _read_face(words: list[str], faces: _Faces, stream: MeshStream, line: int) -> None:
    """Corners such as 7, 7/1 or -2//3, counted from 0."""
    count = len(faces.vertices) // 3
    if len(words) < 3:
        fault = f"a face has {len(words)} corners, expected 3 or more"
        raise stream.invalid(fault, line=line)
    for word in words:
        digits = word.partition("/")[0]
        try:
            index = int(digits)
        except ValueError:
            index = 0
        index = index - 1 if index > 0 else count + index
        if not 0 <= index < count or "_" in digits:
            named = f"the face corner {word[:40]!r}"
            fault = f"{named} names none of the {count} vertices above"
            raise stream.invalid(fault, line=line)
        faces.corners.append(index)
    faces.sizes.append(len(words))
    stream.check_room(0, len(faces.corners))
