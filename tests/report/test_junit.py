"""Oracle: junitparser, an independent reader of the format."""

import junitparser

from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.junit import junit_text


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


def test_each_outcome_has_its_place() -> None:
    text = junit_text(
        [
            row("a", "certified"),
            row("b", "refuted", "too <near> & \x00 broken"),
            row("c", "infeasible", "no"),
            row("d", "error", "bad file"),
            row("e", "timeout", "late"),
        ]
    )
    suites = junitparser.JUnitXml.fromstring(text.encode())
    (suite,) = suites
    assert (suite.tests, suite.failures, suite.errors) == (5, 2, 2)
    kinds = {case.name: [type(r).__name__ for r in case.result] for case in suite}
    assert kinds == {
        "a": [],
        "b": ["Failure"],
        "c": ["Failure"],
        "d": ["Error"],
        "e": ["Error"],
    }


def test_an_empty_batch_is_valid() -> None:
    assert len(list(junitparser.JUnitXml.fromstring(junit_text([]).encode()))) == 1
