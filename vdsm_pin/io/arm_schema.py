"""An arm in a problem file, as pydantic models: links, tool, cables, bodies."""

from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, Union

from pydantic import Discriminator, Field, Tag

from vdsm_pin.arm.manipulator import MAX_LINKS
from vdsm_pin.io import obstacle_schema as shapes
from vdsm_pin.io.schema_types import (
    FileModel,
    Name,
    Positive,
    Range,
    Vector,
    exactly,
    text_or_not,
)

MAX_PARTS = 256
"""Most hulls that a mesh is covered by."""


class _OnLink(FileModel):
    link: int = Field(
        ge=1,
        le=MAX_LINKS,
        description="The link that it rides on, from 1. Its fields are in the frame of "
        "that link: origin at its first joint, x along it.",
    )


class MeshBody(_OnLink, shapes.MeshModel):
    """A mesh on a link: what is proved clear are hulls that hold it and its inside."""

    parts: int = Field(
        default=1,
        ge=1,
        le=MAX_PARTS,
        description="Hulls of groups of its triangles that the mesh is covered by.",
    )


if TYPE_CHECKING:
    BodyModel: TypeAlias = MeshBody
else:
    _PLAIN = (
        *(shapes.CylinderModel, shapes.CapsuleModel, shapes.SphereModel),
        *(shapes.BoxModel, shapes.PrismModel),
    )
    _MODELS = *(shapes.with_field(shape, _OnLink, "Body") for shape in _PLAIN), MeshBody
    BodyModel = Annotated[Union[_MODELS], Field(discriminator="shape")]  # noqa: UP007


Radii: TypeAlias = Annotated[
    Annotated[Positive, Tag("one")]
    | Annotated[list[Positive], Field(min_length=2, max_length=MAX_LINKS), Tag("each")],
    Discriminator(lambda value: "each" if isinstance(value, list) else "one"),
]
"""One radius of all links, or one of each."""


Lengths: TypeAlias = Annotated[
    list[Positive], Field(min_length=2, max_length=MAX_LINKS)
]


NamePair: TypeAlias = Annotated[
    list[Name], Field(min_length=2, max_length=2), exactly(2)
]


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


def _kind_of_arm(value: Any) -> str:
    if isinstance(value, dict) and "urdf" in value:
        return "from urdf"
    return "from urdf" if hasattr(value, "urdf") else text_or_not(value)


ManipulatorField: TypeAlias = Annotated[
    Annotated[str, Tag("name")]
    | Annotated[ManipulatorModel, Tag("value")]
    | Annotated[UrdfManipulatorModel, Tag("from urdf")],
    Discriminator(_kind_of_arm),
]
