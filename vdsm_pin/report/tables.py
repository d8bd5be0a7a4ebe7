"""CSV tables; every header carries its unit, links and joints count from 1."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.kinematics import link_angles, position_angles
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.report.facts import cables
from vdsm_pin.report.files import BatchRow
from vdsm_pin.verification.records import ClearanceChunk, Pair, Verification

_VERDICTS: Final = ("certified", "refuted", "undecided")
_CLEARANCE_HEADER: Final = (
    "interval,moment,link,obstacle,other_link,lower_m,upper_m,verdict,"
    "link_x_m,link_y_m,link_z_m,other_x_m,other_y_m,other_z_m\n"
)
_CLEARANCE_ROW: Final = "%d,%.12g,%s,%.9g,%.9g,%s" + 6 * ",%.6f" + "\n"
_HOLES: Final = ("a", "b", "c")


class ClearanceCsv:
    """clearance.csv, one row per interval and pair, written while it is proved.

    Args:
        path: The file.
        problem: For the frame of the witness points.
        pairs: Column order of the chunks.
    """

    def __init__(
        self, path: Path, problem: PlanningProblem, pairs: Sequence[Pair]
    ) -> None:
        pose = problem.T_world_base
        self._rotation, self._shift = pose[:3, :3].T, pose[:3, 3]
        self._partners = [
            f"{pair.link},{_quoted(pair.obstacle)},{pair.other_link or ''}"
            for pair in pairs
        ]
        self._file = path.open("w", encoding="utf-8", newline="")
        self._file.write(_CLEARANCE_HEADER)

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file."""
        self._file.close()

    def __call__(self, chunk: ClearanceChunk) -> None:
        """Write one chunk."""
        n, m = chunk.lower.shape
        link = (chunk.link_point @ self._rotation + self._shift).reshape(n * m, 3)
        other = (chunk.other_point @ self._rotation + self._shift).reshape(n * m, 3)
        intervals = np.repeat(np.arange(n) + chunk.first_interval, m)
        rows = zip(
            intervals.tolist(),
            (chunk.time.ravel() + intervals).tolist(),
            self._partners * n,
            chunk.lower.ravel().tolist(),
            chunk.upper.ravel().tolist(),
            (_VERDICTS[verdict] for verdict in chunk.verdict.ravel().tolist()),
            *link.T.tolist(),
            *other.T.tolist(),
            strict=True,
        )
        # The percent sign formats a row in one call: five times as fast as a template.
        self._file.writelines([_CLEARANCE_ROW % row for row in rows])


def write_link_angles(path: Path, verification: Verification) -> None:
    """link_angles.csv: psi and gamma of every joint at every row."""
    rows = verification.trajectory
    joints = range(1, rows.n_links + 1)
    header = ["waypoint", "on_path", "path_m", "x0_m"]
    header += [f"psi{j}_rad" for j in joints] + [f"gamma{j}_rad" for j in joints]
    psi = link_angles(rows.alpha, rows.theta)
    gamma = position_angles(rows.alpha, rows.theta)
    values = np.column_stack([rows.path_m, rows.x0, psi, gamma])
    labels = [f"{k},{int(on)}" for k, on in enumerate(rows.on_path)]
    _write_rows(path, header, labels, values)


def write_cables(path: Path, verification: Verification) -> None:
    """cables.csv: the 3N cable lengths at every row."""
    lengths = cables(verification.problem, verification.trajectory)
    joints = range(1, lengths.shape[1] + 1)
    header = ["waypoint", *(f"l{j}{hole}_m" for j in joints for hole in _HOLES)]
    labels = [str(k) for k in range(len(lengths))]
    _write_rows(path, header, labels, lengths.reshape(len(lengths), -1))


def write_summary(path: Path, rows: Iterable[BatchRow]) -> None:
    """summary.csv of a batch."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(BatchRow.model_fields), lineterminator="\n")
        writer.writeheader()
        writer.writerows(row.model_dump() for row in rows)


def read_summary(path: Path) -> tuple[BatchRow, ...]:
    """The rows of a summary.csv."""
    with path.open(encoding="utf-8", newline="") as file:
        return tuple(
            BatchRow.model_validate({key: value for key, value in row.items() if value})
            for row in csv.DictReader(file)
        )


def _write_rows(
    path: Path, header: Sequence[str], labels: Sequence[str], values: FloatArray
) -> None:
    form = "%s" + values.shape[1] * ",%.12g" + "\n"
    columns = values.T.tolist()
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(header) + "\n")
        file.writelines(form % row for row in zip(labels, *columns, strict=True))


def _quoted(text: str) -> str:
    """A CSV field that may hold a comma or a quote."""
    if any(sign in text for sign in ',"\n'):
        return '"' + text.replace('"', '""') + '"'
    return text
