"""Conversion between SI and what people type; for readers and writers only."""

from collections.abc import Mapping
from math import ceil, floor, isfinite
from typing import Final

UNITS_PER_METRE: Final[Mapping[str, float]] = {"m": 1.0, "mm": 1e3}
"""Length units a problem file may name.

Readers divide by these: 206 / 1e3 is the number closest to 0.206, 206 * 1e-3 is not.
"""

MM_PER_M: Final = 1e3
"""Millimetres in a metre."""


def in_mm(length: float) -> str:
    """A length as people read it, in messages and notes; [m] to mm."""
    if not isfinite(length):
        return "-"
    rounded = round(length * MM_PER_M, 3) + 0.0  # no -0
    return f"{rounded:.3f} mm".replace("-", "−")


def proved_mm(length: float) -> str:
    """A length that is proved to be kept, rounded down; [m]."""
    scaled = round(length * MM_PER_M**2, 6)  # rounding noise is nothing
    return in_mm(floor(scaled) / MM_PER_M**2 if isfinite(scaled) else length)


def at_most_mm(length: float) -> str:
    """A length that is proved not to be exceeded, rounded up; [m]."""
    scaled = round(length * MM_PER_M**2, 6)
    return in_mm(ceil(scaled) / MM_PER_M**2 if isfinite(scaled) else length)


def clearance_words(clearance: float, deeper: bool = False) -> str:
    """A clearance as messages state it, of a depth perhaps that it is more; [m]."""
    return f"a clearance of {in_mm(clearance)}{' or deeper' if deeper else ''}"
