"""The problem file as pydantic models: names, types, ranges, and what they mean.

This is the contract with users and the source of the JSON Schema for editors. Lengths
are in the file's `length_unit`, angles in degrees; `problem_builder.py` converts.
A robot is named by its URDF and what is said of it.
"""

from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field

from vdsm_pin.arm.manipulator import MAX_LINKS
from vdsm_pin.geometry.arrays import rotation_from_rpy
from vdsm_pin.io.arm_schema import MAX_PARTS, ManipulatorField
from vdsm_pin.io.errors_field import ErrorsModel
from vdsm_pin.io.frames import Frame, radians
from vdsm_pin.io.motion_field import MovableModel
from vdsm_pin.io.path_schema import TipPathModel
from vdsm_pin.io.posture_field import GoalModel, Start
from vdsm_pin.io.schema_types import (
    FileModel,
    FileName,
    Name,
    NotNegative,
    Number,
    Positive,
    Range,
    Vector,
)

XacroValue: TypeAlias = bool | int | float | str

CoverKind: TypeAlias = Literal["hull", "parts", "primitives"]


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
    xacro_args: dict[str, XacroValue] = Field(
        default={}, description="What $(arg NAME) stands for in a xacro file."
    )


def not_bool(value: Any) -> Any:
    """True equals 1 in Python; in a file it is another value."""
    return str(value).lower() if isinstance(value, bool) else value


class BasePoseModel(FileModel):
    """Where the rail is: the base frame in the frame of this file."""

    position: Vector = Field(
        default=[0.0, 0.0, 0.0], description="Origin of the rail [length_unit]."
    )
    rpy_deg: Vector = Field(
        default=[0.0, 0.0, 0.0],
        description="Roll, pitch, yaw of the base, R = Rz Ry Rx [deg].",
    )


class OtherModel(FileModel):
    """Another snake arm or robot, which moves as its own trajectory says."""

    name: Name = Field(
        description="Its bodies are `NAME: link 1` and so on, or `NAME: LINK`, in "
        "results and errors."
    )
    manipulator: ManipulatorField | None = Field(
        default=None,
        description="Of a snake arm: the name of a built-in one, or one of its own.",
    )
    robot: RobotModel | None = Field(
        default=None, description="Of any other robot, in place of manipulator."
    )
    base: BasePoseModel = Field(
        default=BasePoseModel(),
        description="Where its rail or root link is, in the frame of this file. "
        "Default: at the origin.",
    )
    trajectory: FileName = Field(
        description="Its trajectory, with times, relative to this file."
    )
    topic: str | None = Field(
        default=None, description="Of a bag, where it has several: NAME or NAME#K."
    )


class RatiosModel(FileModel):
    """What takes the place of constant ratios about the rail, one of the three."""

    values: Annotated[list[Number], Field(max_length=MAX_LINKS)] | None = Field(
        default=None, description="k_2 to k_N in P_i = k_i T, with the tip's T [-]."
    )
    scaling_centre: Range | None = Field(
        default=None,
        description="y and z in the base's frame over which `joint` stays while the "
        "path is drawn; joints after it are scaled about it [length_unit].",
    )
    joint: int | None = Field(
        default=None, ge=2, description="Joint of the scaling centre, 2 to N."
    )
    cylinder_radius: Positive | None = Field(
        default=None,
        description="Of the cylinder onto which points are projected along x, and on "
        "which they are scaled [length_unit].",
    )
    cylinder_axis: Literal["y", "z"] = Field(
        default="z", description="Axis of the base along which it touches x = 0."
    )


class AnyProblemModel(FileModel):
    """What problems of snake arms and of other robots have in common."""

    vdsm_problem: Annotated[Literal[1], BeforeValidator(not_bool)] = Field(
        description="Version of this format."
    )
    name: Name | None = Field(
        default=None, description="Name for reports. Default: the file's or robot's."
    )
    length_unit: Literal["mm", "m"] = Field(
        description="Unit of every length in this file. Angles are in degrees."
    )
    base: BasePoseModel = Field(
        default=BasePoseModel(),
        description="Where the rail or root link is. Default: at the origin.",
    )
    obstacles: list[MovableModel] = Field(default=[], description="Solids to avoid.")
    others: list[OtherModel] = Field(
        default=[],
        description="Other snake arms and robots: each link is an obstacle that "
        "moves. Trajectories then need times.",
    )
    errors: ErrorsModel = Field(
        default=ErrorsModel(),
        description="Every clearance is asked for under them. Default: none.",
    )
    required_clearance: NotNegative = Field(
        description="Between the surfaces of links and obstacles [length_unit]."
    )
    required_self_clearance: NotNegative = Field(
        default=0.0,
        description="Between the surfaces of links that are not neighbours, or that "
        "are held apart [length_unit].",
    )

    @property
    def frame(self) -> Frame:
        """The unit of the file and where the base is."""
        rotation = rotation_from_rpy(radians(self.base.rpy_deg))
        return Frame(self.length_unit, rotation, np.array(self.base.position))


class ProblemModel(AnyProblemModel):
    """A planning problem for a hyper-redundant manipulator."""

    manipulator: ManipulatorField = Field(
        description="Name of a built-in arm (hrm8), or an arm of your own."
    )
    tip_path: TipPathModel | None = Field(
        default=None,
        description="What the tip shall draw. Default: nothing; then clearance, "
        "limits, start and goal are asked for, no more.",
    )
    start: Start | None = Field(
        default=None,
        description="Without tip_path: where the motion begins, as tip_path.start. "
        "Default: anywhere.",
    )
    goal: GoalModel | None = Field(
        default=None,
        description="Without tip_path: where the motion ends, {tip: [x, y, z]} "
        "[length_unit] or {joints: ...}. Default: anywhere.",
    )
    ratios: RatiosModel | None = Field(
        default=None,
        description="How strategy `paper` scales the path to the joints. Default: in "
        "the ratios of the arm's lengths, about the rail.",
    )
    tip_tolerance: Positive | None = Field(
        default=None,
        description="How far the tip may be off its start, its goal and, at waypoints, "
        "the desired path [length_unit]. Default: 1 um.",
    )
    max_change_per_row_deg: Positive | None = Field(
        default=None,
        description="Largest change of a joint angle from row to row [deg]. Default: "
        "not asked for; plans keep 5.",
    )
