"""The desired path row by row, in the order in which it is drawn."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray, distinct
from vdsm_pin.planner.spacing import stepped
from vdsm_pin.problem.desired_path import DesiredPath


@dataclass(frozen=True)
class PathRows:
    """The desired path row by row, in drawing order.

    Args:
        stations: Arc length of each row; on a closed path they go on counting past its
            length, shape (r,); [m].
        tips: Where the rows are, shape (r, 3); [m].
        corner: Whether a row is a corner, the first or the last, shape (r,).
        first: Number of the first one on a closed path that is begun elsewhere.
    """

    stations: FloatArray
    tips: FloatArray
    corner: BoolArray
    first: int = 0

    @property
    def as_stated(self) -> IntArray:
        """Numbers of these rows in the order of the path as stated, shape (r,)."""
        count = len(self.stations)
        if self.first == 0:
            return np.arange(count)
        return rolled(count, count - 1 - self.first)

    def begun_at(self, first: int, length: float) -> "PathRows":
        """A closed path of this length [m] begun at another of its rows."""
        order = rolled(len(self.stations), first)
        stations = self.stations[order]
        stations[len(stations) - 1 - first :] += length
        if stations[0] >= length:
            stations -= length
        corner = self.corner[order]
        corner[[0, -1]] = True
        return PathRows(stations, self.tips[order], corner, first)


def rolled(count: int, first: int) -> IntArray:
    """Rows of a closed path in their order from another one on, shape (count,).

    The last row is where the first one is: it is left out, and the new first one comes
    again at the end.
    """
    once = (first + np.arange(count - 1)) % (count - 1)
    return np.append(once, first)


def path_rows(path: DesiredPath) -> PathRows:
    """Rows at most `spacing` apart; every corner is a row.

    A closed path is entered at the point nearest to the start, an open one at its
    first point.
    """
    corners = path.corner_stations
    begin = path.entry
    if begin > 0.0:
        later, sooner = corners[corners > begin], corners[1:][corners[1:] < begin]
        end = [begin + path.length]
        corners = np.concatenate([[begin], later, sooner + path.length, end])
    # A single point is drawn by resting there: two rows at one place.
    corners = distinct(corners) if path.length > 0.0 else corners[[0, 0]]
    rows, corner = stepped(corners[:, None], path.spacing)
    stations = rows[:, 0]
    return PathRows(stations, path.at(path.wrapped(stations)), corner)
