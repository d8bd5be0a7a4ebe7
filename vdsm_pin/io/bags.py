"""Trajectories in ROS 1 bags, ROS 2 bags and MCAP files, by rosbags (extra `bags`)."""

import struct
import zlib
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import CannotWrite, InvalidFile, InvalidInput
from vdsm_pin.io.places import Place
from vdsm_pin.io.source import naming_file
from vdsm_pin.io.trajectory_messages import message_of, of_message
from vdsm_pin.problem.joint_trajectory import JointTrajectory

ENDINGS: Final = (".bag", ".mcap", ".db3")
PLANS: Final = (
    "trajectory_msgs/msg/JointTrajectory",
    "moveit_msgs/msg/RobotTrajectory",
    "moveit_msgs/msg/DisplayTrajectory",
    "control_msgs/msg/FollowJointTrajectoryGoal",
    "control_msgs/msg/FollowJointTrajectoryActionGoal",
)
"""Types of which one message is a trajectory."""

STATES: Final = "sensor_msgs/msg/JointState"
"""Of this type each message is a waypoint."""

LARGEST: Final = 4 << 30
"""Largest bag; [bytes]."""

MOST: Final = 10_000_000
"""Messages of a topic that are read."""

TOPIC: Final = "/joint_trajectory"

MAGIC: Final = b"\x89MCAP0\r\n"
"""An MCAP file begins and ends with it; between are records: kind, size, content."""

RECORD, CHUNK = 9, 6
"""Size of a record's head [bytes]; the kind of those that hold messages."""


def is_bag(file: Path) -> bool:
    """Whether a path names a bag: by its ending, or a folder with a metadata.yaml."""
    return file.suffix.lower() in ENDINGS or (file / "metadata.yaml").is_file()


def check_topic(file: Path, topic: str | None) -> None:
    """Refuse the topic of what is no bag.

    Raises:
        InvalidFile: If one is named.
    """
    if topic is not None and not is_bag(file):
        fault = f"is no bag, so topic {topic!r} has no meaning"
        raise InvalidFile(file=file, fault=fault)


def read_bag(file: Path, topic: str | None = None, most: int = 2) -> JointTrajectory:
    """The trajectory in a bag.

    Args:
        file: A ROS 1 bag, an MCAP or db3 file, or the folder of a ROS 2 bag.
        topic: Where it is, `NAME`, or `NAME#K` for its message K, from 0. None where
            there is only one.
        most: Derivatives that are read, as of `of_message`.

    Raises:
        InvalidFile: If it is not there, not the only one or damaged.
    """
    with naming_file(file):
        data = _read(file, topic)
    return of_message(Place.of(file, data), most)


def _read(file: Path, topic: str | None) -> Any:
    """The one message of a trajectory, in mappings, lists and numbers.

    Raises:
        InvalidInput: If it is not there, not the only one or damaged.
    """
    if find_spec("rosbags") is None:
        message = "bags need rosbags: pip install 'vdsm-pin[bags]'"
        raise InvalidInput(message)
    if not file.exists():
        message = "does not exist"
        raise InvalidInput(message)
    parts = [file] if file.is_file() else list(file.iterdir())
    if not sum(one.stat().st_size for one in parts) <= LARGEST:
        message = f"has more than the {LARGEST >> 30} GiB that are read of a bag"
        raise InvalidInput(message)
    try:
        return _chosen(*_messages(file, topic))
    except InvalidInput:
        raise
    except Exception as error:  # noqa: BLE001 (rosbags raises what it meets)
        said = " ".join(str(error).split())[:200] or type(error).__name__
        message = f"cannot be read by rosbags: {said}"
        raise InvalidInput(message) from None


def _messages(file: Path, topic: str | None) -> tuple[list[Any], str, str, str]:
    """Those of the topic, their type, its name, and which of them is asked for."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    name, _, number = (topic or "").partition("#")
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([file], default_typestore=store) as reader:
        found = [c for c in reader.connections if c.msgtype in (*PLANS, STATES)]
        wanted = [c for c in found if c.topic == name] if name else found
        topics = {c.topic for c in wanted}
        if len(topics) != 1:
            known = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in found}))
            what = f"has no trajectory under topic {name!r}" if name else "has several"
            message = "has no topic of trajectories"
            if found:
                message = f"{what}; topics: {known}; choose one by its topic"
            raise InvalidInput(message)
        if sum(one.msgcount for one in wanted) > MOST:
            message = f"has more than {MOST} messages under topic {topics.pop()}"
            raise InvalidInput(message)
        messages = [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages(connections=wanted)
        ]
    return messages, wanted[0].msgtype, topics.pop(), number


def _chosen(messages: list[Any], kind: str, topic: str, number: str) -> Any:
    """The trajectory in the messages of a topic."""
    if kind == STATES and messages:
        return _states(messages)
    if not (count := len(messages)):
        message = f"topic {topic} has no message"
        raise InvalidInput(message)
    if number and number not in map(str, range(count)):
        message = f"topic {topic} has messages 0 to {count - 1}, not {number!r}"
        raise InvalidInput(message)
    if count != 1 and not number:
        message = f"topic {topic} has {count} messages; choose by topic {topic}#K"
        raise InvalidInput(message)
    return _plain(messages[int(number or 0)])


def _plain(message: Any) -> Any:
    """A message in mappings, lists and numbers."""
    if isinstance(message, np.ndarray):
        return [_plain(one) for one in message.tolist()]
    if isinstance(message, list):
        return [_plain(one) for one in message]
    fields = getattr(message, "__dataclass_fields__", None)
    if fields is None:
        return message
    return {name: _plain(getattr(message, name)) for name in fields if name[0] != "_"}


def _states(messages: list[Any]) -> dict[str, Any]:
    """Measured states as waypoints, with times from the first."""
    points, names = [], list(messages[0].name)
    first = None
    for k, message in enumerate(messages):
        if sorted(message.name) != sorted(names) or len(message.position) != len(names):
            fault = (
                f"message {k}: has {len(message.position)} positions of "
                f"{message.name}, expected one of each of {names}"
            )
            raise InvalidInput(fault)
        stamp = message.header.stamp
        time = 1_000_000_000 * stamp.sec + stamp.nanosec  # [ns]
        first = time if first is None else first
        position = dict(zip(message.name, message.position.tolist(), strict=True))
        points.append(
            {
                "positions": [position[name] for name in names],
                "time_from_start": (time - first) / 1e9,
            }
        )
    return {"joint_names": names, "points": points}


def write_bag(motion: JointTrajectory, file: Path) -> None:
    """Write a JointTrajectory under the topic /joint_trajectory.

    Args:
        motion: What it holds.
        file: Its ending says what: `.bag` for ROS 1, `.mcap` for a file of ROS 2, none
            for the folder of a ROS 2 bag, with metadata.yaml and a .db3.

    Raises:
        InvalidInput: If rosbags is not installed, or times are no durations of ROS.
        CannotWrite: If the file system refuses.
    """
    if find_spec("rosbags") is None:
        what = file.suffix or "a ROS 2 bag"
        message = f"{what} needs rosbags: pip install 'vdsm-pin[bags]'"
        raise InvalidInput(message)
    from rosbags.typesys import Stores, get_typestore

    if file.suffix == ".bag":
        from rosbags.rosbag1 import Writer as Writer1

        store = get_typestore(Stores.ROS1_NOETIC)
        with Writer1(file) as writer:
            connection = writer.add_connection(TOPIC, PLANS[0], typestore=store)
            data = store.serialize_ros1(_typed(store, motion), PLANS[0])
            writer.write(connection, 0, data)
        return
    import sqlite3  # which few need

    try:
        _write_ros2(motion, file)
    except sqlite3.Error as error:
        raise CannotWrite(file=file, reason=str(error)) from error


def _write_ros2(motion: JointTrajectory, file: Path) -> None:
    """Write a MCAP file, or the folder of a ROS 2 bag where the name has no ending."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, whole = get_typestore(Stores.ROS2_HUMBLE), not file.suffix
    kind = StoragePlugin.SQLITE3 if whole else StoragePlugin.MCAP
    folder = file if whole else file.with_suffix(".parts")
    with Writer(folder, version=9, storage_plugin=kind) as two:
        connection = two.add_connection(TOPIC, PLANS[0], typestore=store)
        two.write(connection, 0, store.serialize_cdr(_typed(store, motion), PLANS[0]))
    if whole:
        return
    (written,) = folder.glob("*.mcap")
    written.write_bytes(_with_checksums(written.read_bytes()))
    written.replace(file)
    for left in folder.iterdir():
        left.unlink()
    folder.rmdir()


def _with_checksums(content: bytes) -> bytes:
    """An MCAP file with the checksum of each chunk: rosbags writes 0 and reads it."""
    found, at = bytearray(content), len(MAGIC)
    while at < len(content) - len(MAGIC):
        kind, size = struct.unpack_from("<BQ", content, at)
        at += RECORD
        if kind == CHUNK:
            (name,) = struct.unpack_from("<I", content, at + 28)  # of a compression: ""
            records = content[at + 40 + name : at + size]
            struct.pack_into("<I", found, at + 24, zlib.crc32(records))
        at += size
    return bytes(found)


def _typed(store: Any, motion: JointTrajectory) -> Any:
    """The JointTrajectory of a store of types."""
    types, message = store.types, message_of(motion)
    none = np.zeros(0)
    points = []
    for point in message["points"]:
        time = point.get("time_from_start", {"sec": 0, "nanosec": 0})
        values = [
            np.array(point.get(key, none))
            for key in ("positions", "velocities", "accelerations")
        ]
        when = types["builtin_interfaces/msg/Duration"](**time)
        kind = types["trajectory_msgs/msg/JointTrajectoryPoint"]
        points.append(kind(*values, none, when))
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = types["std_msgs/msg/Header"]
    fields = {"stamp": stamp, "frame_id": ""}
    if "seq" in header.__dataclass_fields__:
        fields["seq"] = 0
    return types[PLANS[0]](header(**fields), list(motion.names), points)
