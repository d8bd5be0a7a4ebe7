"""rows.parquet: every row of a batch in one columnar file, for pandas and its kin.

Written where pyarrow is installed (the extra `parquet`); summary.csv says the same.
"""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.report.files import BatchRow

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
    with atomic_path(path) as aside, aside.open("wb") as file:
        parquet.write_table(table, file, compression="zstd")
    return True


def _kind(field: dict[str, Any]) -> str:
    """JSON type of a field that may be null."""
    return str(field.get("type") or field.get("anyOf", [{}])[0].get("type"))
