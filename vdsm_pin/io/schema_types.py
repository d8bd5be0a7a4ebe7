"""What the models of the problem file have in common."""

from typing import Annotated, Any, Final, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

LARGEST: Final = 1e12
"""Numbers beyond this are slips, and their squares would overflow further on."""

Number: TypeAlias = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive: TypeAlias = Annotated[float, Field(gt=0.0, le=LARGEST)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, le=LARGEST)]
Vector: TypeAlias = Annotated[list[Number], Field(min_length=3, max_length=3)]
Range: TypeAlias = Annotated[list[Number], Field(min_length=2, max_length=2)]

FOLDER_PATTERN: Final = r"^[A-Za-z0-9_][A-Za-z0-9_.+-]*$"
OBSTACLE_PATTERN: Final = r"^[A-Za-z0-9_][A-Za-z0-9_ .()#+-]*$"
FolderName: TypeAlias = Annotated[str, Field(pattern=FOLDER_PATTERN, max_length=100)]
ObstacleName: TypeAlias = Annotated[
    str, Field(pattern=OBSTACLE_PATTERN, max_length=100)
]


def text_or_not(value: Any) -> str:
    """Tag of a field that is a name or something else."""
    return "name" if isinstance(value, str) else "value"


class FileModel(BaseModel):
    """Base: unknown keys refused, no silent conversion, every number finite."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        allow_inf_nan=False,
        defer_build=True,  # only the whole file's model is ever used
    )
