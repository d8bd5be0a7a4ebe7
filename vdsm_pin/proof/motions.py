"""A motion of joints as compiled code reads it: what q is and how it moves between."""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray

DEGREE: Final = 5
"""Highest degree of a piece of a path."""


class Motion(NamedTuple):
    """Rows of q joined by polynomials in Bernstein form.

    Args:
        knots: Shape (n_rows, n_columns); [rad], [m].
        inner: Control points between two knots, shape (n_rows - 1, degree - 1,
            n_columns); of straight lines, degree 1, no rows either.
    """

    knots: FloatArray
    inner: FloatArray


@compiled
def interpolate(motion: Motion, k: int, t: float, q: FloatArray) -> None:
    """The configuration at time t of interval k; one row alone is an interval.

    Args:
        motion: Rows and what joins them.
        k: The interval.
        t: 0 to 1; both ends are the rows themselves.
        q: Written, shape (n_columns,).
    """
    knots, last = motion.knots, motion.knots.shape[0] - 1
    if t == 0.0 or t == 1.0 or k >= last:
        row = min(k + (1 if t == 1.0 else 0), last)
        q[:] = knots[row]
        return
    degree = motion.inner.shape[1] + 1
    if degree == 1:
        for c in range(q.size):
            q[c] = knots[k, c] + t * (knots[k + 1, c] - knots[k, c])
        return
    control = np.zeros(DEGREE + 1)
    for c in range(q.size):
        take_controls(motion, k, c, control)
        for level in range(degree, 0, -1):
            for i in range(level):
                control[i] += t * (control[i + 1] - control[i])
        q[c] = control[0]


@compiled
def take_controls(motion: Motion, k: int, column: int, control: FloatArray) -> None:
    """Control points of one column over interval k, the first degree + 1 entries."""
    inner = motion.inner.shape[1]
    control[0] = motion.knots[k, column]
    for i in range(inner):
        control[i + 1] = motion.inner[k, i, column]
    control[inner + 1] = motion.knots[k + 1, column]


@compiled
def largest_between(
    control: FloatArray, degree: int, start: float, end: float
) -> float:
    """Bound of a polynomial's size over [start, end], part of [0, 1].

    Args:
        control: Its control points over [0, 1], the first degree + 1; overwritten by
            those over [start, end], which hold it between them.
        degree: Its degree.
        start: 0 to 1.
        end: From `start` to 1.
    """
    if end < 1.0:
        for level in range(degree):
            for i in range(degree, level, -1):
                control[i] = control[i - 1] + end * (control[i] - control[i - 1])
    if start > 0.0:
        share = start / end
        for level in range(degree, 0, -1):
            for i in range(level):
                control[i] += share * (control[i + 1] - control[i])
    most = 0.0
    for i in range(degree + 1):
        most = max(most, abs(control[i]))
    return most


@compiled
def _steepen(control: FloatArray, degree: int) -> None:
    """Control points of the derivative, degree - 1, from those of a polynomial."""
    for i in range(degree):
        control[i] = degree * (control[i + 1] - control[i])


@compiled
def bound_column(
    motion: Motion, k: int, column: int, start: float, end: float, out: FloatArray
) -> None:
    """How far and how fast one column of q moves over a slice of interval k.

    Args:
        motion: Rows and what joins them; it has the row k + 1.
        k: The interval.
        column: The column.
        start: Start of the slice, 0 to 1.
        end: End of the slice.
        out: Bounds of |q|, |dq/dt| and |d2q/dt2|, t from 0 to 1 over the interval,
            shape (3,); written.
    """
    degree = motion.inner.shape[1] + 1
    if degree == 1:
        one, other = motion.knots[k, column], motion.knots[k + 1, column]
        out[0], out[1], out[2] = max(abs(one), abs(other)), abs(other - one), 0.0
        return
    control = np.zeros(DEGREE + 1)
    for derivative in range(3):
        take_controls(motion, k, column, control)
        for order in range(derivative):
            _steepen(control, degree - order)
        out[derivative] = largest_between(control, degree - derivative, start, end)
