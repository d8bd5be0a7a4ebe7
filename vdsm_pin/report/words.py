"""One vocabulary for terminal, JSON, HTML and JUnit: words, marks, units for people."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MISSING, Whole, quantity
from vdsm_pin.verification.records import CLEARANCES

TIME_LIMIT: Final = "time-limit"
"""The outcome of what the time limit ended."""

if TYPE_CHECKING:
    from vdsm_pin.report.rows import CheckRow, ClosestRow, ErrorBoxRow, MinClearance
    from vdsm_pin.verification.records import Check

_MOMENT_DIGITS: Final = 2
_ERROR_DIGITS: Final = 4
TERMS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "min_clearance_lower_m": "smallest proved clearance",
        "min_clearance_upper_m": "smallest clearance found",
        "max_joint_error_rad": "largest proved joint error",
        "coverage": "coverage of the desired path",
        "changed_angles_mean_on_path": "changed link angles",
        "max_link_angle_rad": "largest link angle ψ",
        "x0_min_m": "smallest base position x₀",
        "x0_max_m": "largest base position x₀",
        "waypoints": "waypoints",
        "problem": "problem",
        "outcome": "outcome",
        "seconds": "time",
    }
)
"""What people read for a key of the files: one name on terminal, pages and in diffs."""


def finite(value: float) -> float | None:
    """The value, or None where it is NaN or infinite."""
    return float(value) if math.isfinite(value) else None


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one outcome is named and marked everywhere.

    Args:
        word: The word in JSON, terminal and HTML.
        mark: A sign that does not need colour.
        colour: Colour on a terminal.
        passed: Whether it counts as passed.
        meaning: One sentence for the reader who does not know the tool.
    """

    word: str
    mark: str
    colour: str
    passed: bool
    meaning: str


OUTCOMES: Final[Mapping[str, Outcome]] = MappingProxyType(
    {
        outcome.word: outcome
        for outcome in (
            Outcome("certified", "✓", "green", True, "Proved for the whole motion."),
            Outcome("refuted", "✗", "red", False, "A violation was found."),
            Outcome(
                "undecided",
                "?",
                "yellow",
                False,
                "Neither proved nor refuted within the budget; counts as not passed.",
            ),
            Outcome(
                "incomplete",
                "◐",
                "yellow",
                False,
                "Proved, but less of the desired path is drawn than required.",
            ),
            Outcome(
                "infeasible", "∅", "magenta", False, "The planner has no plan for it."
            ),
            Outcome("error", "!", "red", False, "The input or the run was broken."),
            Outcome(
                TIME_LIMIT, "…", "yellow", False, "The time limit came before a result."
            ),
        )
    }
)
"""Every outcome of a check, a verification or a problem of a batch."""


BASE_ERROR: Final = "shift of the base in any direction"
"""What the length of the base's error is; its turn is another number."""


def outcome(word: str) -> Outcome:
    """The outcome of that word; an unknown word is shown and never counts as passed."""
    unknown = Outcome(word, "?", "yellow", False, "Unknown outcome.")
    return OUTCOMES.get(word, unknown)


_SAME: Final = 10.0 * TOLERANCES.least_bracket
"""Bounds no farther apart are of one depth; [m]."""


def depth(
    value: float | None, deeper: bool, unit: str = "m", whole: Whole | None = None
) -> str:
    """A clearance; of one that is as deep as is measured it is said that it is more."""
    text = quantity(value, unit, whole)
    return f"{text} or deeper" if deeper else text


def at_least(value: float | None, deeper: bool = False) -> str:
    """A length that is proved, rounded down: no more is said than was proved; [m]."""
    return depth(value, deeper, "m", math.floor)


def at_most(value: float | None, deeper: bool = False) -> str:
    """A length that is proved not to be exceeded, rounded up; [m]."""
    return depth(value, deeper, "m", math.ceil)


def kept_at_least(row: "ClosestRow | MinClearance") -> str:
    """What is proved to be kept in a closest approach.

    Of a depth where both bounds are the most that is measured it is said that it may be
    more; a lower bound by itself is no depth that was found.
    """
    lower, upper = row.lower_m, row.upper_m
    most = lower is None or upper is None or upper - lower <= _SAME
    return at_least(lower, row.deeper and most)


def rounding(row: "CheckRow | Check") -> Whole | None:
    """How the worst value of a check is rounded; None for to the nearest.

    A clearance is rounded to the safe side of what is proved of it: down, and up where
    it is refuted by what it does not exceed, unless that alone reads as its limit.
    """
    if row.name not in CLEARANCES:
        return None
    if row.verdict != "refuted":
        return math.floor
    both = math.floor, math.ceil
    down, up = (depth(row.worst, row.deeper, row.unit, one) for one in both)
    return math.floor if down != up == limit(row.limit, row.unit) else math.ceil


def check_cells(row: "CheckRow | Check") -> tuple[str, str]:
    """Worst value and limit of a check."""
    whole = rounding(row)
    asked = limit(row.limit, row.unit, None if row.verdict == "refuted" else whole)
    return depth(row.worst, row.deeper, row.unit, whole), asked


def survived(error: float | None) -> str:
    """A joint error that is proved to be survived, rounded down; [rad]."""
    return "none" if error == 0.0 else _joint_error(error, math.floor)


def lost(error: float | None) -> str:
    """A joint error that is proved not to be survived, rounded up; [rad]."""
    return _joint_error(error, math.ceil)


def _joint_error(error: float | None, whole: Whole) -> str:
    """In degrees, with digits enough to tell the two apart."""
    if error is None or math.isnan(error):
        return MISSING
    scale = 10.0**_ERROR_DIGITS
    return f"±{whole(math.degrees(error) * scale) / scale:.{_ERROR_DIGITS}f}°"


def errors(box: "ErrorBoxRow") -> str:
    """An error box: what may be off and by how much; empty if nothing may."""
    parts = []
    if box.joints_rad:
        each = ("/".join(quantity(e, "rad") for e in pair) for pair in box.joints_rad)
        parts.append(f"±{', ±'.join(each)} of α/θ of joints 1 to {len(box.joints_rad)}")
    elif box.joint_error_rad:
        parts.append(f"±{quantity(box.joint_error_rad, 'rad')} of every joint angle")
    for value, unit, what in (
        (box.slide_error_m, "m", "of every joint that slides"),
        (box.base_error_m, "m", f"({BASE_ERROR})"),
        (box.base_error_rad, "rad", "(turn of the base)"),
        (box.obstacle_error_m, "m", "of every obstacle"),
    ):
        parts += [f"{quantity(value, unit)} {what}"] if value else []
    for joint in box.named:
        size = joint.turn_rad or joint.shift_m
        unit = "rad" if joint.turn_rad else "m"
        parts += [f"±{quantity(size, unit)} of {joint.name}"] if size else []
    for one in box.obstacles:
        sizes = (one.shift_m, "m"), (one.turn_rad, "rad")
        stated = [quantity(size, unit) for size, unit in sizes if size]
        parts += [f"{' and '.join(stated)} of {one.name}"] if stated else []
    return ", ".join(parts)


def mean_count(value: float | None) -> str:
    """How many things on average."""
    return MISSING if value is None else f"{value:.2f}"


def counted(count: int, word: str) -> str:
    """A number of things in words.

    >>> counted(1, "link"), counted(2, "link")
    ('1 link', '2 links')
    """
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def limit(value: float | None, unit: str, whole: Whole | None = None) -> str:
    """A check's limit, or that it only reports."""
    return "no limit asked" if value is None else quantity(value, unit, whole)


def term(key: str) -> str:
    """The name of a key for people."""
    return TERMS[key]


def moment_text(moment: float | None, time: float | None = None) -> str:
    """A moment of the motion: "waypoint 193" or, between two, "waypoint 193.25".

    Its time stands behind it where that is known; [s].
    """
    if moment is None:
        return ""
    text = f"waypoint {round(moment, _MOMENT_DIGITS):.{_MOMENT_DIGITS}f}"
    told = "" if time is None else f" ({time:.3f} s)"
    return text.rstrip("0").rstrip(".") + told


def place(moment: float | None, where: str, time: float | None = None) -> str:
    """When and where something happens, in words; empty if neither is known."""
    return ", ".join(part for part in (moment_text(moment, time), where) if part)
