"""What a robot and its cell are read from: the problem file, and which files it names.

Nothing of geometry is worked out here; whoever reads a robot by itself begins here.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias, get_args

from pydantic import Field

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.arm_schema import MAX_PARTS
from vdsm_pin.io.frames import Frame, Reading
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.others import OtherReader, ReadRobot
from vdsm_pin.io.problem_builder import joined
from vdsm_pin.io.problem_errors import ErrorCollector, checked
from vdsm_pin.io.problem_file import ProblemDocument, files_of_obstacles
from vdsm_pin.io.problem_schema import (
    AnyProblemModel,
    CoverKind,
    RobotModel,
    XacroValue,
)
from vdsm_pin.io.source import add_file, path_of
from vdsm_pin.io.yaml_reader import YamlDocument
from vdsm_pin.problem.any_problem import ProblemSource
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene
from vdsm_pin.robots.scene_files import read_scene_with_files

Named: TypeAlias = tuple[tuple[str, Path], ...]
"""Names of obstacles that have a file of their own, with it."""

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

    Example:
        >>> vp.MeshCover("parts", 4).parts
        4
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
        name: As the URDF has it: from its folder, or `package://NAME/REST`.
        urdf: The URDF.
        package_dirs: Where packages are looked for first, other names after its folder.
    """
    beside = urdf.resolve().parent
    if not name.startswith(("package://", "model://")):
        plain = name.removeprefix("file://")
        places = [folder / plain for folder in (beside, *package_dirs)]
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
        urdf: The URDF, or a xacro file.
        srdf: Its SRDF, for the pairs of links that are not held apart, its groups and a
            planar or floating base; None: neighbours are not held apart.
        package_dirs: Where `package://NAME/REST` is looked for, as NAME/REST or REST;
            then beside the URDF and above it. Other names are looked for beside it
            first, then there.
        lock: Values of joints that stand still; [rad] or [m].
        group: Of the SRDF: its joints alone move, others stand where `lock` says or
            at 0. None: all move that are not locked.
        solids: What stands for the meshes of links.
        joint_limits: A joint_limits.yaml of MoveIt; the stricter limit counts.
        xacro_args: What `$(arg NAME)` stands for in a xacro file.

    Example:
        >>> vp.RobotFiles("robot.urdf", "robot.srdf", group="arm").group
        'arm'
    """

    urdf: Path
    srdf: Path | None = None
    package_dirs: tuple[Path, ...] = ()
    lock: Mapping[str, float] = field(default_factory=dict)
    group: str | None = None
    solids: MeshCover = HULLS
    joint_limits: Path | None = None
    xacro_args: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Take names of files for their paths."""
        for name in ("urdf", "srdf", "joint_limits"):
            if (file := getattr(self, name)) is not None or name == "urdf":
                object.__setattr__(self, name, path_of(file))
        folders = tuple(map(path_of, self.package_dirs))
        object.__setattr__(self, "package_dirs", folders)

    @property
    def files(self) -> tuple[Path, ...]:
        """Those that it is read from, the URDF first."""
        return (self.urdf, *filter(None, (self.srdf, self.joint_limits)))


def files_of_robot(model: RobotModel, folder: Path) -> RobotFiles:
    """The files that a robot of a problem names in its folder."""
    optional = (model.srdf, model.joint_limits)
    srdf, limits = (None if name is None else folder / name for name in optional)
    return RobotFiles(
        folder / model.urdf,
        srdf,
        tuple(folder / name for name in model.package_dirs),
        model.lock,
        model.group,
        solids_of(model.bodies, model.parts),
        limits,
        {name: _word(value) for name, value in model.xacro_args.items()},
    )


def _word(value: XacroValue) -> str:
    """The value of an argument as xacro writes it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


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


class CellModel(AnyProblemModel):
    """What a motion of a robot is held to."""

    robot: RobotModel = Field(description="In place of a manipulator.")
    scene: str | None = Field(
        default=None,
        description="File of more obstacles, in the frame of the root link: YAML with "
        "obstacles, a PlanningScene of MoveIt, or a world in MJCF.",
    )


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
        return files_of_robot(self.model.robot, self.path.parent)

    @cached_property
    def frame(self) -> Frame:
        """Unit of the file and pose of the root link."""
        return self.model.frame

    @property
    def required(self) -> tuple[float, float]:
        """Least clearance from obstacles, and between links; [m]."""
        asked = self.model.required_clearance, self.model.required_self_clearance
        return float(self.frame.metres(asked[0])), float(self.frame.metres(asked[1]))

    def scene(
        self, robot_size: float | None, links: Collection[str], read_robot: ReadRobot
    ) -> "CellScene":
        """The obstacles in the robot's base frame, bodies of other robots the last.

        Args:
            robot_size: For judging the size of a mesh; None where nobody knows; [m].
            links: Of the robot, besides the root link.
            read_robot: Reads the other robots.

        Raises:
            InvalidFile: If one breaks its contract, or is of a kind that is not judged.
        """
        folder, model, files = self.path.parent, self.model, list[Path]()
        reading = Reading(self.document, self.frame, folder, sha256())
        builder = ObstacleBuilder(reading, robot_size)
        errors = ErrorCollector()
        solids = errors.attempt(builder.build_all, model.obstacles, ("obstacles",))
        found = errors.attempt(OtherReader(reading, read_robot).read, model.others)
        named = files_of_obstacles(self.model.obstacles, folder)
        more: tuple[Scene, Named] | None = Scene(), ()
        if self.model.scene is not None and robot_size is not None:
            files.append(folder / self.model.scene)
            size = robot_size
            more = errors.attempt(read_scene_with_files, files[0], size, links)
        errors.raise_if_any()
        assert solids is not None and found and more  # what is None was raised
        scene = joined(Scene(solids), more[0].obstacles, self.document, "scene")
        scene, named = joined(scene, found.bodies, self.document), (*named, *more[1])
        return CellScene(scene, (*files, *found.files), named)

    def errors(self, scene: Scene) -> ErrorBox:
        """The errors under which every clearance is asked for.

        Raises:
            InvalidFile: If they name an obstacle that there is not.
        """
        return self.model.errors.box(self.frame.unit, scene, self.document)

    def source(self, of_links: Iterable[Path], scene: "CellScene") -> ProblemSource:
        """All files that it is read from, those of links and obstacles too."""
        files = (self.path, *self.robot.files, *of_links, *scene.files)
        return source_of(files, scene.of_obstacles)


class CellScene(NamedTuple):
    """What stands and moves around a robot, and the files that it is read from.

    Args:
        scene: The obstacles.
        files: The scene file, and those of other arms and robots.
        of_obstacles: Names of obstacles that have a file of their own, with it.
    """

    scene: Scene
    files: tuple[Path, ...]
    of_obstacles: Named


def cell_file(file: ProblemDocument) -> CellFile:
    """What a problem file with `robot` in place of `manipulator` states.

    Raises:
        InvalidFile: If the file breaks its contract.
    """
    path, document, data = file.path, file.yaml, file.yaml.data
    if isinstance(data, dict) and "manipulator" in data and "robot" not in data:
        fault = "is of a snake arm, which read_problem reads; expected robot"
        raise InvalidFile(file=path, where="manipulator", fault=fault)
    return CellFile(path, document, checked(document, CellModel))


def source_of(files: tuple[Path, ...], of_obstacles: Named) -> ProblemSource:
    """The files that a cell was read from, the robot or the problem first."""
    read, digest = (*files, *(file for _, file in of_obstacles)), sha256()
    for file in read:
        add_file(file, digest)
    return ProblemSource(read[0], digest.hexdigest(), read[1:], of_obstacles)
