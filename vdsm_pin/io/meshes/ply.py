"""PLY, text and binary of either byte order: the elements `vertex` and `face`."""

import sys
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.io.meshes.faces import cut_faces
from vdsm_pin.io.meshes.raw import MAX_MESH_LINE, MeshStream, RawMesh, doubles

_KINDS: Final = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_FORMATS: Final[dict[str, Literal["", "little", "big"]]] = {
    "ascii": "", "binary_little_endian": "little", "binary_big_endian": "big",
}  # fmt: skip
_MOST_LINES: Final = 10_000


@dataclass(frozen=True)
class _Property:
    """One value of an element, or a list of values behind their number."""

    name: str
    kind: str
    count_kind: str = ""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


@dataclass(frozen=True)
class _Header:
    """What the header says: byte order, "" for text, and the elements in order."""

    order: Literal["", "little", "big"]
    elements: dict[str, _Element]
    lines: int


@dataclass(frozen=True)
class _Column:
    """A property of all elements: values one after the other, how many of each."""

    values: FloatArray
    sizes: IntArray


_Columns = dict[str, _Column]


def read_ply(stream: MeshStream) -> RawMesh:
    """The triangles of a PLY file.

    Raises:
        InvalidFile: If the header is no PLY's, or the file is damaged.
    """
    header = _header(stream)
    if "tristrips" in header.elements:
        raise stream.invalid(fault="has triangle strips, expected faces")
    read = _elements(stream, header)
    face = read.get("face", {})
    corners = face.get("vertex_indices") or face.get("vertex_index")
    if corners is None:
        raise stream.invalid(fault="has no vertex_indices of its faces")
    return _mesh(stream, _vertices(stream, read), corners)


def read_ply_points(stream: MeshStream) -> FloatArray:
    """The vertices of a PLY file, shape (n, 3), whether or not it has faces.

    Raises:
        InvalidFile: If the header is no PLY's, or the file is damaged.
    """
    return _vertices(stream, _elements(stream, _header(stream)))


def _elements(stream: MeshStream, header: _Header) -> dict[str, _Columns]:
    """Every element by name."""
    return _Binary(stream, header).read() if header.order else _text(stream, header)


def _announced(header: _Header) -> str:
    return ", ".join(f"{one.count} of {one.name!r}" for one in header.elements.values())


def _vertices(stream: MeshStream, read: dict[str, _Columns]) -> FloatArray:
    axes = [read.get("vertex", {}).get(axis) for axis in "xyz"]
    columns = [axis.values for axis in axes if axis is not None]
    if len(columns) != 3:
        raise stream.invalid(fault="has no x, y, z of its vertices")
    if len({len(column) for column in columns}) != 1:
        raise stream.invalid(fault="has lists where x, y and z are meant")
    return np.column_stack(columns)


def _mesh(stream: MeshStream, vertices: FloatArray, faces: _Column) -> RawMesh:
    long = faces.sizes >= 3
    corners, sizes = faces.values[np.repeat(long, faces.sizes)], faces.sizes[long]
    stream.check_count(len(corners) - 2 * len(sizes))
    good = (corners >= 0) & (corners < len(vertices)) & (corners % 1 == 0)
    if not good.all():
        wrong = corners[np.argmin(good)]
        fault = f"a face names vertex {wrong:g}, expected 0 to {len(vertices) - 1}"
        raise stream.invalid(fault)
    numbers = corners.astype(np.int64)
    stream.check_numbers(vertices, "vertex", used=numbers)
    cut = cut_faces(vertices, numbers, sizes)
    short = int((~long).sum())
    left_out = (f"faces of less than three corners left out: {short}",) if short else ()
    notes = (*cut.notes, *left_out)
    return RawMesh(vertices, cut.triangles, bend=cut.bend, notes=notes)


def _header(stream: MeshStream) -> _Header:
    order: Literal["", "little", "big"] | None = None
    elements = dict[str, _Element]()
    latest: list[_Property] | None = None
    for number in range(1, _MOST_LINES + 1):
        raw = stream.content.readline(MAX_MESH_LINE).decode("latin-1")
        match raw.split():
            case ["ply"] if number == 1:
                pass
            case ["comment" | "obj_info", *_] if number > 1:
                pass
            case ["format", name, _] if name in _FORMATS:
                order = _FORMATS[name]
            case ["element", name, _] if name in elements:
                fault = f"has the element {name[:60]!r} twice"
                raise stream.invalid(fault, line=number)
            case ["property", *_, name] if name in (one.name for one in latest or ()):
                fault = f"has the property {name[:60]!r} twice"
                raise stream.invalid(fault, line=number)
            case ["element", name, count] if count.isdecimal() and len(count) < 12:
                stream.check_room(int(count))
                elements[name] = _Element(name, int(count))
                latest = elements[name].properties
            case ["property", kind, name] if latest is not None and kind in _KINDS:
                latest.append(_Property(name, _KINDS[kind]))
            case ["property", "list", number_kind, kind, name] if (
                latest is not None
                and {number_kind, kind} <= set(_KINDS)
                and _KINDS[number_kind][0] != "f"
            ):
                latest.append(_Property(name, _KINDS[kind], _KINDS[number_kind]))
            case ["end_header"] if order is not None:
                return _Header(order, elements, number)
            case _:
                fault = f"is no header of a PLY file: {raw.strip()[:60]!r}"
                raise stream.invalid(fault, line=number)
    raise stream.invalid(fault=f"has a header of more than {_MOST_LINES} lines")


def _text(stream: MeshStream, header: _Header) -> dict[str, _Columns]:
    numbered = ((n + header.lines, line.split()) for n, line in stream.lines())
    lines = ((number, words) for number, words in numbered if words)
    found = {}
    for element in header.elements.values():
        values = [array("d") for _ in element.properties]
        sizes = [array("q") for _ in element.properties]
        for i in range(element.count):
            number, words = next(lines, (0, []))
            if not words:
                promised = f"promises {element.count} of {element.name!r}, has {i}"
                raise stream.invalid(fault=f"is cut short: its header {promised}")
            for k, one in enumerate(_split(stream, element, words, number)):
                values[k].extend(stream.numbers(one, len(one), number))
                sizes[k].append(len(one))
        found[element.name] = {
            one.name: _Column(np.array(values[k]), np.array(sizes[k]))
            for k, one in enumerate(element.properties)
        }
    stream.check_end(next(lines, None), _announced(header))
    return found


def _split(
    stream: MeshStream, element: _Element, words: list[str], line: int
) -> Iterator[list[str]]:
    """The words of one element, property by property."""
    place = 0
    for one in element.properties:
        size = 1
        if one.count_kind:
            head = words[place : place + 1]
            number, place = stream.numbers(head, 1, line)[0], place + 1
            whole = 0 <= number <= len(words) and number % 1 == 0
            size = int(number) if whole else -1
        part = words[place : place + size]
        if size < 0 or len(part) != size:
            fault = f"has {len(words)} values, too few for {element.name!r}"
            raise stream.invalid(fault, line=line)
        yield part
        place += size
    if place != len(words):
        fault = f"has {len(words)} values, {element.name!r} has {place}"
        raise stream.invalid(fault, line=line)


class _Binary:
    """The elements of a binary file, as many as there must be."""

    def __init__(self, stream: MeshStream, header: _Header) -> None:
        self._stream, self._header = stream, header
        self._order = header.order or sys.byteorder
        self._sign = ">" if self._order == "big" else "<"
        self._data, self._offset = stream.content.read(), 0

    def read(self) -> dict[str, _Columns]:
        """Every element by name."""
        found = {}
        for element in self._header.elements.values():
            columns = self._alike(element)
            if columns is None:
                columns = self._one_by_one(element, element.count)
            found[element.name] = columns
        self._stream.check_end(self._data[self._offset :], _announced(self._header))
        return found

    def _alike(self, element: _Element) -> _Columns | None:
        """All records at once where every list is as long as in the first one."""
        if not element.count or not element.properties:
            return None
        start, fields = self._offset, []
        first = self._one_by_one(element, 1)
        self._offset = start
        sizes = [int(column.sizes[0]) for column in first.values()]
        for k, (one, size) in enumerate(zip(element.properties, sizes, strict=True)):
            if one.count_kind:
                fields.append((f"n{k}", self._sign + one.count_kind, (1,)))
            fields.append((f"p{k}", self._sign + one.kind, (size,)))
        kind = np.dtype(fields)
        if element.count * kind.itemsize > len(self._data) - start:
            return None
        table = np.frombuffer(self._data, kind, element.count, start)
        lists = [k for k, one in enumerate(element.properties) if one.count_kind]
        if any((table[f"n{k}"] != sizes[k]).any() for k in lists):
            return None
        self._offset = start + element.count * kind.itemsize
        return {
            one.name: _Column(
                doubles(table[f"p{k}"]).reshape(-1), np.full(element.count, sizes[k])
            )
            for k, one in enumerate(element.properties)
        }

    def _one_by_one(self, element: _Element, count: int) -> _Columns:
        chunks = [bytearray() for _ in element.properties]
        sizes = [array("q") for _ in element.properties]
        for _ in range(count):
            for k, one in enumerate(element.properties):
                size = self._list_size(one) if one.count_kind else 1
                last = self._offset + size * int(one.kind[1])
                if size < 0 or last > len(self._data):
                    raise self._cut_short(element)
                chunks[k] += self._data[self._offset : last]
                sizes[k].append(size)
                self._offset = last
        return {
            one.name: _Column(
                doubles(np.frombuffer(chunks[k], self._sign + one.kind)),
                np.array(sizes[k]),
            )
            for k, one in enumerate(element.properties)
        }

    def _list_size(self, one: _Property) -> int:
        last = self._offset + int(one.count_kind[1])
        part = self._data[self._offset : last]
        self._offset = last
        return int.from_bytes(part, self._order, signed=one.count_kind[0] == "i")

    def _cut_short(self, element: _Element) -> Exception:
        fault = (
            f"is cut short: its header promises {element.count} of {element.name!r}, "
            "fewer bytes follow"
        )
        return self._stream.invalid(fault)
