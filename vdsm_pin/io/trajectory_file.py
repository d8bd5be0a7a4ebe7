"""The trajectory CSV: one row of joint values per waypoint, streamed both ways.

    waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,..,alphaN_rad,thetaN_rad

Numbers are the shortest decimals that read back as the same double. Every line that is
written ends in a line end; a last one that lacks it, as some programs write it, is read
and named in a note.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TextIO

import numpy as np
import pydantic_core

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.io.source import check_is_file
from vdsm_pin.io.tables import CHUNK_ROWS, Table, listed, open_text
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import MAX_ROWS, Trajectory

_FIXED: Final = ("waypoint", "on_path", "path_m", "x0_m")
_JOINT: Final = re.compile(r"(alpha|theta)[0-9]+_rad")


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
        The trajectory; numbers as in the file to the last bit. Its notes name the
        columns that were not read, and a last row without line end.

    Raises:
        InvalidFile: If a column is missing, a row is cut short or has a word where a
            number is meant, a number is not finite, `waypoint` does not rise by whole
            numbers, `on_path` is neither 0 nor 1, or an angle or a length is so large
            that its unit must be wrong. Names line and column.
    """
    file = Path(path)
    check_is_file(file)
    try:
        with open_text(file) as text:
            return _read(file, text, manipulator)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InvalidFile(file=path, problem=f"cannot be read: {reason}") from None


def _read(file: Path, text: TextIO, arm: Manipulator) -> Trajectory:
    columns = column_names(arm.n_links)
    table = Table(file, text, columns)
    _check_arm(file, table.ignored, arm)
    tables: list[FloatArray] = []
    count, previous = 0, -1.0
    for rows in table.rows():
        _check_values(_Rows(file, columns, rows, count), previous)
        count, previous = count + len(rows), float(rows[-1, 0])
        if count > MAX_ROWS:
            raise InvalidFile(file=file, problem=f"has more than {MAX_ROWS} rows")
        tables.append(rows)
    if not tables:
        raise InvalidFile(file=file, problem="has no row")
    notes = [f"columns that are not read: {listed(table.ignored)}"]
    notes = notes if table.ignored else []
    if table.open_ended:
        notes.append("the last row has no line end; its last number is read as it is")
    return Trajectory(
        np.concatenate([rows[:, 1] != 0.0 for rows in tables]),
        np.concatenate([rows[:, 2] for rows in tables]),
        np.concatenate([rows[:, 3] for rows in tables]),
        np.concatenate([rows[:, 4::2] for rows in tables]),
        np.concatenate([rows[:, 5::2] for rows in tables]),
        tuple(notes),
    )


def _check_arm(file: Path, ignored: Sequence[str], arm: Manipulator) -> None:
    """Columns of joints that the arm has not are not to be left out."""
    for name in ignored:
        if _JOINT.fullmatch(name):
            problem = f"has the column {name!r}, but the arm has {arm.n_links} links"
            raise InvalidFile(file=file, where="line 1", problem=problem)


@dataclass(frozen=True)
class _Rows:
    """Some rows and where they stand in the file."""

    file: Path
    columns: tuple[str, ...]
    table: FloatArray
    first: int

    def check(self, good: BoolArray, column: int, expected: str) -> None:
        """Refuse the first row whose value in a column is not good."""
        if not good.all():
            row = int(np.argmin(good))
            value = f"{self.columns[column]} is {self.table[row, column]:g}"
            where = f"line {self.first + row + 2}"
            problem = f"{value}, expected {expected}"
            raise InvalidFile(file=self.file, where=where, problem=problem)


def _check_values(rows: _Rows, previous: float) -> None:
    waypoint, on_path, path_m, x0 = rows.table[:, :4].T
    rises = np.diff(waypoint, prepend=previous) > 0.0
    whole = "a whole number above that of the row before"
    rows.check(rises & (waypoint == np.floor(waypoint)), 0, whole)
    rows.check((on_path == 0.0) | (on_path == 1.0), 1, "0 or 1")
    most = TOLERANCES.path_extent
    rows.check((path_m >= 0.0) & (path_m <= most), 2, f"0 to {most:g} m")
    reach = TOLERANCES.scene_extent
    metres = f"metres, at most {reach:g} either way; is it in millimetres?"
    rows.check(np.abs(x0) <= reach, 3, metres)
    radians = "radians, at most pi either way; is it in degrees?"
    for column in range(len(_FIXED), len(rows.columns)):
        rows.check(np.abs(rows.table[:, column]) <= np.pi, column, radians)
