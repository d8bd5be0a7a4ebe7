"""Values of a YAML or JSON document that know where they stand."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.yaml_reader import Location, YamlDocument


@dataclass(frozen=True)
class Place:
    """A value of the file, and where it stands."""

    document: YamlDocument
    at: Location
    value: Any

    @classmethod
    def of(cls, file: object, data: Any) -> "Place":
        """All of what a file holds, whose lines are not known."""
        return cls(YamlDocument(file, data, {}), (), data)

    def __getitem__(self, key: str | int) -> "Place":
        """What stands under a key or number.

        Raises:
            InvalidFile: If there is none.
        """
        if isinstance(key, str) and not isinstance(self.value, dict):
            fault = "is no mapping"
            raise self.invalid(fault)
        try:
            return Place(self.document, (*self.at, key), self.value[key])
        except (KeyError, IndexError, TypeError):
            fault = f"has no {key!r}"
            raise self.invalid(fault) from None

    def get(self, key: str, default: Any = None) -> "Place":
        """What stands under a key, or a default where nothing does.

        Raises:
            InvalidFile: If this is no mapping, for which a default would stand.
        """
        known = isinstance(self.value, dict)
        if not known and default is not None and self.value is not None:
            fault = "is no mapping"
            raise self.invalid(fault)
        found = self.value.get(key) if known else None
        return Place(
            self.document, (*self.at, key), default if found is None else found
        )

    def items(self) -> list["Place"]:
        """Of a list.

        Raises:
            InvalidFile: If it is none.
        """
        if not isinstance(self.value, list):
            fault = "is no list"
            raise self.invalid(fault)
        return [self[k] for k in range(len(self.value))]

    def keys(self) -> list[str]:
        """Of a mapping.

        Raises:
            InvalidFile: If it is none, or a key is no text.
        """
        if not isinstance(self.value, dict):
            fault = "is no mapping"
            raise self.invalid(fault)
        for key in self.value:
            if not isinstance(key, str):
                fault = f"has the key {key!r}, expected a name"
                raise self.invalid(fault)
        return list(self.value)

    def number(self) -> float:
        """A finite number.

        Raises:
            InvalidFile: If it is another thing.
        """
        if (found := finite_numbers([self.value], 1)) is None:
            fault = f"is {str(self.value)[:60]}, expected a finite number"
            raise self.invalid(fault)
        return found[0]

    def numbers(self, count: int) -> FloatArray:
        """So many finite numbers, shape (count,).

        Raises:
            InvalidFile: If it is another thing.
        """
        values = finite_numbers(self.value, count)
        if values is None:
            fault = f"is {str(self.value)[:60]}, expected {count} finite numbers"
            raise self.invalid(fault)
        return np.array(values, dtype=np.float64)

    def naming(self) -> AbstractContextManager[None]:
        """Name the value where it makes what is done within invalid."""
        return self.document.naming(self.at)

    def invalid(self, fault: str) -> InvalidFile:
        """The value is not what is expected."""
        return self.document.invalid(self.at, fault)


def finite_numbers(row: Any, count: int) -> list[float] | None:
    """So many finite numbers; None where it is another thing."""
    if not isinstance(row, list) or len(row) != count:
        return None
    if not all(type(value) in (int, float) for value in row):
        return None
    try:
        numbers = [float(value) for value in row]
    except OverflowError:
        return None
    return numbers if np.isfinite(numbers).all() else None
