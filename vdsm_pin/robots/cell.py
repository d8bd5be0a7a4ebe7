"""A robot among its obstacles: from files named one by one, or from a problem file."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import rotation_from_rpy
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.motion_schema import MovableModel
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.obstacle_schema import FromFileModel
from vdsm_pin.io.problem_errors import first_error
from vdsm_pin.io.problem_schema import BasePoseModel, not_bool
from vdsm_pin.io.schema_types import FileModel, Name, NotNegative, Number
from vdsm_pin.io.source import read_text
from vdsm_pin.io.yaml_reader import read_yaml
from vdsm_pin.problem.scene import Scene
from vdsm_pin.robots.judgement import Asked
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.scene_files import MAX_BYTES, SceneModel, check_judged, read_scene
from vdsm_pin.robots.urdf import read_robot


@dataclass(frozen=True)
class Cell:
    """What a motion of a robot is judged against.

    Args:
        asked: The robot, its obstacles, the clearances asked for.
        files: What it was read from, the robot or the problem first.
    """

    asked: Asked
    files: tuple[Path, ...]


def cell_of(
    urdf: Path,
    srdf: Path | None = None,
    scene: Path | None = None,
    package_dirs: tuple[Path, ...] = (),
    lock: tuple[str, ...] = (),
    required: float = 0.0,
    required_self: float = 0.0,
) -> Cell:
    """The cell of files that are named one by one.

    Args:
        urdf: The robot.
        srdf: Pairs that are not held apart; None: neighbours are not.
        scene: The obstacles; None for none.
        package_dirs: Where `package://` is looked for.
        lock: NAME=VALUE of joints that stand still; [rad] or [m].
        required: Least clearance from obstacles; [m].
        required_self: Least clearance between links; [m].

    Raises:
        InvalidInput: If a file is bad or a value makes no sense.
    """
    robot = read_robot(urdf, srdf, package_dirs, _locks(lock))
    solids = Scene() if scene is None else read_scene(scene, _size(robot))
    asked = Asked(robot, solids, required, required_self)
    return Cell(asked, (urdf, *filter(None, (srdf, scene))))


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
    folder, given = path.parent, model.robot
    urdf = folder / given.urdf
    srdf = None if given.srdf is None else folder / given.srdf
    dirs = tuple(folder / name for name in given.package_dirs)
    robot = read_robot(urdf, srdf, dirs, given.lock)
    rotation = rotation_from_rpy(np.radians(model.base.rpy_deg))
    frame = Frame(model.length_unit, rotation, np.array(model.base.position))
    builder = ObstacleBuilder(document, folder, frame, _size(robot), sha256())
    scene = Scene(builder.build_all(model.obstacles, ("obstacles",)))
    check_judged(document, scene)
    required = float(frame.metres(model.required_clearance))
    required_self = float(frame.metres(model.required_self_clearance))
    meshes = [one.file for one in model.obstacles if isinstance(one, FromFileModel)]
    files = (path, urdf, *filter(None, (srdf,)), *(folder / name for name in meshes))
    return Cell(Asked(robot, scene, required, required_self), files)


def _locks(words: tuple[str, ...]) -> dict[str, float]:
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
