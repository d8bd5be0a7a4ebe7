"""Conversion between SI and what people type; for readers and writers only."""

from collections.abc import Callable, Iterable, Mapping
from math import ceil, degrees, floor, isfinite, isinf, isnan, log10
from typing import Final, TypeAlias

UNITS_PER_METRE: Final[Mapping[str, float]] = {"m": 1.0, "mm": 1e3}
"""Length units a problem file may name.

Readers divide by these: 206 / 1e3 is the number closest to 0.206, 206 * 1e-3 is not.
"""

MM_PER_M: Final = 1e3
"""Millimetres in a metre."""

MISSING: Final = "not available"
"""What stands where there is no evidence; never a pass."""

Whole: TypeAlias = Callable[[float], int]
"""How a number is rounded to whole ones."""

_NOISE_DIGITS: Final = 6  # of the last digit; what rounding leaves of 5.0 mm is 5.0

_SMALLEST_FIXED: Final = 1e-3  # below this, three decimals would print 0.000
_LARGE: Final = 1e3  # from here on, a tenth is fine enough
_SHARE_DIGITS: Final = 9
_DISPLAY_UNITS: Final[Mapping[str, tuple[float, str]]] = {
    "m": (MM_PER_M, " mm"),
    "rad": (degrees(1.0), "°"),
    "-": (1.0, ""),
}
_SHARE: Final = "share"  # the unit of a part of a whole, 0 to 1; people read percent


def quantity(value: float | None, unit: str, whole: Whole | None = None) -> str:
    """A value with its unit as people read it: mm and degrees.

    Args:
        value: In SI; None or NaN where there is none.
        unit: "m", "rad", "share" or "-"; any other unit is printed as it is.
        whole: Rounds to the last digit that is shown; to the nearest where not given.

    Returns:
        For instance "3.500 mm", "42.500°", "1.2e-10 mm" or "not available".
    """
    if value is None or isnan(value):
        return MISSING
    if unit == _SHARE:
        return percent(value)
    factor, suffix = _DISPLAY_UNITS.get(unit, (1.0, f" {unit}"))
    shown = value * factor
    if isinf(shown):
        return ("+" if shown > 0.0 else "−") + "∞" + suffix
    if unit == "-" and float(shown).is_integer():
        return f"{shown:.0f}"
    fixed = shown == 0.0 or abs(shown) >= _SMALLEST_FIXED
    digits = 3 if abs(shown) < _LARGE else 1
    if whole is not None and shown:
        last = digits if fixed else 1 - floor(log10(abs(shown)))
        shown = whole(round(shown * 10.0**last, _NOISE_DIGITS)) / 10.0**last
    text = f"{shown:.{digits}f}" if fixed else f"{shown:.1e}"
    return signed(text) + suffix


def signed(text: str) -> str:
    """The text of a number with a minus sign, which zero has not.

    >>> signed("-1.5"), signed("-0.000")
    ('−1.5', '0.000')
    """
    if text[0] != "-":
        return text
    return ("−" if text.strip("-0.") else "") + text[1:]


def measured(value: float | None, unit: str) -> str:
    """The same of a length or an angle of the motion, where rounding noise is zero."""
    if value is None or isnan(value):
        return MISSING
    factor, _ = _DISPLAY_UNITS.get(unit, (1.0, ""))
    return quantity(value if abs(value) * factor >= _SMALLEST_FIXED else 0.0, unit)


def measured_at_most(value: float, unit: str) -> str:
    """The same rounded up, to 0.001 mm or 0.001 deg: not told smaller than it was."""
    factor, _ = _DISPLAY_UNITS[unit]
    least = _SMALLEST_FIXED / factor if value > 0.0 else 0.0
    return quantity(max(value, least), unit, ceil)


def percent(share: float | None) -> str:
    """A share from 0 to 1 in percent, rounded down: 100 % means nothing is missing."""
    if share is None or isnan(share):
        return MISSING
    whole = round(share, _SHARE_DIGITS)  # rounding noise of a sum is not a gap
    return f"{floor(whole * 1000.0) / 10.0:.1f} %"


def percent_at_most(share: float) -> str:
    """The same rounded up: 0 % means that there is nothing."""
    whole = round(share, _SHARE_DIGITS)
    return f"{ceil(whole * 1000.0) / 10.0:.1f} %"


def in_mm(length: float, whole: Whole | None = None) -> str:
    """A length as people read it, in messages and notes; [m] to mm.

    Args:
        length: The length; [m].
        whole: Rounds to 0.001 mm; to the nearest where not given.
    """
    if not isfinite(length):
        return "-"
    if whole is not None:
        length = whole(round(length * MM_PER_M**2, _NOISE_DIGITS)) / MM_PER_M**2
    return f"{signed(f'{length * MM_PER_M:.3f}')} mm"


def proved_mm(length: float) -> str:
    """A length that is proved to be kept, rounded down; [m]."""
    return in_mm(length, floor)


def at_most_mm(length: float) -> str:
    """A length that is proved not to be exceeded, rounded up; [m]."""
    return in_mm(length, ceil)


def point_mm(point: Iterable[float]) -> str:
    """Coordinates as people read them; [m] to mm."""
    return ", ".join(signed(f"{value * MM_PER_M:.1f}") for value in point)


def clearance_words(clearance: float, deeper: bool = False) -> str:
    """A clearance as messages state it, of a depth perhaps that it is more; [m]."""
    return f"a clearance of {in_mm(clearance)}{' or deeper' if deeper else ''}"
