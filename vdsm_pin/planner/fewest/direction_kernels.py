"""Compiled: configurations by the directions of their links, whichever way these lean.

The chart of projections (`motion.py`) ends where a link stands square to the rail. Here
a configuration is its tip and the direction of each link. Between two of them
directions go along chords of the sphere, and all links turn a little more, so that the
base is on its rail: Newton's method, each step the smallest that does.
"""

from math import sqrt

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.offset_kernels import Lines
from vdsm_pin.tolerances import TOLERANCES

ROUNDS = 30
"""Newton steps at which a configuration is given up."""
ENOUGH = 4e-15
"""Distance of the base from its rail over the arm's length that is rounding; [-]."""

ROUNDING = TOLERANCES.planned_limit
"""Way past an end of the rail that counts as on it; [m]."""

STRAIGHT = TOLERANCES.changed_angle
"""Difference of directions up to which a joint may be put in line with others; [-]."""

COPIED, TURNED, ALIGNED = 0.05, 0.75, 0.87
"""Up to where a child is its parent, has some links turned, has a link in line with the
one before; beyond, with the one after; [-]."""


@compiled
def _solved(matrix: FloatArray, right: FloatArray, size: int) -> bool:
    """Solve a small positive definite system in place; False where it is singular."""
    for k in range(size):
        if not matrix[k, k] > 0.0:
            return False
        for r in range(k + 1, size):
            part = matrix[r, k] / matrix[k, k]
            for c in range(k, size):
                matrix[r, c] -= part * matrix[k, c]
            right[r] -= part * right[k]
    for k in range(size - 1, -1, -1):
        for c in range(k + 1, size):
            right[k] -= matrix[k, c] * right[c]
        right[k] /= matrix[k, k]
    return True


@compiled
def _normalised(axes: FloatArray) -> None:
    """Make every row a unit vector."""
    for i in range(axes.shape[0]):
        size = sqrt(axes[i, 0] ** 2 + axes[i, 1] ** 2 + axes[i, 2] ** 2)
        for c in range(3):
            axes[i, c] /= size


@compiled
def _solve_base(
    tip: FloatArray, axes: FloatArray, lengths: FloatArray, x: float, size: int
) -> float:
    """Turn directions until the base has y = z = 0, and x too if all three are asked.

    Args:
        tip: Shape (3,); [m].
        axes: Directions of the links, changed in place, shape (N, 3); [-].
        lengths: Of the links, shape (N,); [m].
        x: Where the base shall be along the rail; [m].
        size: 2 where x counts for nothing, else 3.

    Returns:
        x of the base, NaN where there is no such turn; [m].
    """
    lack, matrix, base = np.zeros(3), np.zeros((3, 3)), np.nan
    for _ in range(ROUNDS):
        for c in range(3):
            # The order is y, z, x.
            a = (c + 1) % 3
            lack[c] = tip[a]
            for i in range(lengths.size):
                lack[c] -= lengths[i] * axes[i, a]
        base, lack[2] = lack[2], lack[2] - x if size == 3 else 0.0
        off = abs(lack[0]) + abs(lack[1]) + abs(lack[2])
        if not off > ENOUGH * lengths.sum():
            return float(base)
        matrix[:] = 0.0
        for i in range(lengths.size):
            square = lengths[i] * lengths[i]
            for r in range(size):
                a = axes[i, (r + 1) % 3]
                matrix[r, r] += square
                for c in range(size):
                    matrix[r, c] -= square * a * axes[i, (c + 1) % 3]
        if not _solved(matrix, lack, size):
            return np.nan
        for i in range(lengths.size):
            along = 0.0
            for r in range(size):
                along += axes[i, (r + 1) % 3] * lack[r]
            for r in range(3):
                pull = lack[r] if r < size else 0.0
                c = (r + 1) % 3
                axes[i, c] += lengths[i] * (pull - along * axes[i, c])
        _normalised(axes)
    return float(base) if off <= 4.0 * ENOUGH * lengths.sum() else np.nan


@compiled
def _on_rail(
    tip: FloatArray, axes: FloatArray, lengths: FloatArray, low: float, high: float
) -> bool:
    """Turn directions until the base is on its rail.

    First the base is brought onto the line of the rail; from there, if it is past an
    end, to that end. So the result changes steadily with what it begins with.

    Args:
        tip: Shape (3,); [m].
        axes: Directions of the links, changed in place, shape (N, 3); [-].
        lengths: Of the links, shape (N,); [m].
        low: Smallest x0; [m].
        high: Largest x0; [m].

    Returns:
        Whether it is.
    """
    x = _solve_base(tip, axes, lengths, 0.0, 2)
    # No straight arm can be brought back from a rounding past an end: `placed_between`
    # holds the base there.
    if low - ROUNDING <= x <= high + ROUNDING:
        return True
    if np.isnan(x):
        return False
    return not np.isnan(_solve_base(tip, axes, lengths, min(max(x, low), high), 3))


@compiled
def mutated_directions(
    axes: FloatArray,
    first: FloatArray,
    count: FloatArray,
    kind: FloatArray,
    turn: FloatArray,
) -> FloatArray:
    """Children of arms given by directions, one each; the base may be off its rail.

    Args:
        axes: Directions of the links, shape (n, N, 3); [-].
        first: The first link to turn, as a number in [0, 1), shape (n,).
        count: How many of those after it turn too, as a number in [0, 1), shape (n,).
        kind: What to do, as a number in [0, 1), shape (n,).
        turn: Rotation vector, shape (n, 3); [rad].

    Returns:
        Shape (n, N, 3).
    """
    result = axes.copy()
    n_links = axes.shape[1]
    for r in range(axes.shape[0]):
        if kind[r] < COPIED:
            continue
        a = int(first[r] * n_links)
        b = a + 1 + int(count[r] * (n_links - a))
        row, w = result[r], turn[r]
        if kind[r] > TURNED:
            # In line with the link before, or with the one after.
            other = (
                a - 1 if a > 0 and (kind[r] < ALIGNED or a + 1 == n_links) else a + 1
            )
            row[a] = row[other]
            continue
        for i in range(a, b):
            x, y, z = row[i, 0], row[i, 1], row[i, 2]
            row[i, 0] = x + w[1] * z - w[2] * y
            row[i, 1] = y + w[2] * x - w[0] * z
            row[i, 2] = z + w[0] * y - w[1] * x
        _normalised(row)
    return result


@compiled
def _bends(axes: FloatArray, joint: int) -> bool:
    """Whether an arm given by directions, shape (N, 3), bends at a joint."""
    turn = 0.0
    for c in range(3):
        turn = max(turn, abs(axes[joint, c] - axes[joint - 1, c]))
    return turn > STRAIGHT


@compiled
def lined_up_directions(
    axes: FloatArray, lengths: FloatArray, joint: int, way: int
) -> FloatArray:
    """Arms with one joint in line with its neighbours; see `Offsets.in_line`.

    The base may be off its rail.

    Args:
        axes: Directions of the links, shape (n, N, 3); [-].
        lengths: Of the links, shape (N,); [m].
        joint: The joint, counted from 0.
        way: As in `lined_up`.

    Returns:
        Shape (n, N, 3).
    """
    result = axes.copy()
    for r in range(axes.shape[0]):
        row, low, high = result[r], joint - 1, joint + 1
        while low > 0 and not _bends(row, low):
            low -= 1
        while high < lengths.size and not _bends(row, high):
            high += 1
        if way == 0:
            chord = np.zeros(3)
            for i in range(low, high):
                chord += lengths[i] * row[i]
            row[low:high] = chord
            _normalised(row[low:high])
        elif _bends(row, joint) and way > 0 and high < lengths.size:
            row[joint:high] = row[joint - 1].copy()
        elif _bends(row, joint) and way < 0 and low > 0:
            row[low:joint] = row[joint].copy()
    return result


@compiled
def placed_between(
    lines: Lines,
    interval: IntArray,
    share: FloatArray,
    lengths: FloatArray,
    base_range: tuple[float, float],
) -> FloatArray:
    """Joint centres at places of intervals given by directions.

    Args:
        lines: The intervals.
        interval: Interval of each place, shape (r,).
        share: Where in its interval, 0 to 1, shape (r,).
        lengths: Of the links, shape (N,); [m].
        base_range: Smallest and largest x0; [m].

    Returns:
        Shape (r, N + 1, 3), NaN where the base cannot be on its rail; [m].
    """
    tips, next_tips = lines.tips, lines.next_tips
    axes, next_axes = borrowed(lines.offsets), borrowed(lines.next_offsets)
    count, (low, high) = lengths.size, base_range
    centres = np.full((interval.size, count + 1, 3), np.nan)
    for r in range(interval.size):
        a, t = interval[r], share[r]
        tip = (1.0 - t) * tips[a] + t * next_tips[a]
        turned = (1.0 - t) * axes[a] + t * next_axes[a]
        _normalised(turned)
        if not _on_rail(tip, turned, lengths, low, high):
            continue
        centres[r, count] = tip
        for i in range(count - 1, -1, -1):
            for c in range(3):
                centres[r, i, c] = centres[r, i + 1, c] - lengths[i] * turned[i, c]
        centres[r, 0, 1] = centres[r, 0, 2] = 0.0
        centres[r, 0, 0] = min(max(centres[r, 0, 0], low), high)
    return centres
