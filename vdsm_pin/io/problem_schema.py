"""The problem file as pydantic models: names, types, ranges, and what they mean.

This is the contract with users and the source of the JSON Schema for editors. Lengths
are in the file's `length_unit`, angles in degrees; `problem_builder.py` converts.
"""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from vdsm_pin.manipulator import MAX_LINKS

Positive: TypeAlias = Annotated[float, Field(gt=0.0)]
Vector: TypeAlias = Annotated[list[float], Field(min_length=3, max_length=3)]
Range: TypeAlias = Annotated[list[float], Field(min_length=2, max_length=2)]
Lengths: TypeAlias = Annotated[
    list[Positive], Field(min_length=2, max_length=MAX_LINKS)
]
PathPoint: TypeAlias = Annotated[str, Field(min_length=1, max_length=4096)]
ObstacleName: TypeAlias = Annotated[
    str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_ .()#+-]*$", max_length=100)
]
FolderName: TypeAlias = Annotated[
    str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.+-]*$", max_length=100)
]


def _text_or_not(value: Any) -> str:
    return "name" if isinstance(value, str) else "value"


def _list_or_not(value: Any) -> str:
    return "point" if isinstance(value, list) else "joints"


class FileModel(BaseModel):
    """Base: unknown keys refused, no silent conversion, every number finite."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False
    )


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


class ManipulatorModel(FileModel):
    """An arm of N links on a rail along the x axis of its base."""

    name: FolderName = Field(default="custom", description="Name for reports.")
    link_lengths: Lengths = Field(
        description="L_1..L_N between joint centres, 2 to 40 of them [length_unit]."
    )
    link_radius: Positive = Field(
        description="Radius of the body; a link is a capsule [length_unit]."
    )
    max_link_angle_deg: float = Field(
        gt=0.0, lt=90.0, description="Largest link angle psi, a cone [deg]."
    )
    max_joint_angle_deg: float = Field(
        gt=0.0, lt=90.0, description="Largest |theta| and |alpha|, a box [deg]."
    )
    base_range: Range | None = Field(
        default=None,
        description="Smallest and largest x0 on the rail [length_unit]. Default: twice "
        "the arm's length either way.",
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
    Annotated[str, Tag("name")] | Annotated[ManipulatorModel, Tag("value")],
    Discriminator(_text_or_not),
]
Axis: TypeAlias = Annotated[
    Annotated[Literal["x", "y", "z"], Tag("name")] | Annotated[Vector, Tag("value")],
    Discriminator(_text_or_not),
]


class _Named(FileModel):
    name: ObstacleName = Field(description="Unique name of the obstacle.")


class _Round(_Named):
    axis: Axis = Field(description="x, y or z, or a vector of any length.")
    center: Vector = Field(description="Middle of the axis [length_unit].")
    radius: Positive = Field(description="[length_unit]")


class CylinderModel(_Round):
    """A solid cylinder with flat ends."""

    shape: Literal["cylinder"]
    length: Positive = Field(description="From end face to end face [length_unit].")


class CapsuleModel(_Round):
    """A segment grown by a radius."""

    shape: Literal["capsule"]
    length: Positive = Field(description="Between the cap centres [length_unit].")


class SphereModel(_Named):
    """A ball."""

    shape: Literal["sphere"]
    center: Vector = Field(description="[length_unit]")
    radius: Positive = Field(description="[length_unit]")


class BoxModel(_Named):
    """A cuboid."""

    shape: Literal["box"]
    center: Vector = Field(description="[length_unit]")
    size: Annotated[list[Positive], Field(min_length=3, max_length=3)] = Field(
        description="Edge lengths [length_unit]."
    )
    rpy_deg: Vector = Field(
        default=[0.0, 0.0, 0.0], description="Roll, pitch, yaw, R = Rz Ry Rx [deg]."
    )


class PrismModel(_Named):
    """A simple polygon swept along an axis; it need not be convex."""

    shape: Literal["prism"]
    axis: Literal["x", "y", "z"] = Field(description="Direction of the sweep.")
    polygon: list[Range] = Field(
        min_length=3,
        description="Corners [length_unit]; across axis x: [y, z]; across y: [z, x]; "
        "across z: [x, y].",
    )
    from_: float = Field(
        alias="from", description="Start on the axis [length_unit], below `to`."
    )
    to: float = Field(description="End on the axis [length_unit].")


class HalfSpaceModel(_Named):
    """Everything on one side of a plane: solid where (p - point) . normal <= 0."""

    shape: Literal["half_space"]
    point: Vector = Field(description="A point of the plane [length_unit].")
    normal: Vector = Field(description="Out of the solid, of any length.")


class MeshModel(_Named):
    """Triangles from an STL or OBJ file; solid if watertight, else a surface."""

    shape: Literal["mesh"]
    file: PathPoint = Field(description="Path, relative to this file.")
    scale: Positive = Field(
        default=1.0, description="Length units of this file per unit of the mesh."
    )
    center: Vector = Field(
        default=[0.0, 0.0, 0.0],
        description="Where the origin of the mesh goes [length_unit].",
    )
    rpy_deg: Vector = Field(
        default=[0.0, 0.0, 0.0], description="Roll, pitch, yaw, R = Rz Ry Rx [deg]."
    )
    check_size: bool = Field(
        default=True,
        description="Refuse a mesh so large or small beside the arm that its unit "
        "must be wrong.",
    )


ObstacleModel: TypeAlias = Annotated[
    CylinderModel
    | PrismModel
    | SphereModel
    | CapsuleModel
    | BoxModel
    | HalfSpaceModel
    | MeshModel,
    Field(discriminator="shape"),
]


class JointsModel(FileModel):
    """Joint values of the whole arm."""

    x0: float = Field(description="Base position on the rail [length_unit].")
    alpha_deg: list[float] = Field(description="Yaw of joints 1..N [deg].")
    theta_deg: list[float] = Field(description="Pitch of joints 1..N [deg].")


class StartJointsModel(FileModel):
    """The start given by its joint values."""

    joints: JointsModel = Field(description="Joint values at the start.")


Start: TypeAlias = Annotated[
    Annotated[Vector, Tag("point")] | Annotated[StartJointsModel, Tag("joints")],
    Discriminator(_list_or_not),
]


class TipPathModel(FileModel):
    """What the tip shall draw, and how it comes there."""

    start: Start = Field(
        description="Where the tip of the straight arm is now [length_unit], or "
        "{joints: ...} for an arm that is not straight."
    )
    points: list[Vector] = Field(
        min_length=1, description="Corners of the desired path [length_unit]."
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
    retreat: float = Field(
        default=0.0,
        ge=0.0,
        description="Step back along -X of the base while off the path [length_unit].",
    )
    blocked: Literal["detour", "fail"] = Field(
        default="detour",
        description="What to do where the desired path itself cannot be drawn.",
    )
    required_coverage: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="Least part of the desired path that must be drawn, 0 to 1.",
    )
    order: Literal["as_given", "free"] = Field(
        default="as_given",
        description="Whether waypoints may be drawn in another order or direction.",
    )


class ProblemModel(FileModel):
    """A planning problem for a hyper-redundant manipulator."""

    vdsm_problem: Literal[1] = Field(description="Version of this format.")
    name: FolderName | None = Field(
        default=None, description="Name for reports and folders. Default: the file's."
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
    obstacles: list[ObstacleModel] = Field(default=[], description="Solids to avoid.")
    tip_path: TipPathModel = Field(description="What the tip shall draw.")
    required_clearance: float = Field(
        ge=0.0, description="Between the surfaces of arm and obstacles [length_unit]."
    )
    required_self_clearance: float = Field(
        default=0.0,
        ge=0.0,
        description="Between the surfaces of links that are not neighbours "
        "[length_unit].",
    )
