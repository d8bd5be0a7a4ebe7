"""Oracles: junitparser, an independent reader of the format, and the usual XSD."""

from pathlib import Path

import junitparser
import pytest
from lxml import etree

from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.summaries import junit_text


def row(folder: str, outcome: str, reason: str = "") -> BatchRow:
    return BatchRow.model_validate(
        {
            "folder": folder,
            "problem": folder,
            "strategy": "paper",
            "outcome": outcome,
            "reason": reason,
        }
    )


ROWS = [
    row("a", "certified"),
    row("b", "refuted", "too <near> & \x00 broken"),
    row("c", "infeasible", "no"),
    row("d", "error", "bad file"),
    row("e", "time-limit", "late"),
    row("f", "undecided", "neither"),
    row("g", "incomplete", "13.2 % drawn"),
]


@pytest.fixture(scope="module")
def xsd() -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(Path(__file__).parent / "data" / "junit.xsd"))


def test_each_outcome_has_its_place() -> None:
    text = junit_text(ROWS)
    suites = junitparser.JUnitXml.fromstring(text.encode())
    (suite,) = suites
    assert (suite.tests, suite.failures, suite.errors) == (7, 4, 2)
    kinds = {case.name: [type(r).__name__ for r in case.result] for case in suite}
    assert kinds == {
        "a": [],
        "b": ["Failure"],
        "c": ["Failure"],
        "d": ["Error"],
        "e": ["Error"],
        "f": ["Failure"],
        "g": ["Failure"],
    }
    (failure,) = list(suite)[1].result
    assert failure.message == "too <near> & \\x00 broken"


@pytest.mark.parametrize("rows", [ROWS, ROWS[:1], []])
def test_the_usual_schema_accepts_it(
    xsd: etree.XMLSchema, rows: list[BatchRow]
) -> None:
    xsd.assertValid(etree.fromstring(junit_text(rows).encode()))


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ('name="a"', 'title="a"'),
        ('tests="7"', 'tests="six"'),
        ("<failure", "<fault"),
        (' errors="2"', ""),
    ],
)
def test_the_schema_refuses_what_no_server_reads(
    xsd: etree.XMLSchema, good: str, bad: str
) -> None:
    text = junit_text(ROWS)
    assert good in text
    assert not xsd.validate(etree.fromstring(text.replace(good, bad).encode()))


def test_an_empty_batch_is_valid() -> None:
    assert len(list(junitparser.JUnitXml.fromstring(junit_text([]).encode()))) == 1
