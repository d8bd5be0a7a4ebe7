"""A robot in a problem file, by its URDF and what is said of it."""

from typing import Literal, TypeAlias

from pydantic import Field

from vdsm_pin.io.body_schema import MAX_PARTS
from vdsm_pin.io.schema_types import FileModel, Number

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
