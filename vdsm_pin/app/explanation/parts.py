"""What a step of the paper did at one waypoint: sentences, tables, pictures."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.steps import PaperSteps
from vdsm_pin.planner.records import Plan
from vdsm_pin.units import MM_PER_M, point_mm, signed

SUBSCRIPTS: Final = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


@dataclass(frozen=True)
class Table:
    """Rows of numbers that are written already.

    Args:
        head: Names of the columns.
        rows: Cells, as many in each as there are columns.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Step:
    """One step.

    Args:
        title: Its name in the paper.
        source: Section and equations of the paper.
        words: What was done, one sentence each.
        tables: Its numbers.
        pictures: Its drawings, as SVG.
    """

    title: str
    source: str
    words: tuple[str, ...]
    tables: tuple[Table, ...] = ()
    pictures: tuple[str, ...] = ()


@dataclass(frozen=True)
class Moment:
    """A plan of the paper's rule at one waypoint.

    Args:
        plan: The plan.
        steps: What its steps found.
        row: The waypoint, from 0.
    """

    plan: Plan
    steps: PaperSteps
    row: int

    @property
    def former(self) -> int:
        """The waypoint before; the first one has itself."""
        return max(self.row - 1, 0)

    @property
    def planar(self) -> FloatArray:
        """P_1..P_{N+1} of Step 5, shape (N + 1, 2); [m]."""
        return np.asarray(self.steps.planar[self.row])

    @property
    def reference(self) -> FloatArray:
        """P_1..P_{N+1} of Step 3, shape (N + 1, 2); [m]."""
        return np.asarray(self.steps.reference[self.row])

    @property
    def centres(self) -> FloatArray:
        """O_1..O_{N+1} of Step 6, shape (N + 1, 3); [m]."""
        return np.asarray(self.steps.centres[self.row])


def name(letter: str, number: int) -> str:
    """A symbol with its number below, as P₈."""
    return letter + str(number).translate(SUBSCRIPTS)


def mm(value: float) -> str:
    """A length in mm, three decimals."""
    return signed(f"{value * MM_PER_M:.3f}")


def deg(value: float) -> str:
    """An angle in degrees, three decimals."""
    return signed(f"{np.rad2deg(value):.3f}")


def at(point: FloatArray) -> str:
    """A point in mm."""
    return f"({point_mm(point)})"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """A table of cells."""
    return Table(tuple(head), tuple(tuple(row) for row in rows))
