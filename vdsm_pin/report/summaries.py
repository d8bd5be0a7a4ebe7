"""The summaries of a batch, a problem a row: CSV, Parquet and JUnit XML."""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.words import TIME_LIMIT, outcome
from vdsm_pin.text import printable


@contextmanager
def summary_csv(path: Path) -> Iterator[Callable[[BatchRow], None]]:
    """A table of problems, written row by row; whoever reads it finds whole rows.

    Yields:
        What writes a row.
    """
    # Buffered by line: a row is there as soon as it is written.
    with path.open("w", encoding="utf-8", newline="", buffering=1) as file:
        columns = list(BatchRow.model_fields)
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        yield lambda row: writer.writerow(row.model_dump())


def write_summary(path: Path, rows: Iterable[BatchRow]) -> None:
    """summary.csv of a batch."""
    with summary_csv(path) as write:
        for row in rows:
            write(row)


def read_summary(path: Path) -> tuple[BatchRow, ...]:
    """The rows of a summary.csv."""
    with path.open(encoding="utf-8", newline="") as file:
        return tuple(
            BatchRow.model_validate({key: value for key, value in row.items() if value})
            for row in csv.DictReader(file)
        )


COLUMNS: Final = "rows.parquet"


def write_columns(path: Path, rows: Sequence[BatchRow]) -> bool:
    """Write the rows, in their order, if there is pyarrow.

    Returns:
        Whether the file was written.
    """
    if find_spec("pyarrow") is None:
        return False
    import pyarrow
    from pyarrow import parquet

    kinds = {"number": pyarrow.float64(), "integer": pyarrow.int64()}
    fields = BatchRow.model_json_schema()["properties"]
    schema = pyarrow.schema(
        [
            (name, kinds.get(_kind(field), pyarrow.string()))
            for name, field in fields.items()
        ]
    )
    columns = [[getattr(row, name) for row in rows] for name in fields]
    table = pyarrow.table(columns, schema=schema)
    # Opened here: pyarrow takes no path that is not UTF-8.
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        parquet.write_table(table, file, compression="zstd")
    return True


def _kind(field: dict[str, Any]) -> str:
    """JSON type of a field that may be null."""
    return str(field.get("type") or field.get("anyOf", [{}])[0].get("type"))


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
            mark = {"message": printable(row.reason), "type": row.outcome}
            ElementTree.SubElement(case, "error", mark)
        elif row not in passed:
            mark = {"message": printable(row.reason), "type": row.outcome}
            ElementTree.SubElement(case, "failure", mark)
    ElementTree.indent(root)
    head = '<?xml version="1.0" encoding="UTF-8"?>\n'
    return head + ElementTree.tostring(root, encoding="unicode") + "\n"
