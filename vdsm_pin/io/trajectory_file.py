"""The trajectory CSV: one row of joint values per waypoint, streamed both ways.

    waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,..,alphaN_rad,thetaN_rad

Besides there may be `time_s` and, for each joint, `x0_velocity_m_s`,
`alpha1_velocity_rad_s`, .., `x0_acceleration_m_s2`, `alpha1_acceleration_rad_s2`, ..

Numbers are the shortest decimals that read back as the same double. Every line that is
written ends in a line end; a last one that lacks it, as some programs write it, is read
and named in a note.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, TextIO, TypeAlias

import numpy as np
import pydantic_core

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.io.source import check_is_file, readable
from vdsm_pin.io.tables import CHUNK_ROWS, Table, open_text
from vdsm_pin.problem.trajectory import Trajectory, joint_names
from vdsm_pin.tolerances import TOLERANCES

WAYPOINT: Final = "waypoint"
PLACE: Final = ("on_path", "path_m")
"""Whether the tip draws the path at a waypoint, and where along it."""

LENGTH: Final = (
    f"metres, at most {TOLERANCES.scene_extent:g} either way; is it in millimetres?"
)
"""What a length shall be."""


@dataclass(frozen=True)
class Waypoints:
    """The rows of a file by the names of their columns.

    Args:
        file: The file, for messages.
        columns: Names of the columns.
        rows: Shape (n, n_columns).
    """

    file: Path
    columns: Sequence[str]
    rows: FloatArray

    def __getitem__(self, name: str) -> FloatArray:
        """The values of a column, shape (n,)."""
        return np.asarray(self.rows[:, self.columns.index(name)])

    def check(self, name: str, good: BoolArray, expected: str) -> None:
        """Refuse the first row whose value in a column is not good."""
        if not good.all():
            row = int(np.argmin(good))
            fault = f"{name} is {self[name][row]:g}, expected {expected}"
            where = f"line {row + 2}"
            raise InvalidFile(file=self.file, where=where, fault=fault)


def read_waypoints(table: Table) -> Waypoints:
    """All rows of a table.

    Raises:
        InvalidFile: If there is none or too many, `waypoint` does not rise by whole
            numbers, or `on_path` or `path_m`, where there, are no such values.
    """
    found = Waypoints(table.file, table.columns, table.all_rows())
    number = found[WAYPOINT]
    good = (np.diff(number, prepend=-1.0) > 0.0) & (number == np.floor(number))
    found.check(WAYPOINT, good, "a whole number above that of the row before")
    if set(PLACE) <= set(found.columns):
        on_path, path_m = (found[name] for name in PLACE)
        found.check(PLACE[0], (on_path == 0.0) | (on_path == 1.0), "0 or 1")
        most = TOLERANCES.path_extent
        found.check(PLACE[1], (path_m >= 0.0) & (path_m <= most), f"0 to {most:g} m")
    return found


Interpolation: TypeAlias = Literal["auto", "linear", "cubic", "quintic"]
"""What joins the rows: straight lines; cubic pieces, by their velocities; quintic ones,
by their accelerations too; or whichever the file has columns for."""


def orders(interpolation: Interpolation) -> int:
    """How many derivatives are read at most: velocities, accelerations."""
    return {"linear": 0, "cubic": 1}.get(interpolation, 2)


TIME: Final = "time_s"
X0: Final = "x0_m"
_JOINT: Final = re.compile(r"(alpha|theta)[0-9]+_rad")


def column_names(n_links: int) -> tuple[str, ...]:
    """The header of a trajectory of an arm of N links."""
    angles = (f"{name}_rad" for name in joint_names(n_links)[1:])
    return (WAYPOINT, *PLACE, X0, *angles)


def rate_names(n_links: int, order: int) -> tuple[str, ...]:
    """Names of the velocities (order 1) or accelerations (2) of all joints."""
    what, power = ("velocity", "s") if order == 1 else ("acceleration", "s2")
    x0, *angles = joint_names(n_links)
    return (f"{x0}_{what}_m_{power}", *(f"{a}_{what}_rad_{power}" for a in angles))


def write_trajectory(trajectory: Trajectory, path: str | Path) -> None:
    """Write a trajectory, whole or not at all.

    Args:
        trajectory: What to write.
        path: The CSV file; an existing one is replaced.

    Raises:
        CannotWrite: If the file cannot be written.
    """
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        names = column_names(trajectory.n_links) + _further_names(trajectory)
        stream.write(",".join(names).encode() + b"\n")
        for first in range(0, trajectory.n_samples, CHUNK_ROWS):
            stream.write(_rows_text(trajectory, first))


def _further_names(trajectory: Trajectory) -> tuple[str, ...]:
    """Columns beyond those that every trajectory has."""
    names: tuple[str, ...] = () if trajectory.times is None else (TIME,)
    for order, values in enumerate((trajectory.rates, trajectory.changes), start=1):
        names += () if values is None else rate_names(trajectory.n_links, order)
    return names


def _rows_text(trajectory: Trajectory, first: int) -> bytes:
    part = slice(first, first + CHUNK_ROWS)
    columns = [trajectory.path_m[part], *trajectory.joints[part].T]
    for values in (trajectory.times, trajectory.rates, trajectory.changes):
        columns += [] if values is None else list(np.atleast_2d(values[part].T))
    # As JSON: the same digits as repr at a quarter of the time.
    text = pydantic_core.to_json(np.column_stack(columns).tolist())
    rows = text[2:-2].split(b"],[")
    flags = trajectory.on_path[part].astype(int).tolist()
    return b"".join(
        b"%d,%d,%b\n" % (waypoint, flag, row)
        for waypoint, (flag, row) in enumerate(zip(flags, rows, strict=True), first)
    )


def read_trajectory(
    path: str | Path,
    manipulator: Manipulator,
    interpolation: Interpolation = "auto",
    places: bool = True,
) -> Trajectory:
    """Read a trajectory of any origin.

    Args:
        path: The CSV file.
        manipulator: The arm that it is for; fixes the columns.
        interpolation: What joins the rows.
        places: Whether the rows must say where on a desired path they are.

    Returns:
        The trajectory; numbers as in the file to the last bit. Its notes name the
        columns that were not read, and a last row without line end.

    Raises:
        InvalidFile: If a column is missing, a row is cut short or has a word where a
            number is meant, a number is not finite, `waypoint` does not rise by whole
            numbers, nor `time_s`, `on_path` is neither 0 nor 1, or an angle or a length
            is so large that its unit must be wrong. Names line and column.
    """
    file = Path(path)
    check_is_file(file)
    with readable(file), open_text(file) as text:
        how = interpolation, places
        return read_trajectory_text(file, text, manipulator, *how)


def read_trajectory_text(
    file: Path,
    text: TextIO,
    arm: Manipulator,
    interpolation: Interpolation = "auto",
    places: bool = True,
) -> Trajectory:
    """Read the text of a trajectory, as `read_trajectory` does."""
    columns = column_names(arm.n_links)
    needed = [name for name in columns if places or name not in PLACE]
    rates, changes = (rate_names(arm.n_links, order) for order in (1, 2))
    more = {"linear": (), "cubic": rates}.get(interpolation, (*rates, *changes))
    table = Table(file, text, {*columns}.__contains__)
    table.choose(needed, (*(() if places else PLACE), TIME, *more))
    _check_arm(file, table.ignored, arm)
    found = table.columns
    smooth = _smooth_columns(file, found, (rates, changes), interpolation)
    rows = read_waypoints(table)
    _check_values(rows)
    whole, told = rows.rows, set(PLACE) <= set(found)
    first = [found.index(names[0]) for names in ((X0,), *smooth)]
    joints, *pieces = (whole[:, k : k + 1 + 2 * arm.n_links] for k in first)
    further = [*pieces, None, None]
    return Trajectory.of_joints(
        joints,
        rows[PLACE[0]] != 0.0 if told else None,
        rows[PLACE[1]] if told else None,
        rows[TIME] if TIME in found else None,
        further[0],
        further[1],
        table.notes,
    )


def _smooth_columns(
    file: Path,
    found: Sequence[str],
    wanted: tuple[tuple[str, ...], tuple[str, ...]],
    interpolation: Interpolation,
) -> list[tuple[str, ...]]:
    """Names of the velocities and accelerations that are read, as far as they are.

    Args:
        file: The file.
        found: Columns that it has.
        wanted: Names of velocities and of accelerations.
        interpolation: What joins the rows.
    """
    most = orders(interpolation)
    read = [names for names in wanted[:most] if set(names) & set(found)]
    if interpolation != "auto":
        read = list(wanted[:most])
    needed = list(wanted[: 1 + (wanted[1] in read)]) if read else []
    names = [name for group in needed for name in group]
    missing = [
        name for name in (*names, *([TIME] if read else [])) if name not in found
    ]
    if not missing:
        return needed
    fault = f"has no column {missing[0]!r}, which smooth pieces between the rows need"
    if interpolation == "auto":
        fault += f" beside {next(n for n in names if n in found)!r}"
    fault += "; --interpolation linear judges straight lines"
    raise InvalidFile(file=file, where="line 1", fault=fault)


def _check_arm(file: Path, ignored: Sequence[str], arm: Manipulator) -> None:
    """Columns of joints that the arm has not are not to be left out."""
    for name in ignored:
        if _JOINT.fullmatch(name):
            fault = f"has the column {name!r}, but the arm has {arm.n_links} links"
            raise InvalidFile(file=file, where="line 1", fault=fault)


def _check_values(rows: Waypoints) -> None:
    rows.check(X0, np.abs(rows[X0]) <= TOLERANCES.scene_extent, LENGTH)
    radians = "radians, at most pi either way; is it in degrees?"
    for name in filter(_JOINT.fullmatch, rows.columns):
        rows.check(name, np.abs(rows[name]) <= np.pi, radians)
    if TIME in rows.columns:
        rises = np.diff(rows[TIME], prepend=-np.inf) > 0.0
        rows.check(TIME, rises, "a time above that of the row before")
