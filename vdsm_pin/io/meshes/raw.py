"""What every format is read to, and what the readers of text share."""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.io.schema_types import LARGEST

MAX_TRIANGLES: Final = 5_000_000
MAX_CORNERS: Final = 3 * MAX_TRIANGLES
"""Most vertices of a file, used or not, and most corners of all its faces."""

MAX_MESH_LINE: Final = 1 << 20
"""Longest line of a mesh or cloud in text; [bytes], a character each in Latin-1."""

PADDING: Final = 1 << 16
"""Most bytes that fill a file up behind its data: the largest pages of memory."""

_BOM: Final = "\xef\xbb\xbf"  # of UTF-8, as Latin-1
_UTF_16: Final = ("\xff\xfe", "\xfe\xff")


def doubles(values: Any) -> FloatArray:
    """Numbers of any kind as doubles; a NaN that signals is a NaN, without a word."""
    with np.errstate(invalid="ignore"):
        return np.asarray(values, dtype=np.float64)


@dataclass(frozen=True)
class RawMesh:
    """Triangles as a file has them.

    Args:
        vertices: Shape (n, 3), in the unit of the file.
        triangles: Vertex indices, shape (m, 3), in the order of the file.
        unit: Metres per unit of the file; None where its format states none.
        bend: How far the least flat face of more than three corners is off its plane,
            in the unit of the file.
        notes: What else was found, one phrase each.
    """

    vertices: FloatArray
    triangles: IntArray
    unit: float | None = None
    bend: float = 0.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeshStream:
    """A mesh file that is being read.

    Args:
        path: The file, for messages.
        size: Of the whole file; [bytes].
        content: Its bytes, from the start.
    """

    path: Path
    size: int
    content: "io.BufferedReader[Any]"

    def invalid(self, fault: str, *, line: int = 0, where: str = "") -> InvalidFile:
        """The error that names the file, and the line where there is one."""
        where = f"line {line}" if line else where
        return InvalidFile(file=self.path, where=where, fault=fault)

    def lines(self) -> Iterator[tuple[int, str]]:
        """Numbered lines, whatever their ends; bytes beyond ASCII as Latin-1.

        Nothing but ASCII has a meaning in these formats, and names and remarks may be
        in any encoding.

        Raises:
            InvalidFile: If the text is UTF-16 or a line is endless.
        """
        text = io.TextIOWrapper(self.content, encoding="latin-1", newline=None)
        try:
            line = text.readline(MAX_MESH_LINE)
            if line.startswith(_UTF_16):
                raise self.invalid(fault="is UTF-16 text, expected UTF-8 or ASCII")
            number, line = 1, line.removeprefix(_BOM)
            while line:
                if len(line) == MAX_MESH_LINE and line[-1] != "\n":
                    fault = f"is longer than {MAX_MESH_LINE} characters"
                    raise self.invalid(fault, line=number)
                yield number, line
                number, line = number + 1, text.readline(MAX_MESH_LINE)
        finally:
            if not text.closed:
                text.detach()

    def numbers(self, words: list[str], count: int, line: int) -> list[float]:
        """So many words as numbers.

        Raises:
            InvalidFile: If there are fewer or more, or one is no decimal number.
        """
        try:
            values = list(map(float, words))
        except ValueError:
            values = []
        if len(values) != count or "_" in "".join(words):  # which Python passes over
            fault = f"found {' '.join(words)[:80]!r}, expected {count} numbers"
            raise self.invalid(fault, line=line)
        return values

    def check_end(self, left: bytes | object, announced: str) -> None:
        """Refuse what stands behind the last of what the header announces.

        Args:
            left: What was not read; nothing if all was. Zero bytes that fill a page, as
                PCL writes them, and white space are nothing.
            announced: What the header announces.

        Raises:
            InvalidFile: If there is anything.
        """
        if isinstance(left, bytes) and len(left) <= PADDING:
            left = left.strip(b"\0 \t\r\n")
        if left:
            fault = f"has more data than its header announces: {announced}"
            raise self.invalid(fault)

    def check_count(self, triangles: int) -> None:
        """Refuse more triangles than any mesh may have, before room is made for them.

        Raises:
            InvalidFile: If there are more.
        """
        if triangles > MAX_TRIANGLES:
            fault = f"has {triangles} triangles, the most is {MAX_TRIANGLES}"
            raise self.invalid(fault)

    def check_room(self, vertices: int, corners: int = 0) -> None:
        """Refuse more than there may be, while it is read.

        Raises:
            InvalidFile: If there are more vertices or corners.
        """
        if max(vertices, corners) > MAX_CORNERS:
            fault = f"has more than {MAX_CORNERS} vertices or corners of faces"
            raise self.invalid(fault)

    def check_numbers(
        self, rows: FloatArray, noun: str, *, used: IntArray | None = None
    ) -> None:
        """Refuse numbers that are not finite, or so large that they must be slips.

        Args:
            rows: Numbers of each thing, shape (n, k).
            noun: What a row is of.
            used: Numbers of the rows that matter; all of them where not given.

        Raises:
            InvalidFile: If a number is bad; names the thing, counted from 1.
        """
        bad = ~(np.abs(rows) <= LARGEST).all(axis=1)
        if used is not None:
            matters = np.zeros(len(rows), dtype=np.bool_)
            matters[used] = True
            bad &= matters
        if bad.any():
            fault = f"has a coordinate that is not a number up to {LARGEST:g}"
            where = f"{noun} {int(np.argmax(bad)) + 1}"
            raise self.invalid(fault, where=where)
