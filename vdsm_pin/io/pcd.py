"""PCD, the format of the Point Cloud Library: text, binary, binary and compressed."""

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.meshes.raw import MAX_MESH_LINE, MeshStream, doubles

_KINDS: Final = {"F": "f", "I": "i", "U": "u"}
_SIZES: Final = (1, 2, 4, 8)
_MOST_LINES: Final = 100
_RECORD: Final = 1 << 20
"""Most bytes of one point."""

_FRAME: Final = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""The VIEWPOINT of points that are as they stand: no shift, no turn (w x y z)."""


@dataclass(frozen=True)
class _Header:
    """What stands before the data: a record's type, and how many follow."""

    kind: np.dtype[np.void]
    points: int
    data: str
    lines: int


def read_pcd(stream: MeshStream) -> FloatArray:
    """The points of a PCD file, shape (n, 3), NaN where nothing was measured.

    Raises:
        InvalidFile: If the header is no PCD's, or the file is damaged.
    """
    header = _header(stream)
    data = stream.content.read()
    match header.data:
        case "ascii":
            return _text(stream, header, data)
        case "binary_compressed":
            return _columns(stream, header, _unpacked(stream, header, data))
        case _:
            size = header.points * header.kind.itemsize
            _check_size(stream, header, data, size)
            table = np.frombuffer(data[:size], header.kind)
            return np.column_stack([_first(table[axis]) for axis in "xyz"])


def _first(column: FloatArray) -> FloatArray:
    """A field's first value, where it has several."""
    return doubles(column.reshape(len(column), -1)[:, 0])


def _header(stream: MeshStream) -> _Header:
    said: dict[str, list[str]] = {}
    for number in range(1, _MOST_LINES + 1):
        words = stream.content.readline(MAX_MESH_LINE).decode("latin-1").split()
        if not words or words[0].startswith("#"):
            continue
        said[words[0]] = words[1:]
        if words[0] == "DATA":
            return _understood(stream, said, number)
    raise stream.invalid(fault="is no PCD file: no line DATA in its header")


def _understood(stream: MeshStream, said: dict[str, list[str]], lines: int) -> _Header:
    names = said.get("FIELDS", [])
    sizes, kinds = said.get("SIZE", []), said.get("TYPE", [])
    counts = said.get("COUNT", ["1"] * len(names))
    form = " ".join(said["DATA"])
    keys = ("WIDTH", "HEIGHT"), ("POINTS",)
    totals = [[said[key] for key in part if key in said] for part in keys]
    totals = [total for total in totals if total]
    numbers = [word for total in totals for words in total for word in words]
    numbers += [*sizes, *counts]
    good = (
        len(names) == len(sizes) == len(kinds) == len(counts)
        and totals
        and all(len(words) == 1 for total in totals for words in total)
        and all(word.isdecimal() and len(word) < 12 for word in numbers)
        and {int(size) for size in sizes} <= set(_SIZES)
        and 0 < min(map(int, counts), default=0)
        and sum(int(c) * int(s) for c, s in zip(counts, sizes, strict=True)) <= _RECORD
        and set(kinds) <= set(_KINDS)
        and all(
            (kind, int(size)) not in (("F", 1), ("F", 2))
            for kind, size in zip(kinds, sizes, strict=True)
        )
        and form in ("ascii", "binary", "binary_compressed")
    )
    if not good or any(names.count(axis) != 1 for axis in "xyz"):
        fault = "has a header that is no PCD's: expected FIELDS with x y z, SIZE, "
        fault += "TYPE, COUNT from 1, POINTS, DATA ascii, binary or binary_compressed"
        raise stream.invalid(fault)
    points, *others = (math.prod(int(w[0]) for w in total) for total in totals)
    if others and others[0] != points:
        fault = f"has WIDTH x HEIGHT = {points}, but POINTS {others[0]}"
        raise stream.invalid(fault)
    seen_from = stream.numbers(said.get("VIEWPOINT", list(map(str, _FRAME))), 7, lines)
    if (*seen_from,) != _FRAME:
        fault = f"has the VIEWPOINT {' '.join(said['VIEWPOINT'])}, which may place its "
        fault += "points or not; expected points that it does not, and 0 0 0 1 0 0 0"
        raise stream.invalid(fault)
    stream.check_room(points)
    if not points:
        raise stream.invalid(fault="has no point")
    fields = [
        (f"{name}" if name in "xyz" else f"{name} {k}", f"<{_KINDS[t]}{s}", (int(c),))
        for k, (name, t, s, c) in enumerate(
            zip(names, kinds, sizes, counts, strict=True)
        )
    ]
    return _Header(np.dtype(fields), points, form, lines)


def _text(stream: MeshStream, header: _Header, data: bytes) -> FloatArray:
    """One line a point, as many values as the fields have."""
    names = header.kind.names or ()
    starts = np.cumsum([0, *(int(np.prod(header.kind[name].shape)) for name in names)])
    place = [int(starts[names.index(axis)]) for axis in "xyz"]
    lines = data.decode("latin-1").rstrip().splitlines()
    _check_size(stream, header, lines, header.points)
    with suppress(ValueError):  # told line by line below
        table = np.loadtxt(lines, ndmin=2, comments=None)
        if table.shape == (header.points, starts[-1]):
            return table[:, place]
    rows = []
    for number, line in enumerate(lines, header.lines + 1):
        words = line.split()
        if len(words) != starts[-1]:
            fault = f"has {len(words)} values, expected {starts[-1]}"
            raise stream.invalid(fault, line=number)
        rows.append(stream.numbers([words[k] for k in place], 3, number))
    return np.array(rows).reshape(-1, 3)


def _columns(stream: MeshStream, header: _Header, data: bytes) -> FloatArray:
    """Fields one after the other, each with all its values."""
    found, start = {}, 0
    for name in header.kind.names or ():
        kind = header.kind[name]
        size = header.points * kind.itemsize
        column = np.frombuffer(data[start : start + size], kind.base)
        found[name] = column.reshape(header.points, -1)
        start += size
    return np.column_stack([_first(found[axis]) for axis in "xyz"])


def _unpacked(stream: MeshStream, header: _Header, data: bytes) -> bytes:
    """What LZF packed, of the size that the header promises."""
    packed, size = np.frombuffer(data[:8].ljust(8, b"\0"), "<u4").tolist()
    wanted = header.points * header.kind.itemsize
    _check_size(stream, header, data, 8 + packed)
    found = _from_lzf(data[8 : 8 + packed], wanted)
    if not len(found) == size == wanted:
        raise stream.invalid(fault="has compressed data that is damaged")
    return found


def _from_lzf(data: bytes, size: int) -> bytes:
    """LZF: runs of bytes as they are, and copies of what came before.

    Returns:
        What was packed; another length than `size` where the data is damaged.
    """
    out, at, end = bytearray(), 0, len(data)
    while at < end and len(out) < size:
        head = data[at]
        at += 1
        if head < 32:
            out += data[at : at + head + 1]
            at += head + 1
            continue
        if at + (head >= 224) >= end:
            return b""
        length = head >> 5
        if length == 7:
            length += data[at]
            at += 1
        back = ((head & 31) << 8 | data[at]) + 1
        at += 1
        start, length = len(out) - back, length + 2
        if start < 0:
            return b""
        part = bytes(out[start : start + length])
        out += (part * (length // back + 1))[:length] if back < length else part
    return bytes(out) if at == end else b""


def _check_size(
    stream: MeshStream, header: _Header, data: bytes | list[str], wanted: int
) -> None:
    """Refuse bytes or lines that are fewer than the header announces, or more."""
    if len(data) < wanted:
        fault = f"is cut short: its header promises {header.points} points"
        raise stream.invalid(fault)
    stream.check_end(data[wanted:], f"{header.points} points")
