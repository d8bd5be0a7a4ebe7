"""What the models of the problem file have in common."""

from typing import Annotated, Any, Final, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from vdsm_pin.text import UNSEEN

LARGEST: Final = 1e12
"""Numbers beyond this are slips, and their squares would overflow further on."""

SMALLEST: Final = 1e-12
"""Sizes below this are slips, and might be nothing in another unit."""


def _no_slip(value: float) -> float:
    """A size that is left of zero by more than rounding."""
    if not value >= SMALLEST:
        kind, message = "greater_than_equal", "Input should be {ge} or more"
        raise PydanticCustomError(kind, message, {"ge": SMALLEST})
    return value


def exactly(count: int) -> Any:
    """Says of a list of another length how many entries it has to have."""

    def counted(value: Any) -> Any:
        if isinstance(value, list) and len(value) != count:
            kind, message = "wrong_length", "exactly {count} entries"
            raise PydanticCustomError(kind, message, {"count": count})
        return value

    return BeforeValidator(counted)


Number: TypeAlias = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive: TypeAlias = Annotated[
    float, Field(gt=0.0, le=LARGEST), AfterValidator(_no_slip)
]
NotNegative: TypeAlias = Annotated[float, Field(ge=0.0, le=LARGEST)]
Vector: TypeAlias = Annotated[
    list[Number], Field(min_length=3, max_length=3), exactly(3)
]
Range: TypeAlias = Annotated[
    list[Number], Field(min_length=2, max_length=2), exactly(2)
]
Size: TypeAlias = Annotated[
    list[Positive], Field(min_length=3, max_length=3), exactly(3)
]
FileName: TypeAlias = Annotated[str, Field(min_length=1, max_length=4096)]

NAME_PATTERN: Final = f"^[^\\s=+@{UNSEEN}-][^{UNSEEN}]*$"
"""Names in any alphabet. Spreadsheets take what begins with = + - @ for a formula."""

Name: TypeAlias = Annotated[str, Field(pattern=NAME_PATTERN, max_length=100)]


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
