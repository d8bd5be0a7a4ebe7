"""CSV tables; every header carries its unit, links and joints count from 1."""

import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import joint_centres, link_angles, position_angles
from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.geometry.decimals import LONGEST, WORD, put_rows
from vdsm_pin.io.tables import quoted
from vdsm_pin.io.trajectory_file import PLACE, WAYPOINT
from vdsm_pin.io.waypoint_tables import cable_columns, centre_columns
from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.brackets import (
    NOTHING_MEASURED,
    ClearanceChunk,
    CoalIndex,
    LeastClearances,
)
from vdsm_pin.verification.records import ArmVerification, Pair, Verification


class Form:
    """How the columns of a table are written.

    Args:
        decimals: Most decimals of each column, trailing zeros left out; `WORD` for a
            column that holds numbers of words.
        rounding: -1 downwards, 0 to the nearest, 1 upwards; by column.
        words: The words, as they shall stand in the file.
    """

    def __init__(
        self, decimals: Sequence[int], rounding: Sequence[int], words: Sequence[str]
    ) -> None:
        texts = [word.encode() for word in words]
        self._columns = frozen(decimals, np.int64), frozen(rounding, np.int64)
        self._words = frozen(bytearray(b"".join(texts)), np.uint8)
        self._ends = frozen([0, *accumulate(map(len, texts))], np.int64)
        longest = max(LONGEST, *(len(text) + 1 for text in (b"", *texts)))
        self._room = len(decimals) * longest

    def rows(self, table: FloatArray) -> memoryview:
        """The rows of a table as bytes, shape (n, n_columns)."""
        out = np.zeros(len(table) * self._room, dtype=np.uint8)
        rows = np.ascontiguousarray(table, dtype=np.float64)
        size = put_rows(rows, *self._columns, self._words, self._ends, out)
        return out[:size].data


_VERDICTS: Final = ("certified", "refuted", "undecided")
_CLEARANCE_HEADER: Final = (
    "interval,moment,link,obstacle,other_link,lower_m,upper_m,verdict,"
    "link_x_m,link_y_m,link_z_m,other_x_m,other_y_m,other_z_m,coal_waypoint,coal_m\n"
)
_CLEARANCE_DECIMALS: Final = (0, 9, WORD, 9, 9, WORD, *6 * (6,), 0, 9)
_CLEARANCE_ROUNDING: Final = (0, 0, 0, -1, 1, 0, *6 * (0,), 0, 0)
_SPOOLED: Final = 12  # numbers of a row before Coal's two
_DECIMALS: Final = 12  # of metres and radians at the rows
_CHUNK: Final = 8192  # rows held at one time


class ClearanceCsv:
    """clearance.csv, one row per interval and pair.

    Rows come while the motion is proved and wait aside as numbers: Coal measures after
    that, and its distances stand in the same rows.

    Args:
        path: The file.
        problem: For the frame of the witness points.
        n_pairs: Of how many pairs; their names are told last.
        reach: Rows are written of intervals over which a pair is not proved farther
            apart; inf for all; [m].
    """

    def __init__(
        self, path: Path, problem: AnyProblem, n_pairs: int, reach: float = math.inf
    ) -> None:
        pose = problem.T_world_base
        self._rotation, self._shift = pose[:3, :3].T, pose[:3, 3]
        self._reach, self._written = reach, np.zeros(n_pairs, dtype=np.bool_)
        self._path = path
        self._file = tempfile.TemporaryFile(dir=path.parent)

    def __call__(self, chunk: ClearanceChunk) -> None:
        """Take the rows of one chunk that are within reach."""
        row, column = np.nonzero(chunk.lower <= self._reach)
        pairs = column if chunk.pairs is None else chunk.pairs[column]
        part = LeastClearances(
            interval=row + chunk.first_interval,
            share=chunk.share[row, column],
            lower=chunk.lower[row, column],
            upper=chunk.upper[row, column],
            verdict=chunk.verdict[row, column],
            link_point=chunk.link_point[row, column],
            other_point=chunk.other_point[row, column],
        )
        self._written[pairs] = True
        self._table(pairs, part).tofile(self._file)

    def close(self) -> None:
        """Give up the rows that wait aside."""
        self._file.close()

    def write(self, verification: Verification) -> None:
        """Write the file: all rows so far, then one of every pair that has none.

        A waypoint belongs to the interval that it begins, the last one to the last.

        Args:
            verification: Its pairs and least clearances, and what Coal measured.
        """
        n_pairs, coal = self._written.size, verification.coal or NOTHING_MEASURED
        last = max(verification.trajectory.n_samples - 2, 0)
        keys = np.minimum(coal.waypoint, last) * n_pairs + coal.pair
        near, far = CoalIndex(coal, keys), CoalIndex(coal, coal.pair)
        form = _clearance_form(verification.pairs)
        with self._path.open("wb") as file:
            file.write(_CLEARANCE_HEADER.encode())
            for rows in self._waiting():
                numbers = rows[:, [0, 2]].astype(np.int64)
                keys = numbers[:, 0] * n_pairs + numbers[:, 1] - len(_VERDICTS)
                file.write(form.rows(np.hstack([rows, near.at(keys)])))
            for pairs, rows in self._rest(verification.least):
                file.write(form.rows(np.hstack([rows, far.at(pairs)])))

    def _waiting(self) -> Iterator[FloatArray]:
        """The rows that wait aside, in parts."""
        self._file.seek(0)
        while True:
            table = np.fromfile(self._file, count=_CHUNK * _SPOOLED)
            if not table.size:
                return
            yield table.reshape(-1, _SPOOLED)

    def _rest(self, least: LeastClearances) -> Iterator[tuple[IntArray, FloatArray]]:
        """The pairs without a row, with the least clearance of each, in parts."""
        rest = np.flatnonzero(~self._written)
        for first in range(0, rest.size, _CHUNK):
            pairs = rest[first : first + _CHUNK]
            yield pairs, self._table(pairs, least.of(pairs))

    def _table(self, pairs: IntArray, rows: LeastClearances) -> FloatArray:
        """Rows as numbers, of which each has a pair, shape (k, 12)."""
        columns = [
            rows.interval,
            rows.interval + rows.share,
            pairs + len(_VERDICTS),
            rows.lower,
            rows.upper,
            rows.verdict,
        ]
        with np.errstate(invalid="ignore"):  # points of pairs without evidence
            points = [
                point @ self._rotation + self._shift
                for point in (rows.link_point, rows.other_point)
            ]
        return np.column_stack([*columns, *points]).astype(np.float64)


def _clearance_form(pairs: Sequence[Pair]) -> Form:
    """How rows of clearance.csv are written, whose words are verdicts and pairs."""
    field = cache(quoted)  # few names, and up to a million pairs of them
    partners = (
        f"{field(pair.body or str(pair.link))},{field(pair.obstacle)},"
        f"{field(pair.other_body or str(pair.other_link or ''))}"
        for pair in pairs
    )
    words = (*_VERDICTS, *partners)
    return Form(_CLEARANCE_DECIMALS, _CLEARANCE_ROUNDING, words)


def write_link_angles(path: Path, verification: ArmVerification) -> None:
    """link_angles.csv: psi and gamma of every joint at every row."""
    rows = verification.trajectory
    joints = range(1, rows.n_links + 1)
    psi_columns, gamma_columns = (
        [f"{angle}{j}_rad" for j in joints] for angle in ("psi", "gamma")
    )

    def values(part: slice) -> FloatArray:
        angles = rows.alpha[part], rows.theta[part]
        psi, gamma = link_angles(*angles), position_angles(*angles)
        return np.column_stack([rows.x0[part], psi, gamma])

    _write_rows(path, rows, ["x0_m", *psi_columns, *gamma_columns], values)


def write_centres(
    path: Path,
    problem: PlanningProblem,
    rows: Trajectory,
    centres: FloatArray | None = None,
) -> None:
    """centres.csv: the joint centres at every row, in the frame of the problem file.

    Args:
        path: The file.
        problem: The arm, and the frame of the file.
        rows: The motion.
        centres: Its joint centres where they are planned, shape (n_samples, N + 1, 3);
            from its angles otherwise; [m].
    """
    arm, pose = problem.manipulator, problem.T_world_base

    def values(part: slice) -> FloatArray:
        joints = rows.x0[part], rows.alpha[part], rows.theta[part]
        own = joint_centres(arm, *joints) if centres is None else centres[part]
        points: FloatArray = own @ pose[:3, :3].T + pose[:3, 3]
        return points.reshape(len(points), -1)

    _write_rows(path, rows, centre_columns(rows.n_links), values)


def write_cables(path: Path, problem: PlanningProblem, rows: Trajectory) -> None:
    """cables.csv: the base position and the 3N cable lengths at every row."""

    def values(part: slice) -> FloatArray:
        angles = rows.alpha[part], rows.theta[part]
        lengths = cable_lengths(problem.manipulator, *angles)
        return np.column_stack([rows.x0[part], lengths.reshape(len(lengths), -1)])

    _write_rows(path, rows, cable_columns(rows.n_links), values)


def _write_rows(
    path: Path,
    rows: Trajectory,
    columns: Sequence[str],
    values: Callable[[slice], FloatArray],
) -> None:
    """A table of waypoints and their places on the path, made and written in parts.

    Args:
        path: The file.
        rows: The motion.
        columns: Names of the columns behind those.
        values: Gives these columns of a slice of the rows.
    """
    header = [WAYPOINT, *PLACE, *columns]
    decimals = [0, 0] + [_DECIMALS] * (len(header) - 2)  # waypoint and on_path
    form = Form(decimals, [0] * len(header), ())
    with path.open("wb") as file:
        file.write(",".join(header).encode() + b"\n")
        for first in range(0, rows.n_samples, _CHUNK):
            part = slice(first, min(first + _CHUNK, rows.n_samples))
            places = np.arange(part.start, part.stop), rows.on_path[part]
            table = [*places, rows.path_m[part], values(part)]
            file.write(form.rows(np.column_stack(table)))
