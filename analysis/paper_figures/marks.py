"""The named moments of a motion: A1.. and B1.. in the paper's Fig. 6."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from paper_figures.runs import Run
from paper_figures.style import subscript

CORNERS: Final = {1: "A₃", 2: "A₆", 3: "A₇", 4: "A₈"}
"""The paper's names of the square's corners; the path begins at A2."""


@dataclass(frozen=True)
class Mark:
    """A named moment.

    Args:
        name: As in the paper.
        row: Row of the trajectory.
    """

    name: str
    row: int


def marks(run: Run) -> tuple[Mark, ...]:
    """The named moments of a motion, in order.

    A4 is where the tip leaves the path on its way, or the arm changes sides, and A5
    where it takes the path up again. In obs2 the paper counts all moments: B1, B2..
    """
    rows = run.trajectory
    drawn = np.flatnonzero(rows.on_path)
    found = {0: "A₁", int(drawn[0]): "A₂", int(drawn[-1]): "A₉"}
    if not rows.on_path[-1]:
        found[rows.n_samples - 1] = "A₁₀"
    for corner, station in enumerate(run.problem.path.corner_stations[1:-1], start=1):
        gaps = np.abs(rows.path_m[drawn] - station)
        if gaps.min() <= run.problem.path.spacing:
            found[int(drawn[np.argmin(gaps)])] = CORNERS[corner]
    for leave in drawn[:-1][np.diff(drawn) > 1]:
        found[int(leave)] = "A₄"
        found[int(drawn[np.searchsorted(drawn, leave) + 1])] = "A₅"
    ordered = sorted(found.items())
    if run.scene.startswith("obs2"):
        return tuple(
            Mark("B" + subscript(k), row) for k, (row, _) in enumerate(ordered, 1)
        )
    return tuple(Mark(name, row) for row, name in ordered)


def row_of(run: Run, name: str) -> int:
    """The row of a named moment.

    Raises:
        KeyError: If this motion has no moment of that name.
    """
    return {mark.name: mark.row for mark in marks(run)}[name]
