"""STL, binary and text, as programs write it."""

from array import array
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.meshes.raw import MeshStream, RawMesh, doubles

_HEADER: Final = 80
_START: Final = _HEADER + 4
_RECORD: Final = np.dtype(
    [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
)
_BLOCK: Final = 1 << 14  # records
_UNKNOWN: Final = (0, 0xFFFFFFFF)
"""Counts of programs that write the header before they know."""


def read_stl(stream: MeshStream) -> RawMesh:
    """The triangles of an STL file.

    A number of triangles below 2^24 ends in a zero byte, which text has not: this
    tells binary from text, whatever the first word is.

    Raises:
        InvalidFile: If it is damaged, or neither.
    """
    head = stream.content.peek(_START)[:_START]
    if head[2:12].replace(b"\0", b"").lower() == b"solid":
        raise stream.invalid(fault="is UTF-16 text, expected UTF-8 or ASCII")
    count = int.from_bytes(head[_HEADER:], "little")
    is_whole = len(head) == _START
    if is_whole and (head[-1] == 0 or count in _UNKNOWN):
        return _binary(stream, count)
    if head.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid":
        return _text(stream)
    fault = "is neither text nor binary STL"
    if not is_whole:
        fault += f": only {stream.size} bytes"
    raise stream.invalid(fault)


def _binary(stream: MeshStream, promised: int) -> RawMesh:
    stream.content.read(_START)
    count, notes = _count(stream, promised)
    stream.check_count(count)
    corners: FloatArray = np.zeros((count, 3, 3))
    for first in range(0, count, _BLOCK):
        last = min(first + _BLOCK, count)
        block = stream.content.read((last - first) * _RECORD.itemsize)
        corners[first:last] = doubles(np.frombuffer(block, _RECORD)["corners"])
    return _mesh(stream, corners, notes)


def _count(stream: MeshStream, promised: int) -> tuple[int, tuple[str, ...]]:
    """How many triangles follow, by the size of the file, and what is odd about it."""
    size = stream.size - _START
    there, rest = divmod(size, _RECORD.itemsize)
    if promised == there:
        notes = (f"bytes behind the last triangle: {rest}",) if rest else ()
        return there, notes
    if promised in _UNKNOWN and not rest:
        return there, (f"its header counts {promised} triangles, {there} are there",)
    fault = (
        f"is damaged: its header promises {promised} triangles, "
        f"{promised * _RECORD.itemsize} bytes, but {size} bytes follow"
    )
    raise stream.invalid(fault)


def _text(stream: MeshStream) -> RawMesh:
    numbers: array[float] = array("d")
    in_loop, last = 0, ""
    for number, line in stream.lines():
        words = line.split()
        if not words:
            continue
        last = words[0].lower()
        if last == "outer":
            in_loop = len(numbers)
        elif last == "vertex":
            numbers.extend(stream.numbers(words[1:], 3, number))
            stream.check_room(len(numbers) // 3)
        elif last == "endloop" and len(numbers) - in_loop != 9:
            found = (len(numbers) - in_loop) // 3
            fault = f"the facet has {found} corners, expected 3"
            raise stream.invalid(fault, line=number)
    if last != "endsolid" or len(numbers) % 9:
        raise stream.invalid(fault="is truncated: it does not end in endsolid")
    stream.check_count(len(numbers) // 9)
    corners = np.array(numbers, dtype=np.float64).reshape(-1, 3, 3)
    return _mesh(stream, corners, ())


def _mesh(stream: MeshStream, corners: FloatArray, notes: tuple[str, ...]) -> RawMesh:
    stream.check_numbers(corners.reshape(-1, 9), "triangle")
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    return RawMesh(corners.reshape(-1, 3), triangles, notes=notes)
