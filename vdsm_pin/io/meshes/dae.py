"""COLLADA (DAE): the scene's triangles in metres, as its transforms place them.

Everything that has faces is read or refused: nothing is left out silently.
"""

import math
from collections.abc import Callable, Iterator
from typing import Final
from xml.etree.ElementTree import Element as _Element

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.io.meshes.faces import cut_faces
from vdsm_pin.io.meshes.raw import MeshStream, RawMesh
from vdsm_pin.io.meshes.scene import Placed, composed, strip_triangles
from vdsm_pin.io.xml_reader import read_xml

MAX_BYTES: Final = 256 << 20
"""Largest file read, as XML takes several times its size; [bytes]."""

MAX_NODES: Final = 100_000

_LARGEST_INT: Final = 1 << 40

_FACES: Final = frozenset({"triangles", "polylist", "polygons", "tristrips", "trifans"})
_LINES: Final = frozenset({"lines", "linestrips"})
_OTHERS: Final = frozenset({"convex_mesh", "spline", "brep"})


def read_dae(stream: MeshStream) -> RawMesh:
    """The triangles of the scene of a COLLADA file; its unit is the one it states.

    Raises:
        InvalidFile: If it is damaged, or has faces in a form that is not read.
    """
    if stream.size > MAX_BYTES:
        fault = f"is larger than {MAX_BYTES >> 20} MiB, the most that is read as XML"
        raise stream.invalid(fault)
    content = stream.content.read()
    plain = content.replace(b"\0", b"")  # of two bytes or four a letter, perhaps
    if b"<!DOCTYPE" in plain:  # whose entities may grow without end
        raise stream.invalid(fault="has a DOCTYPE, expected plain XML")
    root = read_xml(content, stream.path)
    if _tag(root) != "COLLADA":
        fault = f"is no COLLADA file: its root is {_tag(root)[:40]!r}"
        raise stream.invalid(fault)
    return _Reader(stream, root).read()


def _tag(element: _Element) -> str:
    """The name without its namespace."""
    return element.tag.rpartition("}")[2]


def _children(element: _Element, *tags: str) -> Iterator[_Element]:
    return (child for child in element if _tag(child) in tags)


class _Reader:
    """The scene of one document, node by node."""

    def __init__(self, stream: MeshStream, root: _Element) -> None:
        self._stream, self._root = stream, root
        self._by_id = dict[str, list[_Element]]()
        for element in root.iter():
            self._by_id.setdefault(element.get("id", ""), []).append(element)
        self._parts: dict[_Element, list[RawMesh]] = {}
        self._placed, self._notes = Placed(stream), dict[str, int]()
        self._bend, self._n_nodes = 0.0, 0

    def read(self) -> RawMesh:
        """All triangles of the scene."""
        for node in self._roots():
            self._walk(node, np.eye(4), 0)
        notes = [f"{what}: {count}" for what, count in self._notes.items()]
        if self._first("animation") is not None:
            notes.append("its motion is not read: parts stand where their nodes do")
        up = self._first("up_axis")
        if up is not None and (axis := (up.text or "").strip()) in ("X_UP", "Y_UP"):
            notes.append(f"its {axis[0]} axis points up; axes are kept as they are")
        return self._placed.mesh(self._unit(), bend=self._bend, notes=notes)

    def _first(self, tag: str) -> _Element | None:
        """The first element of a tag anywhere in the file."""
        return next((e for e in self._root.iter() if _tag(e) == tag), None)

    def _unit(self) -> float:
        """Metres per unit; 1 where the file leaves it out, as COLLADA has it."""
        for asset in _children(self._root, "asset"):
            for unit in _children(asset, "unit"):
                metres = self._floats(unit.get("meter", "1"), 1)[0]
                if not 1e-9 <= metres <= 1e9:
                    fault = f"its unit is {metres:g} m, expected 1e-9 to 1e9"
                    raise self._stream.invalid(fault)
                return float(metres)
        return 1.0

    def _roots(self) -> Iterator[_Element]:
        for scene in _children(self._root, "scene"):
            for instance in _children(scene, "instance_visual_scene"):
                yield from _children(self._named(instance, "url"), "node")

    def _walk(self, node: _Element, pose: FloatArray, depth: int) -> None:
        self._n_nodes += 1
        if depth > 100 or self._n_nodes > MAX_NODES:
            raise self._stream.invalid(
                fault=f"has nodes 100 deep or more than {MAX_NODES}"
            )
        for child in node:
            tag = _tag(child)
            if tag in _MOVES:
                count, matrix = _MOVES[tag]
                move = matrix(self._floats(child.text or "", count))
                pose = composed(self._stream, pose, move)
            elif tag in ("skew", "lookat"):
                fault = f"places a part by <{tag}>, which is not read"
                raise self._stream.invalid(fault)
        for child in node:
            match _tag(child):
                case "node":
                    self._walk(child, pose, depth + 1)
                case "instance_node":
                    self._walk(self._named(child, "url"), pose, depth + 1)
                case "instance_geometry":
                    self._put(self._named(child, "url"), pose)
                case "instance_controller":
                    fault = "is bent by a skin; export it as it stands"
                    raise self._stream.invalid(fault)

    def _put(self, geometry: _Element, pose: FloatArray) -> None:
        if geometry not in self._parts:
            self._parts[geometry] = self._parts_of(geometry)
        self._placed.put(self._parts[geometry], pose)

    def _parts_of(self, geometry: _Element) -> list[RawMesh]:
        """The triangles of a geometry, which many nodes may place."""
        parts = []
        for mesh in geometry:
            if _tag(mesh) in _OTHERS:
                raise self._stream.invalid(
                    fault=f"has a <{_tag(mesh)}>, which is not read"
                )
            for faces in mesh:
                if _tag(faces) in _LINES:
                    what = "lines and points left out"
                    self._notes[what] = self._notes.get(what, 0) + 1
                elif _tag(faces) in _FACES:
                    parts.append(self._part(mesh, faces))
        return parts

    def _part(self, mesh: _Element, faces: _Element) -> RawMesh:
        """The triangles of one list of faces."""
        offset, stride, vertices = self._inputs(faces)
        loops = [
            self._ints(p.text or "")[offset::stride] for p in _children(faces, "p")
        ]
        if next(_children(faces, "ph"), None) is not None:
            fault = "has faces with holes (<ph>), which are not read"
            raise self._stream.invalid(fault)
        match _tag(faces):
            case "polygons":
                sizes = np.array([len(loop) for loop in loops], dtype=np.int64)
            case "polylist":
                counts = [c.text or "" for c in _children(faces, "vcount")]
                sizes = self._ints(" ".join(counts))
            case "triangles":
                sizes = np.full(sum(map(len, loops)) // 3, 3)
            case strip:
                fan = strip == "trifans"
                loops = [strip_triangles(loop, fan=fan).reshape(-1) for loop in loops]
                sizes = np.full(sum(map(len, loops)) // 3, 3)
        corners = np.concatenate([np.zeros(0, np.int64), *loops])
        good = (corners >= 0) & (corners < len(vertices))
        if not good.all() or len(corners) != sizes.sum() or (sizes < 0).any():
            fault = (
                f"<{_tag(faces)}> names vertices that are not there, or is cut short"
            )
            raise self._stream.invalid(fault)
        corners = corners[np.repeat(sizes >= 3, sizes)]
        self._stream.check_numbers(vertices, "vertex", used=corners)
        cut = cut_faces(vertices, corners, sizes[sizes >= 3])
        self._bend = max(self._bend, cut.bend)
        for note in cut.notes:
            self._notes[note] = self._notes.get(note, 0) + 1
        return RawMesh(vertices, cut.triangles)

    def _inputs(self, faces: _Element) -> tuple[int, int, FloatArray]:
        """Where vertex numbers stand among those of a corner, how many there are."""
        offset, stride, vertices = -1, 1, np.zeros((0, 3))
        for one in _children(faces, "input"):
            place = self._int(one.get("offset", "0"))
            stride = max(stride, place + 1)
            if one.get("semantic") == "VERTEX":
                offset, vertices = place, self._vertices(self._named(one, "source"))
        if not 0 <= offset < stride <= 64:
            raise self._stream.invalid(fault=f"<{_tag(faces)}> names no vertices")
        return offset, stride, vertices

    def _vertices(self, element: _Element) -> FloatArray:
        for one in _children(element, "input"):
            if one.get("semantic") == "POSITION":
                return self._source(self._named(one, "source"))
        raise self._stream.invalid(fault="has <vertices> without POSITION")

    def _source(self, source: _Element) -> FloatArray:
        """Points of a source, shape (n, 3)."""
        for common in _children(source, "technique_common"):
            for accessor in _children(common, "accessor"):
                array = self._named(accessor, "source")
                values = self._floats(array.text or "")
                names = [param.get("name") for param in _children(accessor, "param")]
                stride = self._int(accessor.get("stride", "1"))
                start = self._int(accessor.get("offset", "0"))
                count = self._int(accessor.get("count", "0"))
                if (
                    names != ["X", "Y", "Z"]
                    or stride < 3
                    or min(start, count) < 0
                    or start + count * stride > len(values)
                ):
                    fault = "has a source that is not X, Y, Z, or is cut short"
                    raise self._stream.invalid(fault)
                rows = values[start : start + count * stride].reshape(count, stride)
                return rows[:, :3]
        raise self._stream.invalid(fault="has a source without accessor")

    def _named(self, element: _Element, key: str) -> _Element:
        """What an element points to in this file."""
        name = element.get(key, "")
        found = self._by_id.get(name[1:], []) if name[:1] == "#" != name else []
        if len(found) != 1:
            place = f"there {len(found)} times" if found else "not in this file"
            raise self._stream.invalid(fault=f"names {name[:60]!r}, which is {place}")
        return found[0]

    def _floats(self, text: str, count: int | None = None) -> FloatArray:
        return np.array(self._numbers(text, float, count), dtype=np.float64)

    def _int(self, text: str) -> int:
        return int(self._numbers(text, int, 1)[0])

    def _ints(self, text: str) -> IntArray:
        return np.array(self._numbers(text, int, None), dtype=np.int64)

    def _numbers(
        self, text: str, kind: Callable[[str], float], count: int | None
    ) -> list[float]:
        words = text.split()
        try:
            values = list(map(kind, words)) if "_" not in text else []
        except ValueError:
            values = []
        good = all(-_LARGEST_INT < x < _LARGEST_INT for x in values if kind is int)
        if not good or len(values) != (len(words) if count is None else count):
            fault = f"found {' '.join(words[:9])[:60]!r} where numbers are meant"
            raise self._stream.invalid(fault)
        return values


def _translated(vector: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = vector
    return pose


def _turned(axis_angle: FloatArray) -> FloatArray:
    """A turn by an angle in degrees about an axis of any length (Rodrigues)."""
    length = float(np.linalg.norm(axis_angle[:3])) or 1.0
    x, y, z = axis_angle[:3] / length
    angle = math.radians(math.fmod(float(axis_angle[3]), 360.0))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    pose = np.eye(4)
    pose[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return pose


_MOVES: Final[dict[str, tuple[int, Callable[[FloatArray], FloatArray]]]] = {
    "matrix": (16, lambda values: values.reshape(4, 4)),
    "translate": (3, _translated),
    "rotate": (4, _turned),
    "scale": (3, lambda values: np.diag([*values, 1.0])),
}
