"""Columns of numbers from the CSV of any program, some thousand rows at a time.

Values stand between commas, semicolons or tabs, quoted or not, with a decimal point or
a decimal comma; the text is UTF-8 or UTF-16, with a byte order mark or without, and its
lines end in any way. Columns are found by name; what is not asked for is not read.
"""

import csv
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, Final, TextIO

import numpy as np
import pydantic_core

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.trajectory import MAX_ROWS
from vdsm_pin.text import listed

CHUNK_ROWS: Final = 5_000
"""Rows held as text at one time."""

MAX_ROW_LINE: Final = 1 << 16
"""Longest line looked at; [characters]. A row of 40 links has below 2,000."""

PLAIN: Final = b"0123456789+-.eE, \r\n"
"""Bytes that rows of numbers are made of."""

BETWEEN: Final = (",", ";", "\t")
_NUMBER: Final = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*", re.ASCII)
_CUT: Final = re.compile(r"\d\.?[eE][-+]?\d\Z", re.ASCII)
"""A last number with one digit of an exponent, which most programs write with two."""

_BLANK: Final = ' \t\n;,"'


@dataclass(frozen=True)
class Row:
    """Where a row or header stands, for messages."""

    file: Path
    line: int
    ended: bool = True

    def invalid(self, fault: str) -> InvalidFile:
        """The error that names file and line."""
        where = f"line {self.line}"
        if not self.ended:
            fault += "; the line has no end: is the file cut short?"
        return InvalidFile(file=self.file, where=where, fault=fault)


class Table:
    """A CSV file of numbers that is being read.

    Args:
        file: The file, for messages.
        text: Its text, from the start.
        known: Whether the name of a column has a meaning; tells what is between them.

    Attributes:
        file: The file.
        names: Of all columns, in its order.
        columns: Names of the columns read.
        ignored: Names of the other columns.
        open_ended: Whether the last line that was read has no line end.

    Raises:
        InvalidFile: If the file is empty, or its header has no end.
    """

    def __init__(self, file: Path, text: TextIO, known: Callable[[str], Any]) -> None:
        self.file, self._text = file, text
        self.open_ended = False
        self._decimal = ""  # the sign of the first number that has one
        line = text.readline(MAX_ROW_LINE)
        if not line:
            raise InvalidFile(file=file, fault="is empty")
        self._check_ends([line], 1)
        self._between, self.names = max(
            ((sign, split(line, sign)) for sign in BETWEEN),
            key=lambda found: len(set(filter(known, found[1]))),
        )
        self._width = len(self.names)

    def choose(self, columns: Sequence[str], optional: Sequence[str] = ()) -> None:
        """Say which columns are read: those that must be there, then others.

        Args:
            columns: Names of the columns that are wanted.
            optional: Of those that are wanted where they are there.

        Raises:
            InvalidFile: If a column is missing or there twice.
        """
        names, head = self.names, Row(self.file, 1, not self.open_ended)
        self.columns = (*columns, *(name for name in optional if name in names))
        self.ignored = tuple(name for name in names if name not in self.columns)
        for name in self.columns:
            if names.count(name) > 1:
                fault = f"has the column {name!r} {names.count(name)} times"
                raise head.invalid(fault)
            if name not in names:
                fault = f"has no column {name!r}{self._instead(name)}"
                raise head.invalid(fault)
        self._places = [names.index(name) for name in self.columns]

    def _instead(self, name: str) -> str:
        """What stands there that may be meant."""
        stem, _, unit = name.rpartition("_")
        near = [
            other
            for other in self.ignored
            if stem and (other == stem or other.startswith(f"{stem}_"))
        ]
        if near:
            return f", but {near[0][:40]!r}; expected in {unit}"
        return f"; found {listed(self.ignored)}" if self.ignored else ""

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the file was left out, once all is read; one phrase each."""
        notes = []
        if self.ignored:
            notes.append(f"columns that are not read: {listed(self.ignored)}")
        if self.open_ended:
            end = "the last row has no line end; its last number is read as it is"
            notes.append(end)
        return tuple(notes)

    def all_rows(self) -> FloatArray:
        """The wanted columns, shape (n, n_columns), n >= 1.

        Raises:
            InvalidFile: As `rows`, or if there is no row, or too many.
        """
        parts: list[FloatArray] = []
        for part in self.rows():
            parts.append(part)
            if sum(map(len, parts)) > MAX_ROWS:
                fault = f"has more than {MAX_ROWS} rows"
                raise InvalidFile(file=self.file, fault=fault)
        if not parts:
            raise InvalidFile(file=self.file, fault="has no row")
        return np.concatenate(parts)

    def rows(self) -> Iterator[FloatArray]:
        """The wanted columns of all rows, shape (k, n_columns), in order.

        Raises:
            InvalidFile: If a row is cut short, or has no finite number where one is
                wanted; names line and column.
        """
        lines_left = iter(partial(self._text.readline, MAX_ROW_LINE), "")
        number, blank = 2, 0
        while lines := list(islice(lines_left, CHUNK_ROWS)):
            self._check_ends(lines, number)
            table = self._fast(lines)
            if blank or not np.isfinite(table).all():
                blank = self._blank(lines, number, blank)
                rows = lines[: max(blank - number, 0)] if blank else lines
                table = np.array(
                    [self._row(row, number + i) for i, row in enumerate(rows)]
                )
            if len(table):
                yield table
            number += len(lines)

    def _check_ends(self, lines: list[str], number: int) -> None:
        for i, line in enumerate(lines):
            if line[-1] != "\n":
                if len(line) == MAX_ROW_LINE:
                    fault = f"is longer than {MAX_ROW_LINE} characters"
                    raise Row(self.file, number + i).invalid(fault)
                if _CUT.search(line):
                    fault = f"ends in {line[-8:]!r}, whose exponent may be cut short"
                    raise Row(self.file, number + i, ended=False).invalid(fault)
                self.open_ended = True

    def _blank(self, lines: list[str], number: int, before: int) -> int:
        """Number of the first blank line, or 0; no row may follow one."""
        blank = before
        for i, line in enumerate(lines):
            if not line.strip(_BLANK):
                blank = blank or number + i
            elif blank:
                fault = "is blank, and rows follow; expected none in between"
                raise Row(self.file, blank).invalid(fault)
        return blank

    def _fast(self, lines: list[str]) -> FloatArray:
        """Rows of plain numbers as a table; of infinities where they are anything else.

        Numbers in JSON's notation only, which is that of nearly every program's CSV:
        its reader is twice as fast as numpy's, and as exact.
        """
        table = np.full((len(lines), self._width), np.inf)
        if {line.count(self._between) for line in lines} != {self._width - 1}:
            return table
        text = self._between.join(lines)
        if self._between != "," and "," in text:
            if "." in text or self._decimal == ".":
                return table
            self._decimal, text = ",", text.replace(",", ".")
        elif "." in text:
            if self._decimal == ",":
                return table
            self._decimal = "."
        plain = text.replace(self._between, ",").encode("utf-8", "replace")
        if not plain.translate(None, PLAIN):
            with suppress(ValueError, OverflowError):
                numbers = pydantic_core.from_json(b"[%b]" % plain)
                table = np.array(numbers, dtype=np.float64).reshape(table.shape)
        return np.asarray(table[:, self._places])

    def _row(self, line: str, number: int) -> list[float]:
        row = Row(self.file, number, line.endswith("\n"))
        words = split(line, self._between)
        values = []
        for name, place in zip(self.columns, self._places, strict=True):
            if place < len(words):
                values.append(self._number(words[place], name, row))
        if len(words) != self._width:
            fault = f"has {len(words)} values, expected {self._width}"
            if self._between == "," and len(words) > self._width:
                fault += "; decimal commas need semicolons between the values"
            raise row.invalid(fault)
        return values

    def _number(self, word: str, name: str, row: Row) -> float:
        plain = word.replace(",", ".")
        for sign in ",.":
            if sign in word and (self._decimal or sign) != sign:
                fault = (
                    f"{name} is {word[:40]!r}, but numbers before it have a decimal "
                    f"{self._decimal!r}"
                )
                raise row.invalid(fault)
            if sign in word:
                self._decimal = sign
        if not _NUMBER.fullmatch(plain):
            if plain.strip().lower().lstrip("+-") in ("nan", "inf", "infinity"):
                fault = f"{name} is {word.strip()}, expected a finite number"
            else:
                fault = f"{name} is {word[:40]!r}, expected a number"
            raise row.invalid(fault)
        value = float(plain)
        if not math.isfinite(value):
            fault = f"{name} is {word.strip()[:40]}, expected a finite number"
            raise row.invalid(fault)
        return value


def quoted(text: str) -> str:
    """A CSV field that may hold a comma or a quote."""
    if any(sign in text for sign in ',"\n'):
        return '"' + text.replace('"', '""') + '"'
    return text


def split(line: str, between: str) -> list[str]:
    """The values of a line, without quotes and without blanks around them."""
    blanks = " " if between == "\t" else r"[ \t]"
    plain = re.sub(rf'"{blanks}+(?={between}|$)', '"', line.strip("\n"))
    try:
        (words,) = csv.reader(
            [plain], delimiter=between, skipinitialspace=True, strict=True
        )
    except (csv.Error, ValueError):
        words = line.split(between)
    return [word.strip() for word in words]


def open_text(file: Path) -> TextIO:
    """A file as text, whatever it is encoded in and however its lines end.

    Raises:
        OSError: If it cannot be opened.
    """
    return as_text(file.open("rb"))


def as_text(stream: BinaryIO) -> TextIO:
    """A stream of bytes from its start as text, whatever it is encoded in."""
    encoding = _encoding(stream.read(4))
    stream.seek(0)
    return TextIOWrapper(stream, encoding=encoding, errors="replace")


def _encoding(head: bytes) -> str:
    """UTF-16 by its mark or by the zeros between the letters, else UTF-8."""
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if len(head) == 4 and head[1] == head[3] == 0 != head[0]:
        return "utf-16-le"
    if len(head) == 4 and head[0] == head[2] == 0 != head[1]:
        return "utf-16-be"
    return "utf-8-sig"
