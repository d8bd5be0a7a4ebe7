"""Trajectories of robots: CSV with named columns, messages and bags of ROS."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.bags import check_topic, is_bag, read_bag
from vdsm_pin.io.source import check_is_file
from vdsm_pin.io.trajectory_file import Interpolation, orders
from vdsm_pin.io.trajectory_messages import ENDINGS, read_joint_trajectory
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.robots.model import RobotJoint, Values
from vdsm_pin.robots.trajectory_csv import read_csv
from vdsm_pin.text import listed
from vdsm_pin.tolerances import TOLERANCES

if TYPE_CHECKING:  # whoever reads waypoints alone needs no pieces
    from vdsm_pin.proof.paths import Path


def read_motion(
    file: File,
    joints: Sequence[RobotJoint],
    topic: str | None = None,
    values: Values | None = None,
    joined: Interpolation = "auto",
) -> JointTrajectory:
    """The waypoints of a trajectory, a column for each joint that moves.

    Args:
        file: CSV with a column for each joint, `NAME_rad`, `NAME_deg`, `NAME_m` or
            `NAME_mm`; a JointTrajectory or RobotTrajectory as YAML or JSON; or a bag.
        joints: Those that move.
        topic: Of a bag.
        values: Of all joints by those that move; a column of one that stands still or
            mimics another has to agree with them.
        joined: What joins the rows.

    Raises:
        InvalidFile: If a joint is missing, there twice or elsewhere than it is judged,
            a value is no number or in another unit than stated, or there is not what
            such pieces need.
    """
    values, most = values or {}, orders(joined)
    check_topic(file, topic)
    if is_bag(file):
        whole = read_bag(file, topic, most)
    else:
        check_is_file(file)
        if file.suffix.lower() in ENDINGS:
            whole = read_joint_trajectory(file, most)
        else:
            whole = read_csv(file, joints, values, most)
    if joined in ("cubic", "quintic"):
        _check_smooth(file, whole, most)
    return moved(whole, joints, values, file)


def _check_smooth(file: File, motion: JointTrajectory, most: int) -> None:
    """Refuse a motion without what pieces by this many derivatives need."""
    needed = {"times": motion.times, "velocities": motion.rates}
    needed["accelerations"] = motion.changes
    for name in [*needed][: most + 1]:
        if needed[name] is None:
            fault = f"has no {name}, which smooth pieces between waypoints need; "
            fault += "--interpolation linear judges straight lines"
            raise InvalidFile(file=file, fault=fault)


def moved(
    whole: JointTrajectory, joints: Sequence[RobotJoint], values: Values, file: File
) -> JointTrajectory:
    """The columns of the joints that move, checked as those of any file.

    Args:
        whole: With any other joints beside.
        joints: Those that move.
        values: As of `read_motion`.
        file: For messages.

    Raises:
        InvalidFile: As of `read_motion`.
    """
    found = _of_joints(file, whole, joints)
    unstated = [joint for joint in joints if joint.name not in whole.in_degrees]
    _check_units(file, found.of([joint.name for joint in unstated]).q, unstated)
    others = {
        name: whole.q[:, k]
        for k, name in enumerate(whole.names)
        if name in values and name not in found.names
    }
    known = {*values, *found.names}
    unread = [
        name
        for name in whole.names
        if name not in known and f"{name.rpartition('/')[0]}/theta" not in known
    ]
    notes = [f"joints that are not read: {listed(unread)}"] if unread else []
    notes += [*_agree(file, found.q, others, values), *_long_ways(found.q, joints)]
    return replace(found, notes=(*whole.notes, *notes))


def _agree(
    file: File, q: FloatArray, others: Mapping[str, FloatArray], values: Values
) -> Iterator[str]:
    """Notes on joints that mimic others, near where the file has them.

    One that moves though it stands still is refused by more than the rounding of a
    file: without its lock it is judged as it moves.

    Raises:
        InvalidFile: If a joint is elsewhere than it is judged.
    """
    for name, stated in others.items():
        column, ratio, offset = values[name]
        judged = offset + (ratio * q[:, column] if column is not None else 0.0 * stated)
        off = np.abs(stated - judged)
        row = int(np.argmax(off))
        held, follows = TOLERANCES.held_joint, TOLERANCES.mimicked_joint
        if not off[row] <= (held if column is None else follows):
            why = "stands still" if column is None else "mimics another"
            fault = (
                f"has joint {name!r} at {stated[row]:.6g} at waypoint {row}, but it "
                f"{why} and is judged at {judged[row]:.6g}"
            )
            raise InvalidFile(file=file, fault=fault)
        if off[row] > TOLERANCES.still:
            yield f"joint {name!r} is up to {off[row]:.2g} off where it is judged"


def _long_ways(q: FloatArray, joints: Sequence[RobotJoint]) -> Iterator[str]:
    """Notes on joints without limits that turn by more than half a turn at once.

    Measured angles are often kept within half a turn either way, and jump by a whole.
    """
    for k, joint in enumerate(joints if len(q) > 1 else ()):
        steps = np.abs(np.diff(q[:, k]))
        jumps = np.flatnonzero(steps > np.pi)
        if not joint.turns or np.isfinite([joint.lower, joint.upper]).any():
            continue
        if len(jumps):
            row, turn = int(jumps[0]), np.degrees(steps[jumps[0]])
            first = f", the first of {len(jumps)} such turns" if len(jumps) > 1 else ""
            yield (
                f"joint {joint.name!r} turns by {turn:.0f}° between waypoints {row} "
                f"and {row + 1}{first}: judged as it stands, the long way round; "
                "unwrap it if the robot takes the short way"
            )


def joint_path(file: File, motion: JointTrajectory) -> "Path":
    """The pieces through some waypoints.

    Raises:
        InvalidFile: If times do not rise, or a piece is not finite.
    """
    _check_times(file, motion.times)
    try:
        return motion.path
    except ValueError as error:
        raise InvalidFile(file=file, fault=str(error)) from None


def _check_times(file: File, times: FloatArray | None) -> None:
    """Refuse times that do not rise from row to row; names the first that does not."""
    rises = np.array([]) if times is None else np.diff(times) > 0.0
    if times is None or rises.all():
        return
    row = int(np.argmin(rises)) + 1
    fault = f"time is {times[row]:.12g} s after {times[row - 1]:.12g} s, expected it "
    fault += "to rise from row to row"
    where = f"points[{row}]" if _has_points(file) else f"line {row + 2}"
    raise InvalidFile(file=file, where=where, fault=fault)


def _has_points(file: File) -> bool:
    """Whether waypoints are points of a message, and no rows of a table."""
    return is_bag(file) or file.suffix.lower() in ENDINGS


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
        if part != "yaw" and not (np.abs(motion.q[:, k]) <= TOLERANCES.still).all():
            fault = f"joint {joint!r} is planar, expected {part} 0"
            raise InvalidFile(file=file, fault=fault)
        if part == "yaw":
            names[k] = f"{joint}/theta"
    missing = [joint.name for joint in joints if joint.name not in names]
    if missing:
        fault = f"has no joint {missing[0]!r}; state its value with --lock"
        raise InvalidFile(file=file, where="joint_names", fault=fault)
    wanted = [joint.name for joint in joints]
    return replace(motion, names=tuple(names)).of(wanted)


def _check_units(file: File, q: FloatArray, joints: Sequence[RobotJoint]) -> None:
    """Refuse degrees under the name of radians, millimetres under that of metres."""
    for k, joint in enumerate(joints):
        most = float(np.abs(q[:, k]).max())
        if most <= joint.most_unstated:
            continue
        does, other, ending = ("turns", "degrees", "_deg, for any number of turns,")
        limits = (
            "" if joint.farthest else ", at most two turns either way without limits"
        )
        expected = f"radians{limits}"
        if not joint.turns:
            does, other, ending = "slides", "millimetres", "_mm"
            expected = f"metres, with limits of {joint.lower:g} to {joint.upper:g}"
        table = "" if _has_points(file) else f"{ending} or "
        fault = (
            f"joint {joint.name!r} {does} to {most:.4g} {joint.unit} at waypoint "
            f"{np.argmax(np.abs(q[:, k]))}; is it in {other}? "
            f"expected {table}{expected}"
        )
        raise InvalidFile(file=file, fault=fault)
