"""The desired path in a problem file, as pydantic models: its parts, and the whole."""

from functools import partial
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag

from vdsm_pin.io.posture_field import Start
from vdsm_pin.io.schema_types import (
    FileModel,
    FileName,
    NotNegative,
    Positive,
    Vector,
    text_or_not,
)


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


Retreat: TypeAlias = Annotated[
    Annotated[Literal["home"], Tag("name")] | Annotated[NotNegative, Tag("value")],
    Discriminator(text_or_not),
]
"""A length, or the word home."""


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
        "follow-the-leader brings the tip in; searching strategies try it first "
        "[length_unit].",
    )
    pointing: PointingModel | None = Field(
        default=None,
        description="Where the last link's axis looks wherever the tip draws. Default: "
        "anywhere.",
    )
