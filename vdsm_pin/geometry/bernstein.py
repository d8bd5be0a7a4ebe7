"""Polynomials by their control points (Bernstein form), many at a time.

Control points have shape (m, degree + 1, n_columns). The polynomial lies in their
convex hull, so that what holds of all of them holds of every instant.
"""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray


def value(controls: FloatArray, shares: FloatArray) -> FloatArray:
    """Each polynomial at a share of its own, 0 to 1, shape (m,): (m, n_columns)."""
    share, points = shares[:, None, None], controls
    while points.shape[1] > 1:
        points = points[:, :-1] + share * np.diff(points, axis=1)
    return np.asarray(points[:, 0])


def derivative(controls: FloatArray) -> FloatArray:
    """Control points of the derivatives by the share, (m, degree, n_columns)."""
    return np.asarray((controls.shape[1] - 1) * np.diff(controls, axis=1))


def raised(controls: FloatArray, degree: int) -> FloatArray:
    """The same polynomials by control points of a higher degree."""
    while controls.shape[1] <= degree:
        n = controls.shape[1]
        share = (np.arange(1, n) / n)[:, None]
        between = share * controls[:, :-1] + (1.0 - share) * controls[:, 1:]
        controls = np.concatenate([controls[:, :1], between, controls[:, -1:]], axis=1)
    return controls


def part(controls: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """The same polynomials over parts of [0, 1] by control points of their own.

    Args:
        controls: Shape (m, degree + 1, n_columns).
        start: Where each part begins, below its end, shape (m,).
        end: Where it ends, shape (m,).
    """
    points, degree = controls.copy(), controls.shape[1] - 1
    for level in range(degree):
        steps = np.diff(points[:, level:], axis=1)
        points[:, level + 1 :] = points[:, level:-1] + end[:, None, None] * steps
    share = (start / end)[:, None, None]
    for level in range(degree, 0, -1):
        points[:, :level] += share * np.diff(points[:, : level + 1], axis=1)
    return points


def hermite(
    values: FloatArray, rates: FloatArray, changes: FloatArray | None, times: FloatArray
) -> FloatArray:
    """Inner control points of the pieces that trajectory controllers run.

    Args:
        values: Shape (n, n_columns).
        rates: Their first derivatives, the same shape; per [s].
        changes: Their second ones, the same shape; per [s^2]. None for cubic pieces.
        times: Rising, shape (n,); [s].

    Returns:
        Shape (n - 1, 2, n_columns) of cubic pieces, (n - 1, 4, n_columns) of quintic.
    """
    step = np.diff(times)[:, None]
    degree = 3.0 if changes is None else 5.0
    before, after = step * rates[:-1] / degree, step * rates[1:] / degree
    ends = values[:-1] + before, values[1:] - after
    if changes is None:
        return np.stack(ends, axis=1)
    bend, bend_after = step**2 * changes[:-1] / 20.0, step**2 * changes[1:] / 20.0
    inner = (values[:-1] + 2.0 * before + bend, values[1:] - 2.0 * after + bend_after)
    return np.stack([ends[0], *inner, ends[1]], axis=1)
