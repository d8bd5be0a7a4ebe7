"""Points of a path from the CSV of any program."""

from io import BytesIO
from pathlib import Path
from typing import Final

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import Digest, read_bytes
from vdsm_pin.io.tables import Table, as_text

MAX_BYTES: Final = 1 << 29
"""Some hundred bytes for each of the rows that a motion may have."""


def read_points(path: Path, digest: Digest) -> FloatArray:
    """Points in the order of the file.

    Args:
        path: A CSV file with the columns x, y and z; others are not read.
        digest: Gets the bytes of the file.

    Returns:
        Shape (n, 3), n >= 1, in the unit of the file.

    Raises:
        InvalidFile: If the file cannot be read, a column is missing, a value is no
            finite number, or there are no points or too many.
    """
    content = read_bytes(path, limit=MAX_BYTES)
    digest.update(content)
    table = Table(path, as_text(BytesIO(content)), ("x", "y", "z"))
    return table.all_rows()
