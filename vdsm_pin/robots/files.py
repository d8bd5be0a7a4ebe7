"""What a robot and its cell are read from: the problem file, and which files it names.

Nothing of geometry is worked out here; whoever reads a robot by itself begins here.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias, get_args

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, frozen, rotation_from_rpy
from vdsm_pin.io.body_schema import MAX_PARTS
from vdsm_pin.io.errors_builder import build_errors
from vdsm_pin.io.errors_schema import ErrorsModel
from vdsm_pin.io.frames import Frame, radians
from vdsm_pin.io.motion_schema import MovableModel
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.problem_errors import first_error
from vdsm_pin.io.problem_file import files_of_obstacles
from vdsm_pin.io.problem_schema import BasePoseModel, not_bool
from vdsm_pin.io.schema_types import FileModel, FileName, Name, NotNegative, Number
from vdsm_pin.io.source import check_is_file_or_bag, files_in, read_text
from vdsm_pin.io.yaml_reader import YamlDocument, read_yaml
from vdsm_pin.problem.any_problem import ProblemSource
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene
from vdsm_pin.robots.scene_files import MAX_BYTES, SceneModel, read_scene_with_files

Named: TypeAlias = tuple[tuple[str, Path], ...]
"""Names of obstacles that have a file of their own, with it."""

CoverKind: TypeAlias = Literal["hull", "parts", "primitives"]

PARTS: Final = 8
"""Hulls that a mesh is covered by, where `parts` is asked for without a number."""


@dataclass(frozen=True)
class MeshCover:
    """What stands for the collision meshes of links; other shapes count as they are.

    Args:
        cover: `hull`: the convex hull of each mesh; `parts`: hulls of groups of its
            triangles; `primitives`: a ball, capsule or box that holds it.
        parts: Hulls of one mesh, 1 to 256.

    Raises:
        InvalidInput: If there is no such cover.
    """

    cover: CoverKind = "hull"
    parts: int = PARTS

    def __post_init__(self) -> None:
        """Refuse what is no cover."""
        if self.cover not in get_args(CoverKind):
            known = ", ".join(get_args(CoverKind))
            message = f"cover is {self.cover!r}, expected one of {known}"
            raise InvalidInput(message)
        if not 1 <= self.parts <= MAX_PARTS:
            message = f"parts is {self.parts}, expected 1 to {MAX_PARTS}"
            raise InvalidInput(message)

    @property
    def words(self) -> str:
        """For the record."""
        meshes = {
            "hull": "hulls of meshes",
            "parts": f"{self.parts} hulls of groups of triangles for each mesh",
            "primitives": "a ball, capsule or box around each mesh",
        }
        return f"{meshes[self.cover]}; boxes, cylinders, spheres, capsules as they are"


HULLS: Final = MeshCover()
"""The default."""


def find_mesh(name: str, urdf: Path, package_dirs: tuple[Path, ...]) -> Path | None:
    """The file of a mesh that a URDF names; None where there is none.

    Args:
        name: As the URDF has it: beside it, or `package://NAME/REST`.
        urdf: The URDF.
        package_dirs: Where packages are looked for first.
    """
    beside = urdf.resolve().parent
    if not name.startswith(("package://", "model://")):
        places = [beside / name.removeprefix("file://")]
    else:
        inner = Path(name.split("://", 1)[1])
        rest = Path(*inner.parts[1:])
        folders = [*package_dirs, beside, *beside.parents]
        places = [folder / part for folder in folders for part in (inner, rest)]
    for place in places:
        try:
            if place.is_file():
                return place
        except (OSError, ValueError):  # a name that no file can have
            break
    return None


@dataclass(frozen=True)
class RobotFiles:
    """A robot, by files and what is said of them.

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
    solids: MeshCover = HULLS
    joint_limits: Path | None = None

    def __post_init__(self) -> None:
        """Take names of files for their paths."""
        for name in ("urdf", "srdf", "joint_limits"):
            if (file := getattr(self, name)) is not None:
                object.__setattr__(self, name, Path(file))
        folders = tuple(map(Path, self.package_dirs))
        object.__setattr__(self, "package_dirs", folders)

    @property
    def files(self) -> tuple[Path, ...]:
        """Those that it is read from, the URDF first."""
        return (self.urdf, *filter(None, (self.srdf, self.joint_limits)))


def solids_of(bodies: CoverKind | None, parts: int | None) -> MeshCover:
    """What stands for meshes; a number of parts alone asks for parts.

    Raises:
        InvalidInput: If a number is given beside another cover.
    """
    cover = bodies or ("hull" if parts is None else "parts")
    if parts is not None and cover != "parts":
        message = f"parts is {parts} beside bodies {cover!r}, expected bodies 'parts'"
        raise InvalidInput(message)
    return MeshCover(cover, parts or PARTS)


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
    bodies: CoverKind | None = Field(
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


class OtherRobotModel(FileModel):
    """Another robot, which moves as its own trajectory says."""

    name: Name = Field(description="Its links are `NAME: LINK`, in results and errors.")
    robot: RobotModel = Field(description="As the one that is judged.")
    base: BasePoseModel = Field(
        default=BasePoseModel(),
        description="Where its root link is, in the frame of this file. Default: at "
        "the origin.",
    )
    trajectory: FileName = Field(
        description="Its trajectory, with times, relative to this file."
    )
    topic: str | None = Field(
        default=None, description="Of a bag, where it has several: NAME or NAME#K."
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
    scene: str | None = Field(
        default=None,
        description="File of more obstacles, in the frame of the root link: YAML with "
        "obstacles, a PlanningScene of MoveIt, or a world in MJCF.",
    )
    others: list[OtherRobotModel] = Field(
        default=[],
        description="Other robots: each link is an obstacle that moves. Trajectories "
        "then need times.",
    )
    required_clearance: NotNegative = Field(
        description="Between the surfaces of links and obstacles [length_unit]."
    )
    required_self_clearance: NotNegative = Field(
        default=0.0, description="Between links that are held apart [length_unit]."
    )
    errors: ErrorsModel = Field(
        default=ErrorsModel(),
        description="How far joints, base and obstacles may be off. Default: not at "
        "all.",
    )


@dataclass(frozen=True)
class OtherFile:
    """Another robot of a problem, by files.

    Args:
        name: Of the robot here.
        robot: Its files.
        trajectory: Its motion.
        topic: Of a bag.
        pose: T_base_root: its root link as seen from that of the robot, (4, 4); [m].
    """

    name: str
    robot: RobotFiles
    trajectory: Path
    topic: str | None
    pose: FloatArray


@dataclass(frozen=True)
class CellFile:
    """A problem file with `robot` in place of `manipulator`, as it was read.

    Args:
        path: The file.
        document: What it holds, for messages.
        model: The same, checked.
    """

    path: Path
    document: YamlDocument
    model: CellModel

    @cached_property
    def robot(self) -> RobotFiles:
        """The robot, by files."""
        return self.model.robot.files(self.path.parent)

    @cached_property
    def frame(self) -> Frame:
        """Unit of the file and pose of the root link."""
        base = self.model.base
        rotation = rotation_from_rpy(radians(base.rpy_deg))
        return Frame(self.model.length_unit, rotation, np.array(base.position))

    @cached_property
    def others(self) -> tuple[OtherFile, ...]:
        """The other robots, by files.

        Raises:
            InvalidFile: If there is no such trajectory.
        """
        folder, found = self.path.parent, []
        for i, model in enumerate(self.model.others):
            try:
                check_is_file_or_bag(folder / model.trajectory)
            except InvalidFile as error:
                at, name = ("others", i, "trajectory"), model.trajectory
                raise self.document.invalid_file(at, name, error) from None
            pose = np.eye(4)
            pose[:3, :3] = self.frame.orientation(model.base.rpy_deg)
            pose[:3, 3] = self.frame.point(model.base.position)
            robot, motion = model.robot.files(folder), folder / model.trajectory
            found.append(
                OtherFile(model.name, robot, motion, model.topic, frozen(pose))
            )
        return tuple(found)

    @property
    def required(self) -> tuple[float, float]:
        """Least clearance from obstacles, and between links; [m]."""
        asked = self.model.required_clearance, self.model.required_self_clearance
        return float(self.frame.metres(asked[0])), float(self.frame.metres(asked[1]))

    def scene(self, robot_size: float, links: Collection[str]) -> tuple[Scene, Named]:
        """The obstacles in the robot's base frame, and those with files of their own.

        Args:
            robot_size: For judging the size of a mesh; [m].
            links: Of the robot, besides the root link.

        Raises:
            InvalidFile: If one breaks its contract, or is of a kind that is not judged.
        """
        folder, frame = self.path.parent, self.frame
        builder = ObstacleBuilder(self.document, folder, frame, robot_size, sha256())
        own = builder.build_all(self.model.obstacles, ("obstacles",))
        named = files_of_obstacles(self.model.obstacles, folder)
        if self.model.scene is None:
            return Scene(own), named
        file = folder / self.model.scene
        more, files = read_scene_with_files(file, robot_size, links)
        try:
            return Scene((*own, *more.obstacles)), (*named, *files)
        except InvalidInput as error:
            raise self.document.invalid(("scene",), str(error)) from None

    def errors(self, scene: Scene, links: Collection[str] = ()) -> ErrorBox:
        """The errors under which every clearance is asked for.

        Args:
            scene: The obstacles.
            links: Names of more: links of other robots, where the scene lacks them.

        Raises:
            InvalidFile: If they name an obstacle that there is not.
        """
        model, frame = self.model.errors, self.frame
        return build_errors(model, frame, scene, self.document, links)

    def source(self, more: tuple[Path, ...], of_obstacles: Named) -> ProblemSource:
        """All files that it is read from, those of links and obstacles too."""
        names = filter(None, [self.model.scene])
        scene = (self.path.parent / name for name in names)
        others = ((*x.robot.files, *files_in(x.trajectory)) for x in self.others)
        named = (*more, *scene, *chain.from_iterable(others))
        return source_of((self.path, *self.robot.files, *named), of_obstacles)


def read_cell_file(path: Path) -> CellFile:
    """A problem file with `robot` in place of `manipulator`.

    Raises:
        InvalidFile: If the file breaks its contract.
    """
    document = read_yaml(read_text(path, limit=MAX_BYTES), file=path)
    try:
        return CellFile(path, document, CellModel.model_validate(document.data))
    except ValidationError as error:
        raise first_error(error, document, CellModel) from None


def source_of(files: tuple[Path, ...], of_obstacles: Named) -> ProblemSource:
    """The files that a cell was read from, the robot or the problem first."""
    read, digest = (*files, *(file for _, file in of_obstacles)), sha256()
    for file in read:
        digest.update(file.read_bytes())
    return ProblemSource(read[0], digest.hexdigest(), read[1:], of_obstacles)
