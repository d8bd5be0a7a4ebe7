"""What a desired path may be made of, as pydantic models."""

from functools import partial
from typing import Annotated, Any, Final, TypeAlias

from pydantic import Discriminator, Field, Tag

from vdsm_pin.io.schema_types import FileModel, FileName, Vector


class ArcModel(FileModel):
    """An arc from the point before, through a point, to another."""

    through: Vector = Field(description="A point in the middle [length_unit].")
    to: Vector = Field(description="The end [length_unit].")


class CircleModel(FileModel):
    """A turn about an axis, from the point before."""

    center: Vector = Field(description="Of the circle [length_unit].")
    normal: Vector = Field(description="Axis of the turn, right-handed, of any length.")
    turn_deg: Annotated[float, Field(ge=-36000.0, le=36000.0)] = Field(
        default=360.0, description="How far it turns [deg]. Default: a whole circle."
    )


class ArcPart(FileModel):
    """An arc in a list of points."""

    arc: ArcModel = Field(description="An arc after the point before.")


class CirclePart(FileModel):
    """A circle in a list of points."""

    circle: CircleModel = Field(description="A circle after the point before.")


class SplinePart(FileModel):
    """A centripetal Catmull-Rom spline in a list of points."""

    spline: list[Vector] = Field(
        min_length=1,
        description="Points that it goes through after the point before [length_unit].",
    )


class FilePart(FileModel):
    """The rows of a CSV file as points."""

    file: FileName = Field(
        description="Path, relative to this file; columns x, y, z [length_unit]."
    )


_CURVES: Final = ("arc", "circle", "spline", "file")


def _kind(value: Any) -> str | None:
    """Tag of a part, which is no key of it; None where it is none."""
    if isinstance(value, list):
        return "point part"
    has = value.__contains__ if isinstance(value, dict) else partial(hasattr, value)
    return next((f"{kind} part" for kind in _CURVES if has(kind)), None)


PathPart: TypeAlias = Annotated[
    Annotated[Vector, Tag("point part")]
    | Annotated[ArcPart, Tag("arc part")]
    | Annotated[CirclePart, Tag("circle part")]
    | Annotated[SplinePart, Tag("spline part")]
    | Annotated[FilePart, Tag("file part")],
    Discriminator(
        _kind,
        custom_error_type="part_of_path",
        custom_error_message="3 numbers or one of arc, circle, spline and file",
    ),
]
"""A point of a path, or a curve that goes on from the point before."""
