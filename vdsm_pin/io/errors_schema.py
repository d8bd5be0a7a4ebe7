"""How far things may be off in a problem file, as pydantic models."""

from pydantic import Field

from vdsm_pin.io.schema_types import FileModel, Name, NotNegative


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
