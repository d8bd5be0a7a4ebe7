"""A robot among its obstacles: from files named one by one, or from a problem file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from math import inf
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, frozen, rotation_from_rpy
from vdsm_pin.io.body_schema import MAX_PARTS
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.motion_schema import MovableModel
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.problem_errors import first_error
from vdsm_pin.io.problem_file import files_of_obstacles
from vdsm_pin.io.problem_schema import BasePoseModel, not_bool
from vdsm_pin.io.schema_types import FileModel, Name, NotNegative, Number
from vdsm_pin.io.source import read_text
from vdsm_pin.io.yaml_reader import read_yaml
from vdsm_pin.problem.planning_problem import ProblemSource
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.bodies import Body, Pair
from vdsm_pin.proof.terms import WORLD
from vdsm_pin.robots.coal_pairs import CoalPairs
from vdsm_pin.robots.link_solids import HULLS, PARTS, MeshCover, Solids
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.scene_files import (
    MAX_BYTES,
    SceneModel,
    check_judged,
    read_scene_with_files,
)
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.units import MM_PER_M


@dataclass(frozen=True, eq=False)
class Cell:
    """A robot among its obstacles, and what its motions are held to.

    Args:
        robot: The robot.
        scene: Obstacles in its base frame.
        required_clearance: Least clearance from obstacles; [m].
        required_self_clearance: Least clearance between links that are held apart; [m].
        stated_name: Of the problem; empty for the robot's.
        T_world_base: The robot's root link in the frame of the files, (4, 4); [m].
        source: The files it was read from; None for none.

    Raises:
        InvalidInput: If a clearance is negative or not finite.
    """

    robot: Robot
    scene: Scene
    required_clearance: float = 0.0
    required_self_clearance: float = 0.0
    stated_name: str = ""
    T_world_base: FloatArray = field(default_factory=lambda: np.eye(4))
    source: ProblemSource | None = None

    def __post_init__(self) -> None:
        """Check the clearances."""
        for value in (self.required_clearance, self.required_self_clearance):
            if not 0.0 <= value < inf:
                millimetres = value * MM_PER_M
                message = (
                    f"required clearance is {millimetres:g} mm, expected 0 or more"
                )
                raise InvalidInput(message)

    @property
    def name(self) -> str:
        """Of the problem, or of the robot."""
        return self.stated_name or self.robot.name

    @property
    def files(self) -> tuple[Path, ...]:
        """What it was read from, the robot or the problem first."""
        return () if self.source is None else self.source.files

    @cached_property
    def bodies(self) -> list[Body]:
        """Links first, then obstacles."""
        resting = (Body(WORLD, o.pieces, o.name) for o in self.scene.obstacles)
        return [*self.robot.bodies, *resting]

    @cached_property
    def pairs(self) -> list[Pair]:
        """All that are held apart; the obstacle first, which may have many pieces."""
        n = len(self.robot.bodies)
        outer = range(n, len(self.bodies))
        required = self.required_clearance
        pairs = [Pair(k, b, required) for k in outer for b in range(n)]
        own = self.required_self_clearance
        return pairs + [Pair(i, k, own) for i, k in self.robot.held]

    @cached_property
    def coal(self) -> CoalPairs:
        """Coal's distances of them."""
        return CoalPairs(self.robot, self.scene)

    def names(self, pair: Pair) -> str:
        """Both bodies of a pair in words, a link first."""
        one, other = self.bodies[pair.one], self.bodies[pair.other]
        if one.frame == WORLD:
            one, other = other, one
        return f"{one.name} and {other.name}"


@dataclass(frozen=True)
class RobotFiles:
    """A robot, by files and what is said of them; as `read_robot` takes it.

    Args:
        urdf: The robot.
        srdf: Pairs that are not held apart; None: neighbours are not.
        package_dirs: Where `package://` is looked for.
        lock: Joints that stand still; [rad] or [m].
        group: Of the SRDF, whose joints alone move.
        solids: What stands for the meshes of links.
        joint_limits: A joint_limits.yaml.
    """

    urdf: Path
    srdf: Path | None = None
    package_dirs: tuple[Path, ...] = ()
    lock: Mapping[str, float] = field(default_factory=dict)
    group: str | None = None
    solids: Solids = HULLS
    joint_limits: Path | None = None

    @property
    def files(self) -> tuple[Path, ...]:
        """Those that it is read from, the URDF first."""
        return (self.urdf, *filter(None, (self.srdf, self.joint_limits)))

    def read(self) -> Robot:
        """The robot.

        Raises:
            InvalidInput: If a file is bad or a value makes no sense.
        """
        return read_robot(
            self.urdf,
            self.srdf,
            self.package_dirs,
            self.lock,
            self.group,
            self.solids,
            self.joint_limits,
        )


def cell_of(
    files: RobotFiles,
    scene: Path | None = None,
    required: float = 0.0,
    required_self: float = 0.0,
) -> Cell:
    """The cell of files that are named one by one.

    Args:
        files: Of the robot.
        scene: The obstacles; None for none.
        required: Least clearance from obstacles; [m].
        required_self: Least clearance between links; [m].

    Raises:
        InvalidInput: If a file is bad or a value makes no sense.
    """
    robot = files.read()
    named = (*files.files, *robot.meshes)
    if scene is None:
        source = _source(named, ())
        return Cell(robot, Scene(), required, required_self, source=source)
    solids, of_files = read_scene_with_files(scene, _size(robot))
    source = _source((*named, scene), of_files)
    return Cell(robot, solids, required, required_self, source=source)


def solids_of(bodies: MeshCover | None, parts: int | None) -> Solids:
    """What stands for meshes; a number of parts alone asks for parts.

    Raises:
        InvalidInput: If a number is given beside another cover.
    """
    cover = bodies or ("hull" if parts is None else "parts")
    if parts is not None and cover != "parts":
        message = f"parts is {parts} beside bodies {cover!r}, expected bodies 'parts'"
        raise InvalidInput(message)
    return Solids(cover, parts or PARTS)


class RobotModel(FileModel):
    """A robot by its URDF."""

    urdf: str = Field(description="File, relative to this one.")
    srdf: str | None = Field(
        default=None,
        description="File with the pairs of links that are not held apart. Default: "
        "links joined by one joint are not.",
    )
    package_dirs: list[str] = Field(
        default=[], description="Folders where package:// is looked for."
    )
    lock: dict[str, Number] = Field(
        default={}, description="Joints that stand still, in the URDF's units [rad, m]."
    )
    group: str | None = Field(
        default=None,
        description="Group of the SRDF whose joints a trajectory moves; the others "
        "stand where lock says, or at 0. Default: all move that are not locked.",
    )
    bodies: MeshCover | None = Field(
        default=None,
        description="What stands for the mesh of a link: its hull, hulls of parts of "
        "it, or a ball, capsule or box around it (primitives). Default: hull.",
    )
    parts: int | None = Field(
        default=None, ge=1, le=MAX_PARTS, description="Hulls of one mesh, with parts."
    )
    joint_limits: str | None = Field(
        default=None, description="A joint_limits.yaml of MoveIt; the stricter counts."
    )

    def files(self, folder: Path) -> RobotFiles:
        """The files that it names in a folder."""
        optional = (self.srdf, self.joint_limits)
        srdf, limits = (None if name is None else folder / name for name in optional)
        return RobotFiles(
            folder / self.urdf,
            srdf,
            tuple(folder / name for name in self.package_dirs),
            self.lock,
            self.group,
            solids_of(self.bodies, self.parts),
            limits,
        )


class CellModel(SceneModel):
    """What a motion of a robot is held to."""

    vdsm_problem: Annotated[Literal[1], BeforeValidator(not_bool)] = Field(
        description="Version of this format."
    )
    name: Name | None = Field(default=None, description="Default: the robot's.")
    robot: RobotModel = Field(description="In place of a manipulator.")
    base: BasePoseModel = Field(
        default=BasePoseModel(),
        description="Where the root link is. Default: at the origin.",
    )
    obstacles: list[MovableModel] = Field(default=[], description="Solids to avoid.")
    required_clearance: NotNegative = Field(
        description="Between the surfaces of links and obstacles [length_unit]."
    )
    required_self_clearance: NotNegative = Field(
        default=0.0, description="Between links that are held apart [length_unit]."
    )


def read_cell(path: Path) -> Cell:
    """The cell of a problem file with `robot` in place of `manipulator`.

    Raises:
        InvalidFile: If the file or one that it names breaks its contract.
    """
    document = read_yaml(read_text(path, limit=MAX_BYTES), file=path)
    try:
        model = CellModel.model_validate(document.data)
    except ValidationError as error:
        raise first_error(error, document) from None
    folder = path.parent
    robot_files = model.robot.files(folder)
    robot = robot_files.read()
    rotation = rotation_from_rpy(np.radians(model.base.rpy_deg))
    frame = Frame(model.length_unit, rotation, np.array(model.base.position))
    builder = ObstacleBuilder(document, folder, frame, _size(robot), sha256())
    scene = Scene(builder.build_all(model.obstacles, ("obstacles",)))
    check_judged(document, scene)
    required = float(frame.metres(model.required_clearance))
    required_self = float(frame.metres(model.required_self_clearance))
    of_files = files_of_obstacles(model.obstacles, folder)
    files = (path, *robot_files.files, *robot.meshes)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, frame.metres(model.base.position)
    return Cell(
        robot=robot,
        scene=scene,
        required_clearance=required,
        required_self_clearance=required_self,
        stated_name=model.name or "",
        T_world_base=frozen(pose),
        source=_source(files, of_files),
    )


def _source(
    files: tuple[Path, ...], of_obstacles: tuple[tuple[str, Path], ...]
) -> ProblemSource:
    """The files that a cell was read from, the robot or the problem first."""
    read, digest = (*files, *(file for _, file in of_obstacles)), sha256()
    for file in read:
        digest.update(file.read_bytes())
    return ProblemSource(read[0], digest.hexdigest(), read[1:], of_obstacles)


def locks(words: tuple[str, ...]) -> dict[str, float]:
    """Values of joints by NAME=VALUE; [rad] or [m].

    Raises:
        InvalidInput: If one is of another form.
    """
    found = {}
    for word in words:
        name, _, value = word.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            found[name] = np.nan
        if not name or not np.isfinite(found[name]):
            message = f"--lock is {word!r}, expected JOINT=VALUE in radians or metres"
            raise InvalidInput(message)
    return found


def _size(robot: Robot) -> float:
    """How far the robot reaches at most, roughly; [m]."""
    shifts = [np.linalg.norm(joint.placement[:3, 3]) for joint in robot.tree.joints]
    return float(sum(shifts)) or 1.0
