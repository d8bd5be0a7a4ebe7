"""Trajectories of robots: CSV with named columns, messages and bags of ROS."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.bags import is_bag, read_bag
from vdsm_pin.io.joint_trajectory import (
    ENDINGS,
    STILL,
    JointTrajectory,
    read_joint_trajectory,
)
from vdsm_pin.io.source import check_is_file, readable
from vdsm_pin.io.tables import Table, open_text
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.units import MM_PER_M

if TYPE_CHECKING:  # whoever reads waypoints alone needs no pieces
    from vdsm_pin.proof.paths import Path

UNITS: Final = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0, "mm": 1.0 / MM_PER_M}
MOST_TURNS: Final = 4.0 * np.pi
"""An angle beyond this must be in degrees; [rad]."""

TIME: Final = "time_s"
RATES: Final = "velocity", "s"
CHANGES: Final = "acceleration", "s2"

_COLUMN: Final = re.compile(r"(.+)_(rad|deg|mm|m)")
_SMOOTH: Final = re.compile(r"(.+)_(velocity|acceleration)_(rad|deg|mm|m)_(s|s2)")


def read_motion(
    file: File, joints: Sequence[RobotJoint], topic: str | None = None
) -> JointTrajectory:
    """The waypoints of a trajectory, a column for each joint that moves.

    Args:
        file: CSV with a column for each joint, `NAME_rad`, `NAME_deg`, `NAME_m` or
            `NAME_mm`; a JointTrajectory or RobotTrajectory as YAML or JSON; or a bag.
        joints: Those that move.
        topic: Of a bag.

    Raises:
        InvalidFile: If a joint is missing or unknown, or a value is no number or in
            another unit than stated.
    """
    if topic is not None and not is_bag(file):
        problem = f"is no bag, so --topic {topic} has no meaning"
        raise InvalidFile(file=file, problem=problem)
    if is_bag(file):
        found = _of_joints(file, read_bag(file, topic), joints)
    else:
        check_is_file(file)
        if file.suffix.lower() in ENDINGS:
            found = _of_joints(file, read_joint_trajectory(file), joints)
        else:
            found = _read_csv(file, joints)
    _check_units(file, found.q, joints)
    return found


def read_path(file: File, robot: Robot, topic: str | None = None) -> "Path":
    """A trajectory as the controller runs it, see `read_motion`.

    Straight lines between waypoints; cubic pieces where velocities and times are stated
    too, and quintic ones with accelerations.

    Raises:
        InvalidFile: As `read_motion`, or if times do not rise.
    """
    from vdsm_pin.proof.paths import Path, cubic_path, quintic_path

    motion = read_motion(file, robot.joints, topic)
    try:
        if motion.times is None or motion.rates is None:
            return Path(motion.q, times=motion.times)
        if motion.changes is None:
            return cubic_path(motion.q, motion.rates, motion.times)
        return quintic_path(motion.q, motion.rates, motion.changes, motion.times)
    except ValueError as error:
        raise InvalidFile(file=file, problem=str(error)) from None


def _of_joints(
    file: File, motion: JointTrajectory, joints: Sequence[RobotJoint]
) -> JointTrajectory:
    """The columns of some joints, planar ones by their turn about z.

    Raises:
        InvalidFile: If one is missing.
    """
    named = {joint.name for joint in joints}
    names = list(motion.names)
    for k, name in enumerate(names):
        joint, _, part = name.rpartition("/")
        if f"{joint}/theta" not in named or name in named:
            continue
        if part != "yaw" and not (np.abs(motion.q[:, k]) <= STILL).all():
            problem = f"joint {joint!r} is planar, expected {part} 0"
            raise InvalidFile(file=file, problem=problem)
        if part == "yaw":
            names[k] = f"{joint}/theta"
    missing = [joint.name for joint in joints if joint.name not in names]
    if missing:
        problem = f"has no joint {missing[0]!r}; state its value with --lock"
        raise InvalidFile(file=file, where="joint_names", problem=problem)
    wanted = [joint.name for joint in joints]
    return replace(motion, names=tuple(names)).of(wanted)


def _read_csv(file: File, joints: Sequence[RobotJoint]) -> JointTrajectory:
    with open_text(file) as text:
        head = text.readline()
    names = [word.strip().strip('"') for word in re.split("[,;\t]", head.strip())]
    columns, factors = _position_columns(file, names, joints)
    smooth = [_smooth_columns(file, names, joints, *w) for w in (RATES, CHANGES)]
    if smooth[1] and not smooth[0]:
        problem = "has accelerations, expected velocities too"
        raise InvalidFile(file=file, where="line 1", problem=problem)
    times = [TIME] if TIME in names else []
    if smooth[0] and not times:
        problem = f"has velocities, expected {TIME} too"
        raise InvalidFile(file=file, where="line 1", problem=problem)
    wanted = [*columns, *times, *smooth[0], *smooth[1]]
    with readable(file), open_text(file) as text:
        table, n = Table(file, text, wanted).all_rows(), len(columns)
    _check_degrees(file, table, columns)
    rest = table[:, n + len(times) :]
    parts = [
        rest[:, k * n : (k + 1) * n]
        * np.array([UNITS[m[3]] for name in found if (m := _SMOOTH.fullmatch(name))])
        if found
        else None
        for k, found in enumerate(smooth)
    ]
    return JointTrajectory(
        tuple(joint.name for joint in joints),
        table[:, :n] * np.array(factors),
        table[:, n] if times else None,
        parts[0],
        parts[1],
    )


def _position_columns(
    file: File, names: Sequence[str], joints: Sequence[RobotJoint]
) -> tuple[list[str], list[float]]:
    """Names of the columns of the joints, and what makes them SI units."""
    named = {m[1]: (name, m[2]) for name in names if (m := _COLUMN.fullmatch(name))}
    columns, factors = [], []
    for joint in joints:
        if joint.name not in named:
            problem = (
                f"has no column for joint {joint.name!r}, expected "
                f"{joint.name}_{joint.unit}; or state its value with --lock"
            )
            raise InvalidFile(file=file, where="line 1", problem=problem)
        name, unit = named[joint.name]
        _check_kind(file, name, unit, joint)
        columns.append(name)
        factors.append(UNITS[unit])
    return columns, factors


def _check_kind(file: File, name: str, unit: str, joint: RobotJoint) -> None:
    """Refuse lengths of a joint that turns, and angles of one that slides."""
    if (unit in ("rad", "deg")) != joint.turns:
        expected = "_rad or _deg" if joint.turns else "_m or _mm"
        problem = f"has the column {name!r}, expected {expected} for this joint"
        raise InvalidFile(file=file, where="line 1", problem=problem)


def _smooth_columns(
    file: File, names: Sequence[str], joints: Sequence[RobotJoint], what: str, per: str
) -> list[str]:
    """Names of the velocities or accelerations of all joints, or none at all."""
    found = {
        m[1]: (name, m[3])
        for name in names
        if (m := _SMOOTH.fullmatch(name)) and (m[2], m[4]) == (what, per)
    }
    mine = [joint for joint in joints if joint.name in found]
    for joint in joints if mine else []:
        if joint.name not in found:
            expected = f"{joint.name}_{what}_{joint.unit}_{per}"
            problem = f"has no column {expected}, but one for {mine[0].name!r}"
            raise InvalidFile(file=file, where="line 1", problem=problem)
        _check_kind(file, *found[joint.name], joint)
    return [found[joint.name][0] for joint in joints] if mine else []


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


def csv_text(motion: JointTrajectory, robot: Robot) -> str:
    """Waypoints as CSV, which `read_motion` reads back to the same numbers."""
    heads = [f"{joint.name}_{joint.unit}" for joint in robot.joints]
    parts = [motion.q]
    if motion.times is not None:
        heads.append(TIME)
        parts.append(motion.times[:, None])
    for values, (what, per) in ((motion.rates, RATES), (motion.changes, CHANGES)):
        if values is not None:
            heads += [f"{j.name}_{what}_{j.unit}_{per}" for j in robot.joints]
            parts.append(values)
    rows = [json.dumps(row)[1:-1].replace(" ", "") for row in np.hstack(parts).tolist()]
    return "\n".join([",".join(heads), *rows]) + "\n"


def path_text(path: "Path", robot: Robot) -> str:
    """The waypoints of straight lines as CSV."""
    names = tuple(joint.name for joint in robot.joints)
    return csv_text(JointTrajectory(names, path.knots, path.times), robot)
