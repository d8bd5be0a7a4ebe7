"""junit.xml of a batch: one test case per problem, for CI systems."""

from collections.abc import Sequence
from xml.etree import ElementTree

from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.words import TIME_LIMIT, outcome


def junit_text(rows: Sequence[BatchRow]) -> str:
    """The batch as JUnit XML; all that did not pass and is no error failed.

    Durations are zero: they would differ from run to run, and timing.json has them.
    """
    broken = [row for row in rows if row.outcome in ("error", TIME_LIMIT)]
    passed = [row for row in rows if outcome(row.outcome).passed]
    totals = {
        "tests": str(len(rows)),
        "failures": str(len(rows) - len(passed) - len(broken)),
        "errors": str(len(broken)),
        "time": "0",
    }
    root = ElementTree.Element("testsuites", {"name": "vdsm batch"} | totals)
    suite = ElementTree.SubElement(root, "testsuite", {"name": "vdsm batch"} | totals)
    for row in rows:
        case = ElementTree.SubElement(
            suite,
            "testcase",
            {"classname": f"vdsm.{row.strategy}", "name": row.folder, "time": "0"},
        )
        if row in broken:
            mark = {"message": _printable(row.reason), "type": row.outcome}
            ElementTree.SubElement(case, "error", mark)
        elif row not in passed:
            mark = {"message": _printable(row.reason), "type": row.outcome}
            ElementTree.SubElement(case, "failure", mark)
    ElementTree.indent(root)
    head = '<?xml version="1.0" encoding="UTF-8"?>\n'
    return head + ElementTree.tostring(root, encoding="unicode") + "\n"


def _printable(text: str) -> str:
    """Without the control characters that XML forbids."""
    return "".join(sign if sign.isprintable() else " " for sign in text)
