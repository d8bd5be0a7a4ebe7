"""The trajectory CSV: one row of joint values per waypoint, streamed both ways.

    waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,..,alphaN_rad,thetaN_rad

Numbers are the shortest decimals that read back as the same double. Every line ends in
a line end, so that a file cut short anywhere but between two lines is recognised.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
import pydantic_core

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.io.source import check_is_file
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import MAX_ROWS, Trajectory

CHUNK_ROWS: Final = 5_000
"""Rows held as text at one time."""

MAX_LINE: Final = 1 << 16
"""Longest line looked at; [bytes]. A row of 40 links has below 2,000."""

_FIXED: Final = ("waypoint", "on_path", "path_m", "x0_m")
PLAIN: Final = b"0123456789+-.eE, \r\n"
"""Bytes that rows of numbers are made of."""

_BOM: Final = b"\xef\xbb\xbf"


def column_names(n_links: int) -> tuple[str, ...]:
    """The header of a trajectory of an arm of N links."""
    pairs = ((f"alpha{i}_rad", f"theta{i}_rad") for i in range(1, n_links + 1))
    return _FIXED + tuple(name for pair in pairs for name in pair)


def write_trajectory(path: str | Path, trajectory: Trajectory) -> None:
    """Write a trajectory, whole or not at all.

    Args:
        path: The CSV file; an existing one is replaced.
        trajectory: What to write.

    Raises:
        InvalidFile: If the file cannot be written.
    """
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        stream.write(",".join(column_names(trajectory.n_links)).encode() + b"\n")
        for first in range(0, trajectory.n_samples, CHUNK_ROWS):
            stream.write(_rows_text(trajectory, first))


def _rows_text(trajectory: Trajectory, first: int) -> bytes:
    part = slice(first, first + CHUNK_ROWS)
    angles = np.stack([trajectory.alpha[part], trajectory.theta[part]], axis=2)
    columns = [trajectory.path_m[part], trajectory.x0[part], *_flat(angles).T]
    # As JSON: the same digits as repr at a quarter of the time.
    text = pydantic_core.to_json(np.column_stack(columns).tolist())
    rows = text[2:-2].split(b"],[")
    flags = trajectory.on_path[part].astype(int).tolist()
    return b"".join(
        b"%d,%d,%b\n" % (waypoint, flag, row)
        for waypoint, (flag, row) in enumerate(zip(flags, rows, strict=True), first)
    )


def _flat(angles: FloatArray) -> FloatArray:
    return angles.reshape(len(angles), -1)


def read_trajectory(path: str | Path, manipulator: Manipulator) -> Trajectory:
    """Read a trajectory of any origin.

    Args:
        path: The CSV file.
        manipulator: The arm that it is for; fixes the columns.

    Returns:
        The trajectory; numbers as in the file to the last bit.

    Raises:
        InvalidFile: If a column is wrong or missing, a row is cut short or has a word
            where a number is meant, a number is not finite, `waypoint` does not rise
            by whole numbers, or `on_path` is neither 0 nor 1. Names line and column.
    """
    file = Path(path)
    check_is_file(file)
    try:
        with file.open("rb") as stream:
            return _Reader(file, stream, column_names(manipulator.n_links)).read()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InvalidFile(file=path, problem=f"cannot be read: {reason}") from None


@dataclass(frozen=True)
class _Reader:
    file: Path
    stream: BinaryIO
    columns: tuple[str, ...]

    def read(self) -> Trajectory:
        count = self._count_rows()
        self._check_header(self.stream.readline(MAX_LINE))
        if count == 0:
            raise InvalidFile(file=self.file, problem="has no row")
        n_links = (len(self.columns) - len(_FIXED)) // 2
        on_path = np.zeros(count, dtype=np.bool_)
        path_m, x0 = np.zeros(count), np.zeros(count)
        alpha, theta = np.zeros((count, n_links)), np.zeros((count, n_links))
        first, previous = 0, -1.0
        for table in self._tables():
            part = slice(first, first + len(table))
            self._check_values(table, first, previous)
            on_path[part], path_m[part], x0[part] = table[:, 1:4].T
            alpha[part], theta[part] = table[:, 4::2], table[:, 5::2]
            first, previous = part.stop, float(table[-1, 0])
        return Trajectory(on_path, path_m, x0, alpha, theta)

    def _count_rows(self) -> int:
        """Number of rows, after a look at how the file ends."""
        count, last = 0, b""
        while block := self.stream.read(1 << 20):
            count += block.count(b"\n")
            last = block[-1:]
        self.stream.seek(0)
        if not last:
            raise InvalidFile(file=self.file, problem="is empty")
        if last != b"\n":
            problem = "does not end in a line end: the file is cut short"
            raise self._invalid(count + 1, problem)
        if count - 1 > MAX_ROWS:
            problem = f"has {count - 1} rows, the most is {MAX_ROWS}"
            raise InvalidFile(file=self.file, problem=problem)
        return count - 1

    def _check_header(self, line: bytes) -> None:
        found = line.removeprefix(_BOM).decode("utf-8", "replace").strip().split(",")
        for number, expected in enumerate(self.columns, 1):
            name = found[number - 1].strip() if number <= len(found) else ""
            if name != expected:
                shown = repr(name[:40]) if name else "missing"
                problem = f"column {number} is {shown}, expected {expected!r}"
                raise self._invalid(1, problem)
        if len(found) > len(self.columns):
            problem = (
                f"has {len(found)} columns, expected {len(self.columns)} "
                f"for an arm of {(len(self.columns) - len(_FIXED)) // 2} links"
            )
            raise self._invalid(1, problem)

    def _tables(self) -> Iterator[FloatArray]:
        """The rows as numbers, some thousand at a time."""
        number = 2
        lines = iter(lambda: self.stream.readline(MAX_LINE), b"")
        while chunk := list(islice(lines, CHUNK_ROWS)):
            yield self._parsed(chunk, number)
            number += len(chunk)

    def _parsed(self, chunk: list[bytes], number: int) -> FloatArray:
        """Fast for good rows; where that fails, row by row to say what is wrong."""
        table = _numbers(chunk, len(self.columns))
        if not np.isfinite(table).all():
            rows = [self._row(line, number + i) for i, line in enumerate(chunk)]
            table = np.array(rows)
        return table

    def _row(self, line: bytes, number: int) -> list[float]:
        words = line.decode("utf-8", "replace").strip().split(",")
        values = []
        for name, word in zip(self.columns, words, strict=False):
            try:
                value = float(_plain_number(word))
            except ValueError:
                problem = f"{name} is {word[:40]!r}, expected a number"
                raise self._invalid(number, problem) from None
            if not np.isfinite(value):
                problem = f"{name} is {word.strip()}, expected a finite number"
                raise self._invalid(number, problem)
            values.append(value)
        if len(words) != len(self.columns):
            problem = f"has {len(words)} values, expected {len(self.columns)}"
            raise self._invalid(number, problem)
        return values

    def _check_values(self, table: FloatArray, first: int, previous: float) -> None:
        waypoint, on_path, path_m = table[:, 0], table[:, 1], table[:, 2]
        rises = np.diff(waypoint, prepend=previous) > 0.0
        self._check(
            rises & (waypoint == np.floor(waypoint)),
            first,
            waypoint,
            "waypoint",
            "a whole number above that of the row before",
        )
        self._check(
            (on_path == 0.0) | (on_path == 1.0), first, on_path, "on_path", "0 or 1"
        )
        most = TOLERANCES.path_extent
        good = (path_m >= 0.0) & (path_m <= most)
        self._check(good, first, path_m, "path_m", f"0 to {most:g} m")

    def _check(
        self, good: BoolArray, first: int, values: FloatArray, name: str, expected: str
    ) -> None:
        if not good.all():
            row = int(np.argmin(good))
            problem = f"{name} is {values[row]:g}, expected {expected}"
            raise self._invalid(first + row + 2, problem)

    def _invalid(self, line: int, problem: str) -> InvalidFile:
        return InvalidFile(file=self.file, where=f"line {line}", problem=problem)


def _numbers(lines: list[bytes], n_columns: int) -> FloatArray:
    """Rows of plain numbers as a table; of infinities where they are anything else.

    Numbers in JSON's notation only, which is that of nearly every program's CSV: its
    reader is twice as fast as numpy's, and as exact.
    """
    table = np.full((len(lines), n_columns), np.inf)
    text = b",".join(lines)
    commas = n_columns - 1
    if text.translate(None, PLAIN) or any(x.count(b",") != commas for x in lines):
        return table
    with suppress(ValueError, OverflowError):
        numbers = pydantic_core.from_json(b"[%b]" % text)
        table = np.array(numbers, dtype=np.float64).reshape(table.shape)
    return table


def _plain_number(word: str) -> str:
    """The word, unless Python alone would take it for a number: 1_000 and the like.

    Raises:
        ValueError: If it has a sign that no decimal number has.
    """
    if "_" in word or not word.isascii():
        raise ValueError(word)
    return word
