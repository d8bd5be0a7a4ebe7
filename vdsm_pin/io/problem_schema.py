"""The problem file as pydantic models: names, types, ranges, and what they mean.

This is the contract with users and the source of the JSON Schema for editors. Lengths
are in the file's `length_unit`, angles in degrees; `problem_builder.py` converts.
"""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag

from vdsm_pin.arm.manipulator import MAX_LINKS
from vdsm_pin.io.body_schema import BodyModel
from vdsm_pin.io.motion_schema import MovableModel
from vdsm_pin.io.path_schema import PathPart
from vdsm_pin.io.schema_types import (
    FileModel,
    FileName,
    Name,
    NotNegative,
    Number,
    Positive,
    Range,
    Vector,
    text_or_not,
)

Radii: TypeAlias = Annotated[
    Annotated[Positive, Tag("one")]
    | Annotated[list[Positive], Field(min_length=2, max_length=MAX_LINKS), Tag("each")],
    Discriminator(lambda value: "each" if isinstance(value, list) else "one"),
]
"""One radius of all links, or one of each."""

Retreat: TypeAlias = Annotated[
    Annotated[Literal["home"], Tag("name")] | Annotated[NotNegative, Tag("value")],
    Discriminator(text_or_not),
]
"""A length, or the word home."""

Lengths: TypeAlias = Annotated[
    list[Positive], Field(min_length=2, max_length=MAX_LINKS)
]


def not_bool(value: Any) -> Any:
    """True equals 1 in Python; in a file it is another value."""
    return str(value).lower() if isinstance(value, bool) else value


def _kind_of_arm(value: Any) -> str:
    if isinstance(value, dict) and "urdf" in value:
        return "from urdf"
    return "from urdf" if hasattr(value, "urdf") else text_or_not(value)


def _list_or_not(value: Any) -> str:
    return "point" if isinstance(value, list) else "joint values"


class CablesModel(FileModel):
    """Where the driving cables run."""

    hole_radius: Positive = Field(
        description="Radius r of the circle of cable holes [length_unit]."
    )
    half_gap: Positive = Field(
        description="Distance d from a joint centre to the link's end face "
        "[length_unit]."
    )
    hole_angles_deg: Annotated[list[Vector], Field(max_length=MAX_LINKS)] | None = (
        Field(
            default=None,
            description="Position angles phi of the holes a, b, c of each link, N rows "
            "of 3 [deg]. Default: 3N holes evenly spaced, as in the paper.",
        )
    )


class ToolModel(FileModel):
    """A straight extension of the last link, a capsule about the same axis."""

    length: Positive = Field(
        description="From the end of the last link to the tip [length_unit]."
    )
    radius: Positive = Field(description="Of the capsule [length_unit].")


class FeedModel(FileModel):
    """What is behind the first joint: a capsule along the rail that moves with x0."""

    length: Positive = Field(
        description="From the first joint backwards [length_unit]."
    )
    radius: Positive | None = Field(
        default=None,
        description="Of the capsule [length_unit]. Default: that of link 1.",
    )


NamePair: TypeAlias = Annotated[list[Name], Field(min_length=2, max_length=2)]


class ManipulatorModel(FileModel):
    """An arm of N links on a rail along the x axis of its base."""

    name: Name = Field(default="custom", description="Name for reports.")
    link_lengths: Lengths = Field(
        description="L_1..L_N between joint centres, 2 to 40 of them [length_unit]."
    )
    link_radius: Radii = Field(
        description="Radius of the links, or one for each; a link is a capsule "
        "[length_unit]."
    )
    max_link_angle_deg: float = Field(
        gt=0.0, lt=90.0, description="Largest link angle psi, a cone [deg]."
    )
    max_joint_angle_deg: float = Field(
        gt=0.0, lt=90.0, description="Largest |theta| and |alpha|, a box [deg]."
    )
    base_range: Range | None = Field(
        default=None,
        description="Smallest and largest x0 on the rail [length_unit], the same for "
        "a fixed base. Default: twice the arm's length either way.",
    )
    cables: CablesModel | None = Field(
        default=None,
        description="Cable holes. Default: on 0.8 of the body radius (of the thinnest "
        "link), half gap 0.1 of the shortest link.",
    )
    tool: ToolModel | None = Field(
        default=None,
        description="What is mounted at the end of the last link; its end draws the "
        "path. Default: nothing.",
    )
    feed: FeedModel | None = Field(
        default=None,
        description="What pushes the arm along the rail. Default: not known, and what "
        "is behind the first joint is not checked.",
    )
    bodies: list[BodyModel] = Field(
        default=[], description="More solids that ride on the links."
    )
    ignore_pairs: list[NamePair] = Field(
        default=[],
        description="Names of two bodies, or of a body and an obstacle, that are not "
        "held apart: `link 3`, `tool`, `feed`, and the names of bodies and obstacles.",
    )


class UrdfManipulatorModel(FileModel):
    """An arm from a URDF: a rail along x, then links on universal joints."""

    urdf: str = Field(
        min_length=1, description="The URDF, relative to this file; lengths in metres."
    )
    max_link_angle_deg: float = Field(
        gt=0.0, lt=90.0, description="Largest link angle psi, a cone [deg]."
    )
    cables: CablesModel | None = Field(
        default=None,
        description="Cable holes. Default: on 0.8 of the body radius, half gap 0.1 of "
        "the shortest link.",
    )


class BasePoseModel(FileModel):
    """Where the rail is: the base frame in the frame of this file."""

    position: Vector = Field(
        default=[0.0, 0.0, 0.0], description="Origin of the rail [length_unit]."
    )
    rpy_deg: Vector = Field(
        default=[0.0, 0.0, 0.0],
        description="Roll, pitch, yaw of the base, R = Rz Ry Rx [deg].",
    )


ManipulatorField: TypeAlias = Annotated[
    Annotated[str, Tag("name")]
    | Annotated[ManipulatorModel, Tag("value")]
    | Annotated[UrdfManipulatorModel, Tag("from urdf")],
    Discriminator(_kind_of_arm),
]


class OtherModel(FileModel):
    """Another arm, which moves as its own trajectory says."""

    name: Name = Field(
        description="Its bodies are `NAME: link 1` and so on, in results and errors."
    )
    manipulator: ManipulatorField = Field(
        description="Name of a built-in arm, or an arm of its own."
    )
    base: BasePoseModel = Field(
        default=BasePoseModel(),
        description="Where its rail is, in the frame of this file. Default: at the "
        "origin.",
    )
    trajectory: FileName = Field(
        description="Its trajectory, a CSV with a column time_s, relative to this file."
    )


class JointsModel(FileModel):
    """Joint values of the whole arm."""

    x0: Number = Field(description="Base position on the rail [length_unit].")
    alpha_deg: list[Number] = Field(description="Yaw of joints 1..N [deg].")
    theta_deg: list[Number] = Field(description="Pitch of joints 1..N [deg].")


class StartJointsModel(FileModel):
    """The start given by its joint values."""

    joints: JointsModel = Field(description="Joint values at the start.")


class GoalModel(FileModel):
    """Where a motion without tip path ends, one of the two."""

    tip: Vector | None = Field(
        default=None, description="Where the tip is at the end [length_unit]."
    )
    joints: JointsModel | None = Field(
        default=None, description="Joint values at the end."
    )


Start: TypeAlias = Annotated[
    Annotated[Vector, Tag("point")] | Annotated[StartJointsModel, Tag("joint values")],
    Discriminator(_list_or_not),
]


class PointingModel(FileModel):
    """Where the last link looks while the tip draws, one of the three."""

    target: Vector | None = Field(
        default=None, description="A point to look at [length_unit]."
    )
    direction: Vector | None = Field(
        default=None, description="A direction to look in, of any length."
    )
    directions: Annotated[list[Vector], Field(min_length=1)] | None = Field(
        default=None,
        description="A direction for each of the points, of any length; in between it "
        "turns from one to the next.",
    )
    cone_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = Field(
        description="Largest angle between the last link's axis and that direction "
        "[deg]."
    )


class TipPathModel(FileModel):
    """What the tip shall draw, and how it comes there."""

    start: Start = Field(
        description="Where the tip of the straight arm is now [length_unit], or "
        "{joints: ...} for an arm that is not straight."
    )
    points: list[PathPart] = Field(
        min_length=1,
        description="Corners of the desired path [length_unit], and arcs, circles, "
        "splines and files of points between them; each goes on where the one before "
        "ends.",
    )
    curve_tolerance: Positive | None = Field(
        default=None,
        description="Largest distance of the corners' polyline from an arc, circle or "
        "spline [length_unit]. Default: 0.05 mm.",
    )
    closed: bool = Field(
        default=False, description="Whether the last corner joins the first."
    )
    spacing: Positive | None = Field(
        default=None,
        description="Largest distance between waypoints [length_unit]. Default: 10 mm.",
    )
    approach: Literal["shortest", "equidistant", "nearest_equidistant"] = Field(
        default="shortest", description="How the tip comes onto the path."
    )
    retreat: Retreat = Field(
        default=0.0,
        description="Step back along -X of the base while off the path [length_unit], "
        "or home: behind the path the arm goes back to its start by the way it came.",
    )
    blocked: Literal["detour", "fail"] = Field(
        default="detour",
        description="What to do where the desired path itself cannot be drawn: plan "
        "the rest of it, or no plan at all.",
    )
    required_coverage: float = Field(
        default=1.0,
        ge=0.0,
        le=1.0,
        description="Least part of the desired path that must be drawn, 0 to 1. A "
        "motion that draws less is incomplete, which is not passed.",
    )
    order: Literal["as_given", "free"] = Field(
        default="as_given",
        description="Whether pieces of the path may be drawn in another order or "
        "direction.",
    )
    insertion: list[Vector] = Field(
        default=[],
        description="Places between start and path by way of which strategy "
        "follow-the-leader brings the tip in [length_unit].",
    )
    pointing: PointingModel | None = Field(
        default=None,
        description="Where the last link's axis looks wherever the tip draws. Default: "
        "anywhere.",
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


class ObstacleErrorModel(FileModel):
    """How far one obstacle may be off."""

    name: Name = Field(description="Of the obstacle.")
    shift: NotNegative = Field(
        default=0.0,
        description="In any direction [length_unit]; counts where it is larger than "
        "that of all obstacles.",
    )
    turn_deg: NotNegative = Field(
        default=0.0,
        description="About any axis through the middle of the box around its corners "
        "[deg]; not of a half_space.",
    )


class ErrorsModel(FileModel):
    """How far the real motion, its base and the obstacles may be off."""

    joint_deg: NotNegative | list[NotNegative] | dict[str, NotNegative] = Field(
        default=0.0,
        description="Of every alpha and theta, either way [deg]; a list has a value "
        "per joint, from the base. Of a robot: of every joint that turns, or of some "
        "by name.",
    )
    slide: NotNegative | dict[str, NotNegative] = Field(
        default=0.0,
        description="Of a robot: of every joint that slides, or of some by name "
        "[length_unit].",
    )
    base: NotNegative = Field(
        default=0.0, description="Shift of the base, in any direction [length_unit]."
    )
    base_deg: NotNegative = Field(
        default=0.0, description="Turn of the base about its origin [deg]."
    )
    obstacle: NotNegative = Field(
        default=0.0, description="Of every obstacle's surface [length_unit]."
    )
    obstacles: list[ObstacleErrorModel] = Field(
        default=[], description="Of single obstacles."
    )


class ProblemModel(FileModel):
    """A planning problem for a hyper-redundant manipulator."""

    vdsm_problem: Annotated[Literal[1], BeforeValidator(not_bool)] = Field(
        description="Version of this format."
    )
    name: Name | None = Field(
        default=None, description="Name for reports. Default: the file's."
    )
    length_unit: Literal["mm", "m"] = Field(
        description="Unit of every length in this file. Angles are in degrees."
    )
    manipulator: ManipulatorField = Field(
        description="Name of a built-in arm (hrm8), or an arm of your own."
    )
    base: BasePoseModel = Field(
        default=BasePoseModel(),
        description="Where the rail is. Default: at the origin.",
    )
    obstacles: list[MovableModel] = Field(default=[], description="Solids to avoid.")
    others: list[OtherModel] = Field(
        default=[],
        description="Other arms: each link is an obstacle that moves. Trajectories "
        "then need a column time_s.",
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
    errors: ErrorsModel = Field(
        default=ErrorsModel(),
        description="Every clearance is asked for under them. Default: none.",
    )
    ratios: RatiosModel | None = Field(
        default=None,
        description="How strategy `paper` scales the path to the joints. Default: in "
        "the ratios of the arm's lengths, about the rail.",
    )
    required_clearance: NotNegative = Field(
        description="Between the surfaces of arm and obstacles [length_unit]."
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
    required_self_clearance: NotNegative = Field(
        default=0.0,
        description="Between the surfaces of links that are not neighbours "
        "[length_unit].",
    )
