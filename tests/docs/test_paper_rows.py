"""docs/paper_rows.md: every row of the paper has a verdict and something to see."""

import re
from functools import cache
from pathlib import Path

import pytest

from vdsm_pin.io.problem_file import built_in_names

ROOT = Path(__file__).parents[2]
LINES = (ROOT / "docs/paper_rows.md").read_text(encoding="utf-8").splitlines()
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in LINES
    if re.match(r"\| \d", line)
]


@cache
def known_tests() -> frozenset[str]:
    texts = [file.read_text("utf-8") for file in (ROOT / "tests").rglob("test_*.py")]
    return frozenset(re.findall(r"^def (test_\w+)", "\n".join(texts), re.MULTILINE))


def test_there_are_99_rows_and_at_most_five_are_met_in_part() -> None:
    assert [row[0] for row in ROWS] == [str(k) for k in range(1, 100)]
    verdicts = [row[2] for row in ROWS]
    assert set(verdicts) == {"met", "refuted", "partly"}
    assert verdicts.count("partly") <= 5


def test_each_row_met_in_part_has_its_reason_on_the_page_about_the_paper() -> None:
    page = (ROOT / "docs/paper.md").read_text(encoding="utf-8")
    table = page.split("## Row by row")[1].split("\n\n")[2].splitlines()
    told = [line.split("|")[1].split(":")[0].strip() for line in table[2:]]
    assert told == [row[0] for row in ROWS if row[2] == "partly"]


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_what_shows_a_row_is_there(row: list[str]) -> None:
    shown = re.findall(r"`([^`]+)`", row[3])
    assert shown
    for one in shown:
        if one.startswith("test_"):
            assert one in known_tests()
        elif one.startswith("vdsm "):
            problem = one.split()[2]
            assert problem.startswith("--") or problem in built_in_names()
        else:
            assert (ROOT / one).is_file()
