"""Motions of a tree: knots, joined by straight lines or by smooth pieces.

What moves by itself has knots of its own in time: `together` joins such paths at the
union of their knots.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.proof.packed_tree import Motion


@dataclass(frozen=True)
class Path:
    """Knots q, and control points between them (polynomials in Bernstein form).

    Args:
        knots: Shape (n_rows, n_columns), at least one row; [rad], [m].
        inner: Control points between two knots, shape (n_rows - 1, degree - 1,
            n_columns); none for straight lines.
        times: Of the knots, rising, shape (n_rows,); [s]. None where not known.

    Raises:
        ValueError: If shapes disagree, a value is not finite, times do not rise, or the
            degree is not 1, 3 or 5.
    """

    knots: FloatArray
    inner: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 0)))
    times: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays and check their shapes."""
        knots, inner = frozen(self.knots), frozen(self.inner)
        if knots.ndim != 2 or not len(knots):
            message = f"knots have shape {knots.shape}, expected (n_rows, n_columns)"
            raise ValueError(message)
        if inner.size == 0:
            inner = frozen(np.zeros((0, 0, knots.shape[1])))
        elif inner.shape not in [(len(knots) - 1, d, knots.shape[1]) for d in (2, 4)]:
            message = (
                f"control points have shape {inner.shape}, "
                f"expected ({len(knots) - 1}, 2 or 4, {knots.shape[1]})"
            )
            raise ValueError(message)
        if not (np.isfinite(knots).all() and np.isfinite(inner).all()):
            message = "a path has a value that is not finite"
            raise ValueError(message)
        if self.times is not None:
            object.__setattr__(self, "times", frozen(_rising(self.times, len(knots))))
        object.__setattr__(self, "knots", knots)
        object.__setattr__(self, "inner", inner)

    @property
    def degree(self) -> int:
        """Of the pieces: 1, 3 or 5."""
        return int(self.inner.shape[1]) + 1

    @property
    def controls(self) -> FloatArray:
        """All control points, shape (n_rows - 1, degree + 1, n_columns)."""
        ends = self.knots[:-1, None], self.knots[1:, None]
        shape = len(self.knots) - 1, self.degree - 1, self.knots.shape[1]
        inner = self.inner.reshape(shape)
        return np.concatenate([ends[0], inner, ends[1]], axis=1)

    @property
    def n_intervals(self) -> int:
        """Number of pieces; a single row counts as one at rest."""
        return max(1, len(self.knots) - 1)

    @property
    def reach(self) -> FloatArray:
        """How large each column gets at most, shape (n_columns,)."""
        most = np.abs(self.knots).max(axis=0)
        if self.inner.size:
            most = np.maximum(most, np.abs(self.inner).max(axis=(0, 1)))
        return np.asarray(most)

    def packed(self) -> Motion:
        """The same for compiled code."""
        return Motion(self.knots, self.inner)


def _rising(times: FloatArray, n_rows: int) -> FloatArray:
    """Times of so many rows.

    Raises:
        ValueError: If they do not rise, or there are more or fewer.
    """
    found = np.asarray(times, dtype=np.float64)
    if found.shape != (n_rows,) or not np.isfinite(found).all():
        message = f"times have shape {found.shape}, expected ({n_rows},), all finite"
        raise ValueError(message)
    if not (np.diff(found) > 0.0).all():
        message = "times must rise from knot to knot"
        raise ValueError(message)
    return found


def _raised(controls: FloatArray, degree: int) -> FloatArray:
    """The same polynomials by control points of a higher degree."""
    while controls.shape[1] <= degree:
        n = controls.shape[1]
        share = (np.arange(1, n) / n)[:, None]
        between = share * controls[:, :-1] + (1.0 - share) * controls[:, 1:]
        controls = np.concatenate([controls[:, :1], between, controls[:, -1:]], axis=1)
    return controls


def _part(controls: FloatArray, start: float, end: float) -> FloatArray:
    """Control points of a piece, shape (degree + 1, n), over a part of [0, 1]."""
    points = controls.copy()
    degree = len(points) - 1
    for level in range(degree):
        points[level + 1 :] = points[level:-1] + end * np.diff(points[level:], axis=0)
    share = start / end
    for level in range(degree, 0, -1):
        points[:level] += share * (points[1 : level + 1] - points[:level])
    return points


def _resampled(path: Path, times: FloatArray, degree: int) -> FloatArray:
    """Control points of a path between given times, at rest outside of its own."""
    assert path.times is not None
    own, pieces = path.times, _raised(path.controls, degree)
    found = np.zeros((len(times) - 1, degree + 1, path.knots.shape[1]))
    after = np.searchsorted(own, times[:-1], side="right")
    for k, (start, end) in enumerate(pairwise(times)):
        at = after[k] - 1
        if at < 0 or at >= len(own) - 1:
            found[k] = path.knots[min(max(at, 0), len(own) - 1)]
            continue
        if own[at] == start and own[at + 1] == end:
            found[k] = pieces[at]
            continue
        step = own[at + 1] - own[at]
        shares = (start - own[at]) / step, min(1.0, (end - own[at]) / step)
        found[k] = _part(pieces[at], *shares)
    return found


def together(*paths: Path) -> Path:
    """One path of several that move at once: their columns side by side.

    It has the knots of all. Each rests before its first knot and after its last. Knots
    that are put in are off the path by a rounding.

    Args:
        paths: Each with times.

    Raises:
        ValueError: If one has no times.
    """
    if any(path.times is None for path in paths):
        message = "paths that move at once need times"
        raise ValueError(message)
    own = [path.times for path in paths if path.times is not None]
    times = np.unique(np.concatenate(own))
    degree = max(path.degree for path in paths)
    controls = np.concatenate([_resampled(p, times, degree) for p in paths], axis=2)
    last = controls[-1:, -1] if len(times) > 1 else _first_row(paths)
    knots = np.concatenate([controls[:, 0], last])
    return Path(knots, controls[:, 1:-1], times)


def _first_row(paths: tuple[Path, ...]) -> FloatArray:
    """The first rows side by side, shape (1, n_columns)."""
    return np.concatenate([path.knots[:1] for path in paths], axis=1)


def cubic_path(q: FloatArray, rates: FloatArray, times: FloatArray) -> Path:
    """Cubic Hermite pieces, as trajectory controllers run them.

    Args:
        q: Knots, shape (n_rows, n_columns); [rad], [m].
        rates: Their rates, the same shape; per [s].
        times: Of the knots, rising, shape (n_rows,); [s].
    """
    q, rates, step = _checked(q, rates, times)
    before, after = step * rates[:-1] / 3.0, step * rates[1:] / 3.0
    inner = np.stack([q[:-1] + before, q[1:] - after], axis=1)
    return Path(q, inner, times)


def quintic_path(
    q: FloatArray, rates: FloatArray, changes: FloatArray, times: FloatArray
) -> Path:
    """Quintic Hermite pieces.

    Args:
        q: Knots, shape (n_rows, n_columns); [rad], [m].
        rates: Their rates, the same shape; per [s].
        changes: Their accelerations, the same shape; per [s^2].
        times: Of the knots, rising, shape (n_rows,); [s].
    """
    q, rates, step = _checked(q, rates, times)
    changes = np.asarray(changes, dtype=np.float64)
    if changes.shape != q.shape:
        message = f"accelerations have shape {changes.shape}, expected {q.shape}"
        raise ValueError(message)
    before, after = step * rates[:-1] / 5.0, step * rates[1:] / 5.0
    bend, bend_after = step**2 * changes[:-1] / 20.0, step**2 * changes[1:] / 20.0
    inner = [
        q[:-1] + before,
        q[:-1] + 2.0 * before + bend,
        q[1:] - 2.0 * after + bend_after,
        q[1:] - after,
    ]
    return Path(q, np.stack(inner, axis=1), times)


def _checked(
    q: FloatArray, rates: FloatArray, times: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arrays of the same shape, and the durations, shape (n_rows - 1, 1).

    Raises:
        ValueError: If shapes disagree or times do not rise.
    """
    q, rates = np.asarray(q, dtype=np.float64), np.asarray(rates, dtype=np.float64)
    if rates.shape != q.shape:
        message = f"rates have shape {rates.shape}, expected {q.shape}"
        raise ValueError(message)
    return q, rates, np.diff(_rising(times, len(q)))[:, None]
