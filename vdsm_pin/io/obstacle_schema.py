"""The nine shapes of the problem file as pydantic models."""

from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, create_model

from vdsm_pin.io.schema_types import (
    FileModel,
    FileName,
    Name,
    Number,
    Positive,
    Range,
    Size,
    Vector,
    text_or_not,
)

Axis: TypeAlias = Annotated[
    Annotated[Literal["x", "y", "z"], Tag("name")] | Annotated[Vector, Tag("value")],
    Discriminator(text_or_not),
]


class NamedModel(FileModel):
    """A shape, or what it is made of."""

    name: Name = Field(description="Unique name of the obstacle.")


class _Round(NamedModel):
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


class SphereModel(NamedModel):
    """A ball."""

    shape: Literal["sphere"]
    center: Vector = Field(description="[length_unit]")
    radius: Positive = Field(description="[length_unit]")


class BoxModel(NamedModel):
    """A cuboid."""

    shape: Literal["box"]
    center: Vector = Field(description="[length_unit]")
    size: Size = Field(description="Edge lengths [length_unit].")
    rpy_deg: Vector = Field(
        default=[0.0, 0.0, 0.0], description="Roll, pitch, yaw, R = Rz Ry Rx [deg]."
    )


class PrismModel(NamedModel):
    """A simple polygon swept along an axis; it need not be convex."""

    shape: Literal["prism"]
    axis: Literal["x", "y", "z"] = Field(description="Direction of the sweep.")
    polygon: list[Range] = Field(
        min_length=3,
        description="Corners [length_unit]; across axis x: [y, z]; across y: [z, x]; "
        "across z: [x, y].",
    )
    from_: Number = Field(
        alias="from", description="Start on the axis [length_unit], below `to`."
    )
    to: Number = Field(description="End on the axis [length_unit].")


class HalfSpaceModel(NamedModel):
    """Everything on one side of a plane: solid where (p - point) . normal <= 0."""

    shape: Literal["half_space"]
    point: Vector = Field(description="A point of the plane [length_unit].")
    normal: Vector = Field(description="Out of the solid, of any length.")


class FromFileModel(NamedModel):
    """What stands in a file of its own, and where it goes."""

    file: FileName = Field(description="Path, relative to this file.")
    length_unit: Literal["mm", "m"] | None = Field(
        default=None,
        description="Unit of that file. Default: what it states itself; else that of "
        "this file, and the verdict names the size so assumed.",
    )
    scale: Positive = Field(
        default=1.0, description="Factor on the coordinates of that file."
    )
    center: Vector = Field(
        default=[0.0, 0.0, 0.0],
        description="Where the origin of that file goes [length_unit].",
    )
    rpy_deg: Vector = Field(
        default=[0.0, 0.0, 0.0], description="Roll, pitch, yaw, R = Rz Ry Rx [deg]."
    )
    check_size: bool = Field(
        default=True,
        description="Refuse what is so large or small beside the arm that its unit "
        "must be wrong.",
    )


class MeshModel(FromFileModel):
    """Triangles from an STL, OBJ, PLY, GLB or DAE file, solid where they close."""

    shape: Literal["mesh"]
    solid: bool | None = Field(
        default=None,
        description="true: the mesh must close, else it is refused; false: only its "
        "surface is meant, it has no inside; left out: a mesh that does not close is "
        "undecided.",
    )


class PointsModel(FromFileModel):
    """Measured points from a PLY, PCD, XYZ, TXT, CSV or NPY file."""

    shape: Literal["points"]
    radius: Positive = Field(
        description="Of the ball that each point is, the error of the scan "
        "[length_unit]."
    )


class VoxelsModel(FromFileModel):
    """Occupied cells: their centres, or a NPY array of true and false."""

    shape: Literal["voxels"]
    size: Size = Field(
        description="Edge lengths of a cell [length_unit]; the first cell of an array "
        "begins at its origin."
    )


SHAPES: Final = (
    *(CylinderModel, PrismModel, SphereModel, CapsuleModel, BoxModel),
    *(HalfSpaceModel, MeshModel, PointsModel, VoxelsModel),
)
"""All of them, in the order of the schema."""


def with_field(shape: type[NamedModel], more: type[FileModel], noun: str) -> Any:
    """A shape with the field of another model, and the same description.

    Args:
        shape: Such as SphereModel.
        more: The other model.
        noun: What it is then, as in SphereBody.
    """
    name = shape.__name__.replace("Model", noun)
    return create_model(
        name, __base__=(more, shape), __doc__=shape.__doc__, __module__=__name__
    )
