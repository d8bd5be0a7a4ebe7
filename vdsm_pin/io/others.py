"""Other arms and robots of a problem: obstacles that move by trajectories of their own.

Robots of a URDF are read by a function that is passed in: verifier and checker have
each their own.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

from numpy import eye

from vdsm_pin.arm.kinematics import RAIL, arm_tree, link_frame
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.io.arm_builder import ArmBuilder
from vdsm_pin.io.frames import Builder
from vdsm_pin.io.problem_errors import ErrorCollector
from vdsm_pin.io.problem_schema import OtherModel, RobotModel
from vdsm_pin.io.source import check_is_file_or_bag, read_bytes
from vdsm_pin.io.tables import as_text
from vdsm_pin.io.trajectory_file import read_trajectory_text
from vdsm_pin.io.yaml_reader import Location
from vdsm_pin.problem.scene import ByItself, Carrier, Moving
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.tree import Tree

MAX_BYTES: Final = 1 << 30
"""Of a file of another arm or robot."""

HELD: Final = (
    "{}: is judged by its limits and its clearance from what is judged here alone: "
    "clearances between its own links and from obstacles are not judged"
)


@dataclass(frozen=True)
class OtherFile:
    """Another robot of a problem, by files.

    Args:
        name: Of the robot here.
        model: What the problem says of it.
        folder: Where its files are.
        trajectory: Its motion.
        topic: Of a bag.
        pose: T_base_root: its root link as seen from this base, (4, 4); [m].
    """

    name: str
    model: RobotModel
    folder: Path
    trajectory: Path
    topic: str | None
    pose: FloatArray


class Others(NamedTuple):
    """Other arms and robots as they were read.

    Args:
        bodies: Theirs, as obstacles.
        files: What they were read from, in the order in which hashes take them.
        timed: Whether their trajectories have times.
        contents: What files held that were read here.
    """

    bodies: tuple[Moving, ...] = ()
    files: tuple[Path, ...] = ()
    timed: bool = True
    contents: Mapping[Path, bytes] = {}


ReadRobot: TypeAlias = Callable[[OtherFile], Others]


@dataclass(frozen=True)
class OtherReader(Builder):
    """Reads the other arms and robots of one file.

    Args:
        read_robot: Reads robots of a URDF; None where nobody does.
    """

    read_robot: ReadRobot | None

    def read(self, models: Sequence[OtherModel]) -> Others:
        """The bodies of all of them, in the order of the file.

        Raises:
            InvalidFile: If one or its trajectory breaks its contract.
        """
        bodies, files = list[Moving](), list[Path]()
        contents: dict[Path, bytes] = {}
        errors = ErrorCollector()
        for i, model in enumerate(models):
            found = errors.attempt(self._timed, model, ("others", i))
            if found is None:
                continue
            bodies, files = [*bodies, *found.bodies], [*files, *found.files]
            contents |= found.contents
        errors.raise_if_any()
        return Others(tuple(bodies), tuple(files), contents=contents)

    def _timed(self, model: OtherModel, at: Location) -> Others:
        found = self._one(model, at)
        if not found.timed:
            fault = f"{model.trajectory!r} has no times, which it needs: time_s"
            raise self.document.invalid((*at, "trajectory"), fault)
        return found

    def _one(self, model: OtherModel, at: Location) -> Others:
        folder, where, pose = self.reading.folder, (*at, "trajectory"), eye(4)
        file = folder / model.trajectory
        pose[:3, :3] = self.frame.orientation(model.base.rpy_deg)
        pose[:3, 3] = self.frame.point(model.base.position)
        try:
            check_is_file_or_bag(file)
        except InvalidFile as error:
            raise self.document.invalid_file(where, model.trajectory, error) from None
        if model.manipulator is None and model.robot is not None:
            if self.read_robot is None:
                fault = "is of a URDF, which is not read here"
                raise self.document.invalid((*at, "robot"), fault)
            other = OtherFile(
                name=model.name,
                model=model.robot,
                folder=folder,
                trajectory=file,
                topic=model.topic,
                pose=frozen(pose),
            )
            return self.read_robot(other)
        if model.manipulator is None or model.robot is not None:
            fault = "has both or none of manipulator and robot, expected one of them"
            raise self.document.invalid(at, fault)
        if model.topic is not None:
            fault = f"is {model.topic!r}, but trajectories of snake arms are no bags"
            raise self.document.invalid((*at, "topic"), fault)
        # What it reads is handed on with the trajectory: `build_problem` hashes it.
        reading = replace(self.reading, digest=sha256(), files=[])
        arm = ArmBuilder(reading, (*at, "manipulator")).build(model.manipulator)
        try:
            content = read_bytes(file, limit=MAX_BYTES)
            motion = read_trajectory_text(
                file, as_text(BytesIO(content)), arm, places=False
            )
        except InvalidFile as error:
            raise self.document.invalid_file(where, model.trajectory, error) from None
        bodies = tuple(_bodies(model.name, arm, motion, pose))
        timed = motion.times is not None
        return Others(bodies, (*reading.files, file), timed, {file: content})


def _bodies(
    name: str, arm: Manipulator, motion: Trajectory, pose: FloatArray
) -> Iterator[Moving]:
    """Those of a snake arm whose rail stands at a pose, T_base_other, (4, 4); [m]."""
    joints = list(arm_tree(arm).joints)
    joints[RAIL] = replace(joints[RAIL], placement=pose)
    itself = ByItself((HELD.format(name),), arm=(arm, motion))
    carrier = Carrier(Tree(tuple(joints)), motion.path, name, itself)
    for link, solid in (*arm.rods, *arm.carried):
        named = replace(solid, name=f"{name}: {solid.name}")
        yield Moving(named, carrier, link_frame(link))
