"""Oracle: rows that differ in exactly one known way."""

import math
from pathlib import Path

import made_up
import pytest

from vdsm_pin.errors import InvalidFile
from vdsm_pin.report.diff import THRESHOLD, compare_folders, diff_lines
from vdsm_pin.report.facts import batch_row, verification_file
from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.summaries import write_summary
from vdsm_pin.verification.records import Verdict

FILE = verification_file(made_up.verification(), made_up.RECORD)
ROW = batch_row("a", "paper", FILE)


def folder(path: Path, *rows: BatchRow) -> Path:
    path.mkdir()
    write_summary(path / "summary.csv", rows)
    return path


def test_equal_folders_have_no_difference(tmp_path: Path) -> None:
    old, new = folder(tmp_path / "old", ROW), folder(tmp_path / "new", ROW)
    assert compare_folders(old, new) == ()
    assert diff_lines(()) == [f"no difference; {THRESHOLD}"]


def test_a_change_that_cannot_be_seen_is_none(tmp_path: Path) -> None:
    """A joint error is told as far as it is proved: rounded down, as everywhere."""
    shown = [math.radians(value) for value in (0.20938, 0.20932, 0.20849)]
    rows = [ROW.model_copy(update={"max_joint_error_rad": one}) for one in shown]
    first, same, less = (folder(tmp_path / str(k), row) for k, row in enumerate(rows))
    assert compare_folders(first, same) == ()
    (change,) = compare_folders(first, less)
    assert change.worse
    assert "±0.2093° → ±0.2084°" in change.what


@pytest.mark.parametrize(
    ("update", "worse"),
    [
        ({"outcome": "refuted"}, True),
        ({"outcome": "undecided"}, True),
        ({"outcome": "incomplete"}, True),
        ({"min_clearance_lower_m": 0.0040}, True),
        ({"min_clearance_lower_m": 0.0050}, False),
        ({"min_clearance_lower_m": None}, True),
        ({"coverage": 0.9}, False),
        ({"coverage": 0.8}, True),
        ({"changed_angles_mean_on_path": 1.0}, False),
        ({"changed_angles_mean_on_path": 7.0}, True),
        ({"max_joint_error_rad": 0.001}, True),
    ],
)
def test_each_change_is_named_with_its_direction(
    tmp_path: Path, update: dict[str, object], worse: bool
) -> None:
    old = folder(tmp_path / "old", ROW)
    new = folder(tmp_path / "new", ROW.model_copy(update=update))
    (change,) = compare_folders(old, new)
    assert change.worse is worse
    (back,) = compare_folders(new, old)
    assert back.worse is not worse
    assert ("newly refuted" in change.what) == (update.get("outcome") == "refuted")
    assert len(diff_lines((change,))) == 2


def test_the_clearance_of_a_first_obstacle_is_neither_better_nor_worse(
    tmp_path: Path,
) -> None:
    free = ROW.model_copy(update={"min_clearance_lower_m": None})
    old, new = folder(tmp_path / "old", free), folder(tmp_path / "new", ROW)
    (change,) = compare_folders(old, new)
    assert change.worse is None
    lines = diff_lines((change,))
    assert lines[0].startswith("· new     a: smallest proved clearance not available →")
    assert lines[1].startswith("0 worse, 0 better, 1 new; ")


def test_missing_and_new_problems_show(tmp_path: Path) -> None:
    other = ROW.model_copy(update={"folder": "b"})
    old, new = folder(tmp_path / "old", ROW), folder(tmp_path / "new", other)
    assert [change.worse for change in compare_folders(old, new)] == [True, False]


def test_single_results_compare_too(tmp_path: Path) -> None:
    for name, verdict in (("old", Verdict.CERTIFIED), ("new", Verdict.REFUTED)):
        (tmp_path / name).mkdir()
        file = verification_file(made_up.verification(verdict), made_up.RECORD)
        (tmp_path / name / "verification.json").write_text(file.text())
    (change,) = compare_folders(tmp_path / "old", tmp_path / "new")
    assert change.worse


@pytest.mark.parametrize(
    ("rows", "reason", "words"),
    [
        ((), "", "no rows"),
        ((ROW, ROW), "", "two of one folder"),
        ((ROW,), "x" * 200_000, "field larger than field limit"),
    ],
)
def test_a_summary_that_no_batch_writes_is_refused(
    rows: tuple[BatchRow, ...], reason: str, words: str, tmp_path: Path
) -> None:
    """No rows are no result without a difference."""
    longer = [row.model_copy(update={"reason": reason}) for row in rows]
    one = folder(tmp_path / "one", *longer)
    with pytest.raises(InvalidFile, match=f"one: cannot be read: .*{words}"):
        compare_folders(one, one)


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="neither"):
        compare_folders(tmp_path, tmp_path)
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(InvalidFile, match="is a file, expected a folder"):
        compare_folders(tmp_path / "a.json", tmp_path)
    (tmp_path / "summary.csv").write_text("outcome\nsplendid\n")
    with pytest.raises(InvalidFile, match="folder: Field required; was it written"):
        compare_folders(tmp_path, tmp_path)
