"""Where an arm stands in a problem file, as pydantic models: its start and its goal."""

from typing import Annotated, Any, TypeAlias

from pydantic import Discriminator, Field, Tag

from vdsm_pin.io.schema_types import FileModel, Number, Vector


class JointsModel(FileModel):
    """Joint values of the whole arm."""

    x0: Number = Field(description="Base position on the rail [length_unit].")
    alpha_deg: list[Number] = Field(description="Yaw of joints 1..N [deg].")
    theta_deg: list[Number] = Field(description="Pitch of joints 1..N [deg].")


class StartJointsModel(FileModel):
    """The start given by its joint values."""

    joints: JointsModel = Field(description="Joint values at the start.")


def _list_or_not(value: Any) -> str:
    return "point" if isinstance(value, list) else "joint values"


Start: TypeAlias = Annotated[
    Annotated[Vector, Tag("point")] | Annotated[StartJointsModel, Tag("joint values")],
    Discriminator(_list_or_not),
]


class GoalModel(FileModel):
    """Where a motion without tip path ends, one of the two."""

    tip: Vector | None = Field(
        default=None, description="Where the tip is at the end [length_unit]."
    )
    joints: JointsModel | None = Field(
        default=None, description="Joint values at the end."
    )
