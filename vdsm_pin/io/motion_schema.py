"""Obstacles of the problem file that may move, as pydantic models."""

from typing import TYPE_CHECKING, Annotated, TypeAlias, Union

from pydantic import Field, create_model

from vdsm_pin.io import obstacle_schema as shapes
from vdsm_pin.io.schema_types import FileModel, Number, Vector


class MotionModel(FileModel):
    """How an obstacle moves: its frame stands at the file's origin without."""

    times_s: Annotated[list[Number], Field(min_length=1)] = Field(
        description="When it passes its knots, rising; at rest before the first and "
        "after the last [s]."
    )
    positions: list[Vector] | None = Field(
        default=None,
        description="Of its frame's origin at each time [length_unit]. Default: the "
        "file's origin.",
    )
    rpy_deg: list[Vector] | None = Field(
        default=None,
        description="Roll, pitch, yaw of its frame at each time, R = Rz Ry Rx [deg]. A "
        "point c of the obstacle stands at position + R c; from knot to knot all six "
        "numbers change evenly, whole turns count. Default: not turned.",
    )


class _CanMove(FileModel):
    motion: MotionModel | None = Field(
        default=None,
        description="How it moves. Default: at rest. Trajectories then need a column "
        "time_s.",
    )


def _movable(shape: type[shapes.NamedModel]) -> type[FileModel]:
    """A shape with the field `motion`, and the same description."""
    name = shape.__name__.replace("Model", "Obstacle")
    both = (_CanMove, shape)
    return create_model(name, __base__=both, __doc__=shape.__doc__, __module__=__name__)


if TYPE_CHECKING:
    MovableModel: TypeAlias = shapes.NamedModel
else:
    _MODELS = tuple(
        _movable(getattr(shapes, f"{kind}Model"))
        for kind in (
            *("Cylinder", "Prism", "Sphere", "Capsule", "Box"),
            *("HalfSpace", "Mesh", "Points", "Voxels"),
        )
    )
    MovableModel = Annotated[Union[_MODELS], Field(discriminator="shape")]  # noqa: UP007
