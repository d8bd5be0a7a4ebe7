"""Trajectories of robots as CSV with named columns."""

import json
import re
from collections.abc import Sequence
from pathlib import Path as File
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import readable
from vdsm_pin.io.tables import Table, open_text, quoted
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.robots.model import Robot, RobotJoint, Values
from vdsm_pin.units import MM_PER_M

UNITS: Final = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0, "mm": 1.0 / MM_PER_M}
TIME: Final = "time_s"
RATES: Final = "velocity", "s"
CHANGES: Final = "acceleration", "s2"

Stated: TypeAlias = dict[str, tuple[str, str]]
"""Column and unit of a joint by its name."""

_COLUMN: Final = re.compile(r"(.+)_(rad|deg|mm|m)")
_SMOOTH: Final = re.compile(r"(.+)_(velocity|acceleration)_(rad|deg|mm|m)_(s|s2)")


def read_csv(
    file: File, joints: Sequence[RobotJoint], values: Values, most: int = 2
) -> JointTrajectory:
    """The joints that move and, without rates, others that `values` has.

    Args:
        file: The CSV.
        joints: Those that move.
        values: Of all joints by those that move.
        most: Derivatives that are read: none, velocities, or accelerations too.
    """
    known = {joint.name for joint in joints}
    with readable(file), open_text(file) as text:
        table = Table(file, text, lambda name: {name, *_stated([name])} & known)
        return _read(table, joints, values, most)


def _read(
    table: Table, joints: Sequence[RobotJoint], values: Values, most: int
) -> JointTrajectory:
    """The same of a table whose header alone was read."""
    file, names, known = table.file, table.names, {joint.name for joint in joints}
    stated = _stated(names)
    _check_once(file, names, stated)
    columns, factors = _position_columns(table, stated, joints)
    others = [one for one in stated if one in values and one not in known]
    smooth = [
        _smooth_columns(table, joints, *what) if order <= most else []
        for order, what in enumerate((RATES, CHANGES), start=1)
    ]
    if smooth[1] and not smooth[0]:
        fault = "has accelerations, expected velocities too"
        raise InvalidFile(file=file, where="line 1", fault=fault)
    times = [TIME] if TIME in names else []
    if smooth[0] and not times:
        fault = f"has velocities, expected {TIME} too"
        raise InvalidFile(file=file, where="line 1", fault=fault)
    wanted = [*columns, *times, *smooth[0], *smooth[1]]
    more = [stated[one][0] for one in others]
    table.choose([*wanted, *more])
    rows, n = table.all_rows(), len(columns)
    _check_small(file, rows, columns, joints)
    rest = rows[:, n + len(times) :]
    parts = [
        rest[:, k * n : (k + 1) * n]
        * np.array([UNITS[m[3]] for name in found if (m := _SMOOTH.fullmatch(name))])
        if found
        else None
        for k, found in enumerate(smooth)
    ]
    factors += [UNITS[stated[one][1]] for one in others]
    return JointTrajectory(
        (*(joint.name for joint in joints), *others),
        np.hstack([rows[:, :n], rows[:, len(wanted) :]]) * np.array(factors),
        rows[:, n] if times else None,
        parts[0],
        parts[1],
        table.notes,
        tuple(name for name, (_, unit) in stated.items() if unit in ("deg", "mm")),
    )


def _stated(names: Sequence[str]) -> Stated:
    """Column and unit of each joint that has one."""
    return {m[1]: (name, m[2]) for name in names if (m := _COLUMN.fullmatch(name))}


def _check_once(file: File, names: Sequence[str], stated: Stated) -> None:
    """Refuse a second column of a joint, in another unit."""
    for name in names:
        if (m := _COLUMN.fullmatch(name)) and stated[m[1]][0] != name:
            fault = f"has {name!r} and {stated[m[1]][0]!r}, expected one of them"
            raise InvalidFile(file=file, where="line 1", fault=fault)


def _position_columns(
    table: Table, named: Stated, joints: Sequence[RobotJoint]
) -> tuple[list[str], list[float]]:
    """Names of the columns of the joints, and what makes them SI units."""
    columns, factors, file = [], list[float](), table.file
    for joint in joints:
        if joint.name not in named:
            _check_unit(table, joint, joint.name)
            like = [x for x in table.names if _is_like(x, joint.name)]
            fault = (
                f"has no column for joint {joint.name!r}, expected "
                f"{joint.name}_{joint.unit} or {joint.name}_{joint.other_unit}"
                + (f", not {like[0]!r}" if like else "")
                + "; or state where it stands: `lock` in the problem file, --lock "
                "beside --urdf"
            )
            raise InvalidFile(file=file, where="line 1", fault=fault)
        name, unit = named[joint.name]
        _check_kind(file, name, unit, joint)
        columns.append(name)
        factors.append(UNITS[unit])
    return columns, factors


def _is_like(column: str, joint: str) -> bool:
    """Whether a column may be meant for the places of a joint."""
    begins = re.match(re.escape(joint) + "(?![0-9a-z])", column, re.IGNORECASE)
    return begins is not None and _SMOOTH.fullmatch(column) is None


def _check_unit(table: Table, joint: RobotJoint, name: str, per: str = "") -> None:
    """Refuse a column of a joint that states no unit."""
    if name in table.names:
        units = joint.unit, joint.other_unit
        words = " or ".join(f"{name}_{unit}{per}" for unit in units)
        fault = f"has the column {name!r} without a unit, expected {words}"
        raise InvalidFile(file=table.file, where="line 1", fault=fault)


def _check_kind(file: File, name: str, unit: str, joint: RobotJoint) -> None:
    """Refuse lengths of a joint that turns, and angles of one that slides."""
    if (unit in ("rad", "deg")) != joint.turns:
        expected = "_rad or _deg" if joint.turns else "_m or _mm"
        fault = f"has the column {name!r}, expected {expected} for this joint"
        raise InvalidFile(file=file, where="line 1", fault=fault)


def _smooth_columns(
    table: Table, joints: Sequence[RobotJoint], what: str, per: str
) -> list[str]:
    """Names of the velocities or accelerations of all joints, or none at all."""
    file, found = table.file, Stated()
    for name in table.names:
        m = _SMOOTH.fullmatch(name)
        if m and (m[2], m[4]) == (what, per):
            if m[1] in found:
                fault = f"has {name!r} and {found[m[1]][0]!r}, expected one of them"
                raise InvalidFile(file=file, where="line 1", fault=fault)
            found[m[1]] = name, m[3]
    for joint in joints:
        if joint.name not in found:
            _check_unit(table, joint, f"{joint.name}_{what}", f"_{per}")
    mine = [joint for joint in joints if joint.name in found]
    for joint in joints if mine else []:
        if joint.name not in found:
            expected = f"{joint.name}_{what}_{joint.unit}_{per}"
            fault = f"has no column {expected}, but one for {mine[0].name!r}"
            raise InvalidFile(file=file, where="line 1", fault=fault)
        _check_kind(file, *found[joint.name], joint)
    return [found[joint.name][0] for joint in joints] if mine else []


def _check_small(
    file: File, rows: FloatArray, columns: Sequence[str], joints: Sequence[RobotJoint]
) -> None:
    """Refuse radians under the name of degrees, metres under that of millimetres."""
    far = np.array([joint.farthest for joint in joints])
    turn = np.clip(np.where(far > 0.0, far, np.inf), np.pi, 2.0 * np.pi)
    for ending, most, unit, other, expected in (
        ("_deg", turn, "degrees", "radians", "_rad"),
        ("_mm", far, "millimetres", "metres", "_m"),
    ):
        own = [k for k, name in enumerate(columns) if name.endswith(ending)]
        values = rows[:, own]
        small = (np.abs(values) <= most[own]).all()
        if small and np.ptp(values, axis=0).any() and (values % 1.0 > 0.0).any():
            fault = (
                f"its columns in {unit} stay within {np.abs(values).max():.4g}: they "
                f"look like {other}; expected {expected}, also for {unit} as small as "
                "these"
            )
            raise InvalidFile(file=file, fault=fault)


def csv_text(motion: JointTrajectory, robot: Robot) -> str:
    """Waypoints as CSV, which `read_motion` reads back to the same numbers.

    What is too far to be taken for radians or metres is in degrees or millimetres, to
    their last digit.
    Velocities without times, which join nothing, are left out.
    """
    far = np.abs(motion.q).max(axis=0) > [j.most_unstated for j in robot.joints]
    both = zip(far, robot.joints, strict=True)
    units = [j.other_unit if f else j.unit for f, j in both]
    heads = [f"{j.name}_{unit}" for j, unit in zip(robot.joints, units, strict=True)]
    parts = [motion.q / [UNITS[unit] for unit in units]]
    if motion.times is not None:
        heads.append(TIME)
        parts.append(motion.times[:, None])
    for values, (what, per) in ((motion.rates, RATES), (motion.changes, CHANGES)):
        if values is not None and motion.times is not None:
            heads += [f"{j.name}_{what}_{j.unit}_{per}" for j in robot.joints]
            parts.append(values)
    rows = [json.dumps(row)[1:-1].replace(" ", "") for row in np.hstack(parts).tolist()]
    return "\n".join([",".join(map(quoted, heads)), *rows]) + "\n"
