"""Motions of a tree: knots, joined by straight lines or by smooth pieces."""

from dataclasses import dataclass, field

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

    Raises:
        ValueError: If shapes disagree, a value is not finite, or the degree is not 1, 3
            or 5.
    """

    knots: FloatArray
    inner: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 0)))

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
        object.__setattr__(self, "knots", knots)
        object.__setattr__(self, "inner", inner)

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


def cubic_path(q: FloatArray, rates: FloatArray, times: FloatArray) -> Path:
    """Cubic Hermite pieces, as trajectory controllers run them.

    Args:
        q: Knots, shape (n_rows, n_columns); [rad], [m].
        rates: Their rates, the same shape; per [s].
        times: Of the knots, rising, shape (n_rows,); [s].
    """
    q, rates, step = _checked(q, rates, times)
    before, after = step * rates[:-1] / 3.0, step * rates[1:] / 3.0
    return Path(q, np.stack([q[:-1] + before, q[1:] - after], axis=1))


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
    return Path(q, np.stack(inner, axis=1))


def _checked(
    q: FloatArray, rates: FloatArray, times: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arrays of the same shape, and the durations, shape (n_rows - 1, 1).

    Raises:
        ValueError: If shapes disagree or times do not rise.
    """
    q, rates = np.asarray(q, dtype=np.float64), np.asarray(rates, dtype=np.float64)
    step = np.diff(np.asarray(times, dtype=np.float64))
    if rates.shape != q.shape or len(step) != len(q) - 1:
        message = f"q {q.shape}, rates {rates.shape} and times disagree"
        raise ValueError(message)
    if not (step > 0.0).all():
        message = "times must rise from knot to knot"
        raise ValueError(message)
    return q, rates, step[:, None]
