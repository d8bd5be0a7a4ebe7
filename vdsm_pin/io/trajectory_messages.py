"""Trajectories of named joints: JointTrajectory and RobotTrajectory as YAML or JSON."""

import json
import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_quaternion
from vdsm_pin.io.places import Place, finite_numbers
from vdsm_pin.io.source import read_text
from vdsm_pin.io.yaml_reader import read_yaml
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.trajectory import MAX_ROWS
from vdsm_pin.tolerances import TOLERANCES

ENDINGS: Final = (".yaml", ".yml", ".json")
MAX_BYTES: Final = 256 << 20
MULTI: Final = "multi_dof_joint_trajectory"
_FREE: Final = ("x", "y", "z", "yaw", "pitch", "roll")
_DERIVATIVES: Final = "velocities", "accelerations"
_NANOS: Final = 1_000_000_000
"""Nanoseconds of a second."""

_LONGEST: Final = 1 << 31
"""Beyond what a duration of ROS has, either way; [s]."""

_TIMES: Final = ("sec", "nanosec"), ("secs", "nsecs")
"""Keys of a duration in ROS 2, and in ROS 1."""


def read_joint_trajectory(file: Path, most: int = 2) -> JointTrajectory:
    """A trajectory of a text file, with as many derivatives as `of_message` reads.

    Raises:
        InvalidFile: If it is none or breaks its contract.
    """
    document = read_yaml(read_text(file, limit=MAX_BYTES), file=file)
    return of_message(Place(document, (), document.data), most)


def of_message(data: Place, most: int = 2) -> JointTrajectory:
    """A JointTrajectory, by itself or in a RobotTrajectory or a message about one.

    A joint of several degrees has the columns NAME/x, /y, /z, /yaw, /pitch, /roll.

    Args:
        data: Mappings, lists and numbers.
        most: Derivatives that are read: none, velocities, or accelerations too.

    Raises:
        InvalidFile: If it is no trajectory or breaks its contract.
    """
    message, multi = _found(data)
    one = other = None
    if message is not None and (message.get("points").value or multi is None):
        one = _single(message, most)
    if multi is not None:
        other = _multi(multi, most)
    if one is not None and other is not None and multi is not None:
        with multi.naming():
            return _together(one, other)
    if (found := one or other) is None:
        fault = "is no trajectory: expected joint_names and points"
        raise data.invalid(fault)
    return found


def _found(data: Place) -> tuple[Place | None, Place | None]:
    """The JointTrajectory in a message, and the one of joints of several degrees."""
    multi = None
    while isinstance(data.value, dict):
        if "joint_names" in data.value:
            return data, multi
        if (stated := data.get(MULTI)).get("points").value:
            multi = stated
        keys = ("joint_trajectory", "trajectory", "goal")
        data = next((data[key] for key in keys if key in data.value), data.get("goal"))
        if isinstance(data.value, list):  # of a DisplayTrajectory
            if (count := len(data.value)) != 1:
                fault = f"has {count} trajectories, expected one"
                raise data.invalid(fault)
            data = data[0]
    return None, multi


def _points(message: Place) -> tuple[tuple[str, ...], list[Place]]:
    """Names of joints and points of a message."""
    names, points = (message.get(key) for key in ("joint_names", "points"))
    if not isinstance(names.value, list) or not points.value:
        fault = "is no JointTrajectory: expected joint_names and points"
        raise message.invalid(fault)
    for name in names.value:
        if not isinstance(name, str) or names.value.count(name) > 1:
            fault = f"has {str(name)[:60]!r}, expected names that differ"
            raise names.invalid(fault)
    if len(found := points.items()) > MAX_ROWS:
        fault = f"has more than {MAX_ROWS} points"
        raise message.invalid(fault)
    return tuple(names.value), found


def _single(message: Place, most: int) -> JointTrajectory:
    names, points = _points(message)
    q, rates, changes = (
        _values(points, key, len(names)) if order <= most else None
        for order, key in enumerate(("positions", *_DERIVATIVES))
    )
    if q is None:
        fault = "has no positions"
        raise points[0].invalid(fault)
    times = _times(points)
    with message["points"].naming():
        notes = _unread(points, most)
        return JointTrajectory(names, q, times, rates, changes, notes)


def _unread(points: list[Place], most: int) -> tuple[str, ...]:
    """A note on derivatives that the points have and that are not read."""
    left = [
        key for key in _DERIVATIVES[most:] if any(one.get(key).value for one in points)
    ]
    return (f"{' and '.join(left)} are not read",) if left else ()


def _values(points: list[Place], key: str, count: int) -> FloatArray | None:
    """One list of numbers of each point; None where no point has it."""
    rows = [point.get(key) for point in points]
    if not any(row.value for row in rows):
        return None
    return np.array([row.numbers(count) for row in rows])


def _times(points: list[Place]) -> FloatArray | None:
    """When each point is reached [s]; None where no point says so, or all say 0."""
    found = [point.get("time_from_start") for point in points]
    if all(time.value is None for time in found):
        return None
    times = np.array([_seconds(time) for time in found])
    return times if len(times) == 1 or times.any() else None


def _seconds(time: Place) -> float:
    """A duration; [s]."""
    stated = time.value
    parts = [stated, 0]
    for keys in _TIMES:
        if isinstance(stated, dict) and stated and stated.keys() <= {*keys}:
            parts = [stated.get(key, 0) for key in keys]
    if (numbers := finite_numbers(parts, 2)) is None:
        fault = f"is {str(stated)[:60]}, expected seconds"
        raise time.invalid(fault)
    seconds, nanos = numbers
    if abs(seconds) < _LONGEST and all(value.is_integer() for value in numbers):
        return (int(seconds) * _NANOS + int(nanos)) / _NANOS  # rounded once
    return seconds + nanos / _NANOS


def _multi(message: Place, most: int) -> JointTrajectory:
    """Joints of several degrees: their places, and turns about z.

    Raises:
        InvalidFile: If one turns about another axis than z on its way: what lies
            between two such turns is no straight line of yaw, pitch and roll.
    """
    names, points = _points(message)
    rows = np.zeros((len(points), len(names), 6))
    for k, point in enumerate(points):
        transforms = point.get("transforms")
        if not isinstance(transforms.value, list) or len(transforms.value) != len(
            names
        ):
            fault = f"expected one for each of {len(names)} joints"
            raise transforms.invalid(fault)
        rows[k] = [_transform(one) for one in transforms.items()]
        if most and point.get("velocities").value:
            fault = "has velocities of joints of several degrees, expected none"
            raise point.invalid(fault)
    rows[..., 3:] = np.unwrap(rows[..., 3:], axis=0)
    for column, name in enumerate(names):
        if not (np.ptp(rows[:, column, 4:], axis=0) <= TOLERANCES.still).all():
            fault = (
                f"joint {name!r} turns about another axis than z between points, "
                "expected one pitch and roll"
            )
            raise message.invalid(fault)
    rows[..., 4:] = rows[:1, :, 4:]
    whole = tuple(f"{name}/{part}" for name in names for part in _FREE)
    times, notes = _times(points), _unread(points, most)
    return JointTrajectory(whole, rows.reshape(len(rows), -1), times, notes=notes)


def _transform(transform: Place) -> FloatArray:
    """x, y, z, yaw, pitch, roll of one transform, shape (6,)."""
    found = []
    for part, keys in (("translation", "xyz"), ("rotation", "xyzw")):
        place = transform.get(part)
        values = [place.get(key).value for key in keys]
        if (numbers := finite_numbers(values, len(keys))) is None:
            fault = f"is {str(place.value)[:60]}, expected numbers {', '.join(keys)}"
            raise place.invalid(fault)
        found += numbers
    quaternion = np.array(found[3:])
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) <= TOLERANCES.quaternion:
        fault = f"rotation has length {length:g}, expected 1"
        raise transform.invalid(fault)
    turn = rotation_from_quaternion(quaternion / length)
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    # About what yaw leaves: where the pitch is 90 deg, yaw is any, and roll fits it.
    pitch = np.arctan2(-turn[2, 0], c * turn[0, 0] + s * turn[1, 0])
    roll = np.arctan2(s * turn[0, 2] - c * turn[1, 2], c * turn[1, 1] - s * turn[0, 1])
    return np.array([*found[:3], yaw, pitch, roll])


def _together(one: JointTrajectory, other: JointTrajectory) -> JointTrajectory:
    """Both parts of a RobotTrajectory, whose points are the same moments.

    Raises:
        InvalidInput: If they are not, or one part has velocities alone.
    """
    if len(one.q) != len(other.q):
        message = f"has {len(other.q)} points beside {len(one.q)} of joint_trajectory"
        raise InvalidInput(message)
    if one.rates is not None:
        message = "has no velocities, but joint_trajectory has: leave them out"
        raise InvalidInput(message)
    times = other.times
    if times is None or one.times is None:
        times = one.times
    elif not np.array_equal(one.times, times):
        message = "has other times than joint_trajectory"
        raise InvalidInput(message)
    names, q = one.names + other.names, np.hstack([one.q, other.q])
    notes = tuple(dict.fromkeys((*one.notes, *other.notes)))
    return JointTrajectory(names, q, times, notes=notes)


def message_of(motion: JointTrajectory) -> dict[str, Any]:
    """The same as a JointTrajectory of ROS 2, in mappings, lists and numbers.

    Raises:
        InvalidInput: If times are further from 0 than a duration of ROS can be, or
            nearer to each other than it tells.
    """
    _check_durations(motion.times)
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
    whole = math.floor(seconds)
    part = round((seconds - whole) * _NANOS)
    return {"sec": whole + part // _NANOS, "nanosec": part % _NANOS}


def _check_durations(times: FloatArray | None) -> None:
    """Refuse times that durations of ROS cannot tell.

    Raises:
        InvalidInput: If there are such.
    """
    if times is None:
        return
    if not (np.abs(times) < _LONGEST - 1).all():
        far = times[np.argmax(np.abs(times))]
        message = f"time is {far:g} s, but durations of ROS end at {_LONGEST} s"
        raise InvalidInput(message)
    told = [duration(time) for time in times.tolist()]
    nanos = np.array([one["sec"] * _NANOS + one["nanosec"] for one in told])
    if ((np.diff(nanos) == 0) & (np.diff(times) > 0.0)).any():
        message = "times are to be a nanosecond apart, which durations of ROS tell"
        raise InvalidInput(message)


def text_of(motion: JointTrajectory, ending: str, *, of_robot: bool = False) -> str:
    """The text of a file: JSON, or YAML with a line for each point.

    Args:
        motion: What it holds.
        ending: `.json` or `.yaml`.
        of_robot: Whether it is a RobotTrajectory, else it is a JointTrajectory.
    """
    message = message_of(motion)
    if ending == ".json":
        whole = {"joint_trajectory": message} if of_robot else message
        return json.dumps(whole, indent=1) + "\n"
    names = json.dumps(message["joint_names"], ensure_ascii=False)
    rows = [f"  - {json.dumps(point)}" for point in message["points"]]
    lines = [f"joint_names: {names}", "points:", *rows]
    if of_robot:
        lines = ["joint_trajectory:", *(f"  {line}" for line in lines)]
    return "\n".join(lines) + "\n"
