"""What changed between two result folders: better, worse, newly refuted."""

import csv
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeAlias

from pydantic import ValidationError

from vdsm_pin.errors import InvalidFile
from vdsm_pin.report.facts import batch_row
from vdsm_pin.report.files import BatchRow, VerificationFile
from vdsm_pin.report.summaries import read_summary
from vdsm_pin.report.words import (
    TIME_LIMIT,
    at_least,
    mean_count,
    outcome,
    survived,
    term,
)
from vdsm_pin.text import printable
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import percent

Text: TypeAlias = Callable[[float | None], str]

_ORDER: Final = (
    "error",
    TIME_LIMIT,
    "refuted",
    "undecided",
    "infeasible",
    "incomplete",
    "certified",
)
_SIGNS: Final = {True: "▼ worse ", False: "▲ better", None: "· new   "}
THRESHOLD: Final = "changes too small for the digits shown are left out"
"""Told with every comparison."""


@dataclass(frozen=True)
class Change:
    """One thing that differs.

    Args:
        problem: Folder of the problem.
        what: What differs, in words.
        worse: Whether it got worse; None where a number is new, which is neither: the
            first obstacle of a problem brings the first clearance.
    """

    problem: str
    what: str
    worse: bool | None


_MEASURES: Final[tuple[tuple[str, Text, float], ...]] = (
    ("min_clearance_lower_m", at_least, 1.0),
    ("coverage", percent, 1.0),
    ("max_joint_error_rad", survived, 1.0),
    ("changed_angles_mean_on_path", mean_count, -1.0),
)
"""Numbers of a row, how people read them, and the sign of a change that is better."""


def compare_folders(old: Path, new: Path) -> tuple[Change, ...]:
    """Everything that differs, problem by problem, in the order of names.

    Args:
        old: A folder of `vdsm batch` or of `vdsm verify`.
        new: Another one.

    Raises:
        InvalidFile: If a folder holds neither kind of result.
    """
    before, after = _rows(old), _rows(new)
    changes: list[Change] = []
    for name in sorted(before.keys() | after.keys()):
        if name not in after:
            changes.append(Change(name, "is missing from the new results", True))
        elif name not in before:
            word = after[name].outcome
            changes.append(Change(name, f"is new: {word}", not outcome(word).passed))
        else:
            changes += _compare(name, before[name], after[name])
    return tuple(changes)


def diff_lines(changes: Sequence[Change]) -> list[str]:
    """The changes as lines for a person: worse first."""
    if not changes:
        return [f"no difference; {THRESHOLD}"]
    ordered = sorted(changes, key=lambda change: not change.worse)
    lines = [
        printable(f"{_SIGNS[change.worse]}  {change.problem}: {change.what}")
        for change in ordered
    ]
    found = Counter(change.worse for change in changes)
    new = f", {found[None]} new" if found[None] else ""
    return [*lines, f"{found[True]} worse, {found[False]} better{new}; {THRESHOLD}"]


def _compare(name: str, old: BatchRow, new: BatchRow) -> list[Change]:
    if old.outcome != new.outcome:
        worse = _ORDER.index(new.outcome) < _ORDER.index(old.outcome)
        newly = "newly refuted: " if new.outcome == "refuted" else ""
        what = f"{newly}{old.outcome} → {new.outcome} ({new.reason})"
        return [Change(name, what, worse)]
    changes = (_measured(name, *measure, old, new) for measure in _MEASURES)
    return [change for change in changes if change is not None]


def _measured(
    name: str, field: str, text: Text, better: float, old: BatchRow, new: BatchRow
) -> Change | None:
    first, second = getattr(old, field), getattr(new, field)
    if first is None and second is None:
        return None
    was, now = text(first), text(second)
    what = f"{term(field)} {was} → {now}"
    if first is None or second is None:
        return Change(name, what, None if first is None else True)
    if was == now or abs(second - first) <= TOLERANCES.result_change:
        return None
    return Change(name, what, better * (second - first) < 0.0)


def _rows(folder: Path) -> dict[str, BatchRow]:
    summary, single = folder / "summary.csv", folder / "verification.json"
    try:
        if summary.is_file():
            rows = read_summary(summary)
            found = {row.folder: row for row in rows}
            if not rows or len(found) < len(rows):
                message = "it has no rows, or two of one folder"
                raise ValueError(message)
            return found
        if single.is_file():
            file = VerificationFile.model_validate_json(single.read_bytes())
            return {file.problem: batch_row(file.problem, "", file)}
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"]) or "content"
        fault = f"{key}: {first['msg']}; was it written by this version of vdsm?"
        raise InvalidFile(file=folder, fault=fault) from error
    except (OSError, ValueError, csv.Error) as error:
        raise InvalidFile(file=folder, fault=f"cannot be read: {error}") from error
    if folder.is_file():
        raise InvalidFile(file=folder, fault="is a file, expected a folder")
    what = "holds neither summary.csv nor verification.json"
    raise InvalidFile(file=folder, fault=what)
