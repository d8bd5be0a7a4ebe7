"""Extremes of a motion over its intervals, not at its rows only.

A measure of joint values is largest at an end of every straight line. So the control
points of a smooth piece bound it there, and pieces are cut where they do not decide.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, nan
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bernstein import part
from vdsm_pin.proof.paths import Path
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.records import Check, Verdict

CHUNK: Final = 65_536
"""Rows treated at once, so that memory stays bounded."""

CUTS: Final = 5
"""How often a smooth piece is halved that may hold the largest value: the control
points of its parts lie within a thousandth of its bulge of the curve."""

PARTS: Final = 2**CUTS

MOST_CUTS: Final = 20
"""How often it is halved where a limit is not decided before."""

Measure: TypeAlias = Callable[[FloatArray], FloatArray]
"""Of rows of joint values (m, n_columns), shape (m, n)."""

Pieces: TypeAlias = Iterable[tuple[int, FloatArray]]
"""Control points of some pieces, shape (m, degree + 1, n_columns), and the number of
the first one. A row by itself is a piece of degree 0."""


@dataclass(frozen=True)
class Largest:
    """The largest value of a measure that was seen, and a bound of it.

    Args:
        seen: At a moment of the motion.
        moment: That moment, in waypoints.
        column: Which of the values of the measure it is, from 0.
        bound: From above over the whole motion.
    """

    seen: float = -inf
    moment: float = nan
    column: int = 0
    bound: float = -inf

    def larger(self, values: FloatArray, moments: FloatArray | IntArray) -> "Largest":
        """This, or the largest of values (m, n) seen at moments (m,)."""
        at, column = np.unravel_index(int(np.argmax(values)), values.shape)
        value = float(values[at, column])
        if not value > self.seen:
            return self
        bound = np.fmax(self.bound, value)
        return Largest(value, float(moments[at]), int(column), float(bound))

    def bounded(self, values: FloatArray) -> "Largest":
        """The same where the measure may be as large as some values; NaN may be all."""
        return replace(self, bound=float(np.max(values, initial=self.bound)))

    def verdict(self, limit: float) -> Verdict:
        """What this says of a limit."""
        if self.bound <= limit:
            return Verdict.CERTIFIED
        return Verdict.UNDECIDED if self.seen <= limit else Verdict.REFUTED

    def worst(self, limit: float) -> float:
        """The value that decides."""
        return self.bound if self.bound <= limit else self.seen


def pieces_of(path: Path) -> Iterator[tuple[int, FloatArray]]:
    """What joins the rows of a motion; of straight lines the rows alone."""
    if path.degree == 1:
        for first in range(0, path.n_samples, CHUNK):
            yield first, path.knots[first : first + CHUNK, None]
        return
    step = CHUNK // PARTS
    for first in range(0, path.n_intervals, step):
        numbers = np.arange(first, min(first + step, path.n_intervals))
        yield first, path.pieces(numbers)


def cut(controls: FloatArray) -> FloatArray:
    """Control points of all parts of some pieces, one piece after the other."""
    edges = np.tile(np.arange(PARTS), len(controls)) / PARTS
    return part(np.repeat(controls, PARTS, axis=0), edges, edges + 1.0 / PARTS)


def extremes(path: Path, measures: Sequence[Measure]) -> list[float]:
    """Largest values of some measures over a motion, none too small.

    Args:
        path: The motion.
        measures: Of its rows; largest at an end of every straight line.
    """
    found = [Largest() for _ in measures]
    for first, controls in pieces_of(path):  # with no limit that would be enough
        both = zip(found, measures, strict=True)
        found = [_with_pieces(one, first, controls, of, nan) for one, of in both]
    return [one.bound for one in found]


def largest(pieces: Pieces, measure: Measure, limit: float) -> Largest:
    """Largest value of a measure over a motion.

    Args:
        pieces: Of the motion.
        measure: Of its rows; largest at an end of every straight line.
        limit: What it is held against; NaN where only the value matters.
    """
    found = Largest()
    for first, controls in pieces:
        found = _with_pieces(found, first, controls, measure, limit)
    return found


def _with_pieces(
    found: Largest, first: int, controls: FloatArray, measure: Measure, limit: float
) -> Largest:
    """The largest value, some pieces included."""
    start, width = first + np.arange(float(len(controls))), 1.0
    if controls.shape[1] == 1:  # rows, between which nothing is larger
        values = measure(controls[:, 0]).reshape(len(start), -1)
        return found.larger(values, start).bounded(values)
    for cut in range(MOST_CUTS + 1):
        values = measure(controls.reshape(-1, controls.shape[2]))
        values = values.reshape(*controls.shape[:2], -1)
        found = found.larger(values[:, 0], start).larger(values[:, -1], start + width)
        most = values.max(axis=(1, 2))
        enough = found.seen + TOLERANCES.arithmetic
        may_be_larger = ~(most <= (enough if cut < CUTS else max(enough, limit)))
        settled = cut >= CUTS and found.seen > limit
        if settled or cut == MOST_CUTS or not may_be_larger.any():
            break
        found = found.bounded(most[~may_be_larger])
        width *= 0.5
        halves = np.repeat(controls[may_be_larger], 2, axis=0)
        low = np.tile([0.0, 0.5], len(halves) // 2)
        controls = part(halves, low, low + 0.5)
        start = np.repeat(start[may_be_larger], 2) + 2.0 * width * low
    return found.bounded(most)


def range_checks(
    path: Path,
    columns: IntArray,
    ends: FloatArray,
    slack: float,
    rows: Sequence[Check],
) -> list[Check]:
    """Whether columns keep within their ranges: what comes nearest to an end of each.

    Args:
        path: The motion.
        columns: Which ones, shape (n,).
        ends: Of their ranges, shape (n, 2); [m] or [rad].
        slack: How far beyond its ends is allowed; [m] or [rad].
        rows: What is said besides, one each.
    """
    if path.degree > 1:
        each = zip(columns.tolist(), ends, strict=True)
        found = [largest(pieces_of(path), _beyond(*one), slack) for one in each]
    else:
        found = _of_rows(path.knots[:, columns], ends)
    checks = []
    for row, one, (low, high) in zip(rows, found, ends.tolist(), strict=True):
        worst, limit = one.worst(slack), low if one.column else high
        value = low - worst if one.column else high + worst
        verdict, moment = one.verdict(slack), one.moment
        checks.append(
            replace(row, verdict=verdict, worst=value, limit=limit, moment=moment)
        )
    return checks


def _beyond(column: int, ends: FloatArray) -> Measure:
    """How far a column is beyond the upper and the lower end of its range."""
    low, high = ends

    def beyond(q: FloatArray) -> FloatArray:
        return np.stack([q[:, column] - high, low - q[:, column]], axis=1)

    return beyond


def _of_rows(values: FloatArray, ends: FloatArray) -> list[Largest]:
    """How far each column is beyond an end of its range at most, of straight lines."""
    above, below = values.argmax(axis=0), values.argmin(axis=0)
    number = np.arange(values.shape[1])
    over, under = values[above, number] - ends[:, 1], ends[:, 0] - values[below, number]
    found = []
    for k, is_low in enumerate((under > over).tolist()):
        seen, row = (under[k], below[k]) if is_low else (over[k], above[k])
        found.append(Largest(float(seen), float(row), int(is_low), float(seen)))
    return found
