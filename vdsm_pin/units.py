"""Conversion between SI and what people type; for readers and writers only."""

from collections.abc import Mapping
from typing import Final

METRES_PER_UNIT: Final[Mapping[str, float]] = {"m": 1.0, "mm": 1e-3}
"""Length units a problem file may name."""

MM_PER_M: Final = 1e3
"""Millimetres in a metre."""
