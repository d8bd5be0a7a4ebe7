"""Trajectories of named joints: JointTrajectory and RobotTrajectory as YAML or JSON."""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_quaternion
from vdsm_pin.io.source import read_text
from vdsm_pin.io.yaml_reader import read_yaml
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.trajectory import MAX_ROWS
from vdsm_pin.tolerances import TOLERANCES

ENDINGS: Final = (".yaml", ".yml", ".json")
MAX_BYTES: Final = 256 << 20
MULTI: Final = "multi_dof_joint_trajectory"
_FREE: Final = ("x", "y", "z", "yaw", "pitch", "roll")
_NANO: Final = 1e-9
_TIMES: Final = ("sec", "nanosec"), ("secs", "nsecs")
"""Keys of a duration in ROS 2, and in ROS 1."""


def read_joint_trajectory(file: Path) -> JointTrajectory:
    """A trajectory of a text file.

    Raises:
        InvalidFile: If it is none or breaks its contract.
    """
    document = read_yaml(read_text(file, limit=MAX_BYTES), file=file)
    return of_message(file, document.data)


def of_message(file: Path, data: Any) -> JointTrajectory:
    """A JointTrajectory, by itself or in a RobotTrajectory or a message about one.

    A joint of several degrees has the columns NAME/x, /y, /z, /yaw, /pitch, /roll.

    Args:
        file: For messages.
        data: Mappings, lists and numbers, as of YAML.

    Raises:
        InvalidFile: If it is no trajectory or breaks its contract.
    """
    message, multi = _found(data)
    parts = []
    if message is not None and (message.get("points") or not multi):
        parts.append(_single(file, message))
    if multi:
        parts.append(_multi(file, multi))
    if not parts:
        problem = "is no trajectory: expected joint_names and points"
        raise InvalidFile(file=file, problem=problem)
    return parts[0] if len(parts) == 1 else _together(file, *parts)


def _found(data: Any) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """The JointTrajectory in a message, and the one of joints of several degrees."""
    multi = None
    while isinstance(data, dict):
        if "joint_names" in data:
            return data, multi
        stated = data.get(MULTI)
        if isinstance(stated, dict) and stated.get("points"):
            multi = stated
        keys = ("joint_trajectory", "trajectory", "goal")
        data = next((data[key] for key in keys if key in data), None)
        if isinstance(data, list):  # of a DisplayTrajectory
            data = data[0] if len(data) == 1 else None
    return None, multi


def _points(file: Path, message: dict[str, Any]) -> tuple[tuple[str, ...], list[Any]]:
    """Names of joints and points of a message."""
    names, points = message.get("joint_names"), message.get("points")
    if not isinstance(names, list) or not isinstance(points, list) or not points:
        problem = "is no JointTrajectory: expected joint_names and points"
        raise InvalidFile(file=file, problem=problem)
    for name in names:
        if not isinstance(name, str) or names.count(name) > 1:
            problem = f"has {str(name)[:60]!r}, expected names that differ"
            raise InvalidFile(file=file, where="joint_names", problem=problem)
    if len(points) > MAX_ROWS:
        raise InvalidFile(file=file, problem=f"has more than {MAX_ROWS} points")
    return tuple(names), points


def _single(file: Path, message: dict[str, Any]) -> JointTrajectory:
    names, points = _points(file, message)
    q = _values(file, points, "positions", len(names))
    if q is None:
        raise InvalidFile(file=file, where="points[0]", problem="has no positions")
    rates = _values(file, points, "velocities", len(names))
    changes = _values(file, points, "accelerations", len(names))
    times = _times(file, points)
    try:
        return JointTrajectory(names, q, times, rates, changes)
    except InvalidInput as error:
        raise InvalidFile(file=file, where="points", problem=str(error)) from None


def _values(file: Path, points: list[Any], key: str, count: int) -> FloatArray | None:
    """One list of numbers of each point; None where no point has it."""
    rows = [point.get(key) if isinstance(point, dict) else None for point in points]
    if not any(rows):
        return None
    for k, row in enumerate(rows):
        if (numbers := finite_numbers(row, count)) is None:
            problem = f"is {str(row)[:60]}, expected {count} finite numbers"
            raise InvalidFile(file=file, where=f"points[{k}].{key}", problem=problem)
        rows[k] = numbers
    return np.array(rows, dtype=np.float64)


def finite_numbers(row: Any, count: int) -> list[float] | None:
    """So many finite numbers; None where it is another thing."""
    if not isinstance(row, list) or len(row) != count:
        return None
    if not all(type(value) in (int, float) for value in row):
        return None
    try:
        numbers = [float(value) for value in row]
    except OverflowError:
        return None
    return numbers if np.isfinite(numbers).all() else None


def _times(file: Path, points: list[Any]) -> FloatArray | None:
    """When each point is reached [s]; None where no point says so, or all say 0."""
    found = [p.get("time_from_start") if isinstance(p, dict) else None for p in points]
    if all(time is None for time in found):
        return None
    times = []
    for k, stated in enumerate(found):
        time = [stated]
        for keys in _TIMES:
            if isinstance(stated, dict) and stated and stated.keys() <= {*keys}:
                time = [stated.get(key, 0) for key in keys]
        numbers = finite_numbers(time, len(time))
        if numbers is None:
            where = f"points[{k}].time_from_start"
            problem = f"is {str(stated)[:60]}, expected seconds"
            raise InvalidFile(file=file, where=where, problem=problem)
        times.append(numbers[0] + (_NANO * numbers[1] if len(numbers) > 1 else 0.0))
    return np.array(times) if len(times) == 1 or any(times) else None


def _multi(file: Path, message: dict[str, Any]) -> JointTrajectory:
    """Joints of several degrees: their places, and turns about z.

    Raises:
        InvalidFile: If one turns about another axis than z on its way: what lies
            between two such turns is no straight line of yaw, pitch and roll.
    """
    names, points = _points(file, message)
    rows = np.zeros((len(points), len(names), 6))
    for k, point in enumerate(points):
        transforms = point.get("transforms") if isinstance(point, dict) else None
        where = f"{MULTI}.points[{k}]"
        if not isinstance(transforms, list) or len(transforms) != len(names):
            problem = f"expected transforms, one for each of {len(names)} joints"
            raise InvalidFile(file=file, where=where, problem=problem)
        for column, transform in enumerate(transforms):
            rows[k, column] = _transform(file, f"{where}.transforms", transform)
        if point.get("velocities"):
            problem = "has velocities of joints of several degrees, expected none"
            raise InvalidFile(file=file, where=where, problem=problem)
    rows[..., 3:] = np.unwrap(rows[..., 3:], axis=0)
    for column, name in enumerate(names):
        if not (np.ptp(rows[:, column, 4:], axis=0) <= TOLERANCES.still).all():
            problem = (
                f"joint {name!r} turns about another axis than z between points, "
                "expected one pitch and roll"
            )
            raise InvalidFile(file=file, where=MULTI, problem=problem)
    rows[..., 4:] = rows[:1, :, 4:]
    whole = tuple(f"{name}/{part}" for name in names for part in _FREE)
    return JointTrajectory(whole, rows.reshape(len(rows), -1), _times(file, points))


def _transform(file: Path, where: str, transform: Any) -> FloatArray:
    """x, y, z, yaw, pitch, roll of one transform, shape (6,)."""
    found = []
    for part, keys in (("translation", "xyz"), ("rotation", "xyzw")):
        stated = transform.get(part) if isinstance(transform, dict) else None
        values = [stated.get(key) for key in keys] if isinstance(stated, dict) else None
        if (numbers := finite_numbers(values, len(keys))) is None:
            problem = (
                f"{part} is {str(stated)[:60]}, expected numbers {', '.join(keys)}"
            )
            raise InvalidFile(file=file, where=where, problem=problem)
        found += numbers
    quaternion = np.array(found[3:])
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) <= TOLERANCES.quaternion:
        problem = f"rotation has length {length:g}, expected 1"
        raise InvalidFile(file=file, where=where, problem=problem)
    turn = rotation_from_quaternion(quaternion / length)
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    # About what yaw leaves: where the pitch is 90 deg, yaw is any, and roll fits it.
    pitch = np.arctan2(-turn[2, 0], c * turn[0, 0] + s * turn[1, 0])
    roll = np.arctan2(s * turn[0, 2] - c * turn[1, 2], c * turn[1, 1] - s * turn[0, 1])
    return np.array([*found[:3], yaw, pitch, roll])


def _together(
    file: Path, one: JointTrajectory, other: JointTrajectory
) -> JointTrajectory:
    """Both parts of a RobotTrajectory, whose points are the same moments.

    Raises:
        InvalidFile: If they are not, or one part has velocities alone.
    """
    if len(one.q) != len(other.q):
        problem = f"has {len(other.q)} points beside {len(one.q)} of joint_trajectory"
        raise InvalidFile(file=file, where=MULTI, problem=problem)
    if one.rates is not None:
        problem = "has no velocities, but joint_trajectory has: leave them out"
        raise InvalidFile(file=file, where=MULTI, problem=problem)
    times = other.times
    if times is None or one.times is None:
        times = one.times
    elif not np.array_equal(one.times, times):
        problem = "has other times than joint_trajectory"
        raise InvalidFile(file=file, where=MULTI, problem=problem)
    q = np.hstack([one.q, other.q])
    try:
        return JointTrajectory(one.names + other.names, q, times)
    except InvalidInput as error:
        raise InvalidFile(file=file, where=MULTI, problem=str(error)) from None


def message_of(motion: JointTrajectory) -> dict[str, Any]:
    """The same as a JointTrajectory of ROS 2, in mappings, lists and numbers."""
    points: list[dict[str, Any]] = []
    for k, row in enumerate(motion.q.tolist()):
        point: dict[str, Any] = {"positions": row}
        if motion.rates is not None:
            point["velocities"] = motion.rates[k].tolist()
        if motion.changes is not None:
            point["accelerations"] = motion.changes[k].tolist()
        if motion.times is not None:
            point["time_from_start"] = duration(float(motion.times[k]))
        points.append(point)
    return {"joint_names": list(motion.names), "points": points}


def duration(seconds: float) -> dict[str, int]:
    """A duration of ROS 2, to the nanosecond; [s]."""
    whole, part = divmod(round(seconds / _NANO), round(1.0 / _NANO))
    return {"sec": whole, "nanosec": part}


def text_of(motion: JointTrajectory, ending: str) -> str:
    """The text of a file: JSON, or YAML with a line for each point.

    Args:
        motion: What it holds.
        ending: `.json` or `.yaml`.
    """
    message = message_of(motion)
    if ending == ".json":
        return json.dumps(message, indent=1) + "\n"
    names = json.dumps(message["joint_names"], ensure_ascii=False)
    rows = [f"  - {json.dumps(point)}" for point in message["points"]]
    return "\n".join([f"joint_names: {names}", "points:", *rows]) + "\n"
