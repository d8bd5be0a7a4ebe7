"""Trajectories of robots: CSV with named columns, JointTrajectory as YAML or JSON."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import check_is_file, read_text
from vdsm_pin.io.tables import Table, open_text
from vdsm_pin.io.yaml_reader import YamlDocument, read_yaml
from vdsm_pin.problem.trajectory import MAX_ROWS
from vdsm_pin.proof.paths import Path, cubic_path, quintic_path
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.units import MM_PER_M

MAX_BYTES: Final = 256 << 20
UNITS: Final = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0, "mm": 1.0 / MM_PER_M}
MOST_TURNS: Final = 4.0 * np.pi
"""An angle beyond this must be in degrees; [rad]."""

_COLUMN: Final = re.compile(r"(.+)_(rad|deg|mm|m)")
_TEXT: Final = (".yaml", ".yml", ".json")


@dataclass(frozen=True)
class _Rows:
    """Rows of the robot's columns, and what the file has besides.

    Args:
        q: Shape (n_rows, n_columns); [rad], [m].
        times: Shape (n_rows,); [s]. None where not stated.
        rates: As q; per [s]. None where not stated.
        changes: As q; per [s^2]. None where not stated.
    """

    q: FloatArray
    times: FloatArray | None = None
    rates: FloatArray | None = None
    changes: FloatArray | None = None


def read_path(file: File, robot: Robot) -> Path:
    """A trajectory as the controller runs it.

    Straight lines between waypoints; cubic pieces where velocities are stated too, and
    quintic ones with accelerations.

    Args:
        file: CSV with a column for each joint, `NAME_rad`, `NAME_deg`, `NAME_m` or
            `NAME_mm`; or a JointTrajectory or RobotTrajectory as YAML or JSON.
        robot: Whose joints they are.

    Raises:
        InvalidFile: If a joint is missing or unknown, or a value is no number or in
            another unit than stated.
    """
    check_is_file(file)
    if file.suffix.lower() in _TEXT:
        rows = _read_message(file, robot)
    else:
        rows = _read_csv(file, robot)
    _check_units(file, rows.q, robot.joints)
    try:
        if rows.times is None or rows.rates is None:
            return Path(rows.q)
        if rows.changes is None:
            return cubic_path(rows.q, rows.rates, rows.times)
        return quintic_path(rows.q, rows.rates, rows.changes, rows.times)
    except ValueError as error:
        raise InvalidFile(file=file, problem=str(error)) from None


def _read_csv(file: File, robot: Robot) -> _Rows:
    with open_text(file) as text:
        head = text.readline()
    names = [word.strip().strip('"') for word in re.split("[,;\t]", head.strip())]
    named = {m[1]: (name, m[2]) for name in names if (m := _COLUMN.fullmatch(name))}
    columns, factors = [], []
    for joint in robot.joints:
        if joint.name not in named:
            unit = "rad" if joint.turns else "m"
            problem = (
                f"has no column for joint {joint.name!r}, expected "
                f"{joint.name}_{unit}; or state its value with --lock"
            )
            raise InvalidFile(file=file, where="line 1", problem=problem)
        name, unit = named[joint.name]
        if (unit in ("rad", "deg")) != joint.turns:
            expected = "_rad or _deg" if joint.turns else "_m or _mm"
            problem = f"has the column {name!r}, expected {expected} for this joint"
            raise InvalidFile(file=file, where="line 1", problem=problem)
        columns.append(name)
        factors.append(UNITS[unit])
    try:
        with open_text(file) as text:
            parts = list(Table(file, text, columns).rows())
    except OSError as error:
        reason = error.strerror or str(error)
        raise InvalidFile(file=file, problem=f"cannot be read: {reason}") from None
    if not parts:
        raise InvalidFile(file=file, problem="has no row")
    table = np.concatenate(parts)
    _check_degrees(file, table, columns)
    return _Rows(table * np.array(factors))


def _check_degrees(file: File, table: FloatArray, columns: Sequence[str]) -> None:
    """Refuse radians under the name of degrees."""
    angles = [k for k, name in enumerate(columns) if name.endswith("_deg")]
    if not angles or not np.ptp(table[:, angles], axis=0).any():
        return
    most = float(np.abs(table[:, angles]).max())
    if most <= np.pi and (np.abs(table[:, angles]) % 1.0 > 0.0).any():
        problem = (
            f"its columns in degrees stay within {most:.4g}, which is at most pi: they "
            "look like radians; expected _rad, also for degrees as small as these"
        )
        raise InvalidFile(file=file, problem=problem)


def _check_units(file: File, q: FloatArray, joints: Sequence[RobotJoint]) -> None:
    """Refuse degrees under the name of radians."""
    for k, joint in enumerate(joints):
        most = float(np.abs(q[:, k]).max())
        limits = [abs(x) for x in (joint.lower, joint.upper) if np.isfinite(x)]
        if joint.turns and not most <= max([MOST_TURNS, *(2.0 * x for x in limits)]):
            row = int(np.argmax(np.abs(q[:, k])))
            problem = (
                f"joint {joint.name!r} turns to {most:.4g} rad at waypoint {row}; "
                "is it in degrees? expected _deg, or radians"
            )
            raise InvalidFile(file=file, problem=problem)


def _read_message(file: File, robot: Robot) -> _Rows:
    document = read_yaml(read_text(file, limit=MAX_BYTES), file=file)
    message = _trajectory(document, document.data)
    names, points = message.get("joint_names"), message.get("points")
    if not isinstance(names, list) or not isinstance(points, list) or not points:
        problem = "is no JointTrajectory: expected joint_names and points"
        raise InvalidFile(file=file, problem=problem)
    if len(points) > MAX_ROWS:
        raise InvalidFile(file=file, problem=f"has more than {MAX_ROWS} points")
    missing = [joint.name for joint in robot.joints if joint.name not in names]
    if missing:
        problem = f"has no joint {missing[0]!r}; state its value with --lock"
        raise InvalidFile(file=file, where="joint_names", problem=problem)
    order = [names.index(joint.name) for joint in robot.joints]
    q = _values(file, points, "positions", len(names))
    if q is None:
        raise InvalidFile(file=file, where="points[0]", problem="has no positions")
    rates = _values(file, points, "velocities", len(names))
    changes = _values(file, points, "accelerations", len(names))
    return _Rows(
        q[:, order],
        _times(file, points),
        None if rates is None else rates[:, order],
        None if changes is None else changes[:, order],
    )


def _trajectory(document: YamlDocument, data: Any) -> dict[str, Any]:
    """A JointTrajectory, by itself or in a RobotTrajectory or a message about one."""
    while isinstance(data, dict):
        if "joint_names" in data:
            return data
        multi = data.get("multi_dof_joint_trajectory") or {}
        if isinstance(multi, dict) and multi.get("points"):
            problem = "has points of joints with several degrees, which are not judged"
            raise document.invalid(("multi_dof_joint_trajectory",), problem)
        keys = ("joint_trajectory", "trajectory")
        data = next((data[key] for key in keys if key in data), None)
    problem = "is no trajectory: expected joint_names and points"
    raise document.invalid((), problem)


def _values(file: File, points: list[Any], key: str, count: int) -> FloatArray | None:
    """One list of numbers of each point; None where no point has it."""
    rows = [point.get(key) if isinstance(point, dict) else None for point in points]
    if not any(rows):
        return None
    for k, row in enumerate(rows):
        values = row if isinstance(row, list) else []
        good = len(values) == count
        good = good and all(type(value) in (int, float) for value in values)
        if not good or not np.isfinite(values).all():
            problem = f"is {str(row)[:60]}, expected {count} finite numbers"
            raise InvalidFile(file=file, where=f"points[{k}].{key}", problem=problem)
    return np.array(rows, dtype=np.float64)


def _times(file: File, points: list[Any]) -> FloatArray | None:
    """When each point is reached; None where no point says so; [s]."""
    found = [point.get("time_from_start") for point in points]
    if all(time is None for time in found):
        return None
    times = []
    for k, stated in enumerate(found):
        time = stated
        if isinstance(stated, dict):
            part = stated.get("nanosec", stated.get("nsecs", 0))
            time = _second(stated.get("sec", stated.get("secs", 0)), part)
        if type(time) not in (int, float) or not np.isfinite(time):
            where = f"points[{k}].time_from_start"
            problem = f"is {str(stated)[:60]}, expected seconds"
            raise InvalidFile(file=file, where=where, problem=problem)
        times.append(float(time))
    return np.array(times)


def _second(whole: Any, part: Any) -> float | None:
    if type(whole) not in (int, float) or type(part) not in (int, float):
        return None
    return float(whole + 1e-9 * part)


def path_text(path: Path, robot: Robot) -> str:
    """Waypoints as CSV, which `read_path` reads back to the same numbers."""
    names = [f"{j.name}_{'rad' if j.turns else 'm'}" for j in robot.joints]
    rows = [",".join(map(repr, row)) for row in path.knots.tolist()]
    return "\n".join([",".join(names), *rows]) + "\n"
