"""The shapes of the problem file as bodies that ride on a link."""

from typing import TYPE_CHECKING, Annotated, TypeAlias, Union

from pydantic import Field

from vdsm_pin.arm.manipulator import MAX_LINKS
from vdsm_pin.io import obstacle_schema as shapes
from vdsm_pin.io.schema_types import FileModel

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
