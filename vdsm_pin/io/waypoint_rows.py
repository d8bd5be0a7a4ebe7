"""What all tables of waypoints keep: rising numbers, places on the path."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.io.tables import Table
from vdsm_pin.tolerances import TOLERANCES

WAYPOINT: Final = "waypoint"
PLACE: Final = ("on_path", "path_m")
"""Whether the tip draws the path at a waypoint, and where along it."""

LENGTH: Final = (
    f"metres, at most {TOLERANCES.scene_extent:g} either way; is it in millimetres?"
)
"""What a length shall be."""


@dataclass(frozen=True)
class Waypoints:
    """The rows of a file by the names of their columns.

    Args:
        file: The file, for messages.
        columns: Names of the columns.
        rows: Shape (n, n_columns).
    """

    file: Path
    columns: Sequence[str]
    rows: FloatArray

    def __getitem__(self, name: str) -> FloatArray:
        """The values of a column, shape (n,)."""
        return np.asarray(self.rows[:, self.columns.index(name)])

    def check(self, name: str, good: BoolArray, expected: str) -> None:
        """Refuse the first row whose value in a column is not good."""
        if not good.all():
            row = int(np.argmin(good))
            problem = f"{name} is {self[name][row]:g}, expected {expected}"
            where = f"line {row + 2}"
            raise InvalidFile(file=self.file, where=where, problem=problem)


def read_waypoints(table: Table) -> Waypoints:
    """All rows of a table.

    Raises:
        InvalidFile: If there is none or too many, `waypoint` does not rise by whole
            numbers, or `on_path` or `path_m`, where there, are no such values.
    """
    found = Waypoints(table.file, table.columns, table.all_rows())
    number = found[WAYPOINT]
    good = (np.diff(number, prepend=-1.0) > 0.0) & (number == np.floor(number))
    found.check(WAYPOINT, good, "a whole number above that of the row before")
    if set(PLACE) <= set(found.columns):
        on_path, path_m = (found[name] for name in PLACE)
        found.check(PLACE[0], (on_path == 0.0) | (on_path == 1.0), "0 or 1")
        most = TOLERANCES.path_extent
        found.check(PLACE[1], (path_m >= 0.0) & (path_m <= most), f"0 to {most:g} m")
    return found
