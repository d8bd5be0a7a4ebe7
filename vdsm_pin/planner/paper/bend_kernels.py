"""Compiled Step 5 across the rail: an arm of straight pieces, and its least move.

The joints between the pieces (knots) all move by the same way along one axis: one of
them, or the two at the ends of a link that is laid past the obstacle.
"""

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.paper.region_kernels import keeps_out


@compiled
def _clear(
    corners: FloatArray,
    radii: FloatArray,
    lengths: FloatArray,
    axis: int,
    knots: FloatArray,
    moved: float,
    tip: FloatArray,
    tip_x: float,
) -> bool:
    """`clear_bends` for one arm, its knots moved along the axis."""
    x, along, across = tip_x, tip[axis], tip[1 - axis]
    for i in range(lengths.shape[0] - 1, -1, -1):
        next_along, next_across = 0.0, 0.0
        if i > 0:
            next_along = knots[i - 1, axis] + moved
            next_across = knots[i - 1, 1 - axis]
        square = lengths[i] ** 2 - (along - next_along) ** 2
        square -= (across - next_across) ** 2
        if not square > 0.0:
            return False
        next_x = x - np.sqrt(square)
        if not keeps_out(corners, radii[i], next_x, next_along, x, along):
            return False
        x, along, across = next_x, next_along, next_across
    return True


@compiled
def clear_bends(
    corners: FloatArray,
    radii: FloatArray,
    lengths: FloatArray,
    axis: int,
    knots: FloatArray,
    tips: FloatArray,
    tip_x: FloatArray,
) -> BoolArray:
    """Which arms of straight pieces stay out of the region, shape (n,).

    Args:
        corners: Of the region in the view (x, w), shape (m, 2); [m].
        radii: Of the region for each straight piece, shape (k,); [m].
        lengths: Of the straight pieces, shape (k,); [m].
        axis: 0 where w is y, 1 where w is z.
        knots: Projected joints between the pieces, shape (n, k - 1, 2); P_1 is the
            origin; [m].
        tips: Projected tip P_{N+1}, shape (n, 2); [m].
        tip_x: x of the tip, shape (n,); [m].
    """
    able = np.zeros(len(tips), np.bool_)
    for k in range(len(tips)):
        able[k] = _clear(
            corners, radii, lengths, axis, knots[k], 0.0, tips[k], tip_x[k]
        )
    return able


@compiled
def least_moves(
    corners: FloatArray,
    radii: FloatArray,
    lengths: FloatArray,
    axis: int,
    knots: FloatArray,
    tips: FloatArray,
    tip_x: FloatArray,
    farthest: FloatArray,
    scan: int,
    halvings: int,
) -> FloatArray:
    """Smallest moves of the knots that clear the region, shape (n,); nan for none.

    Args:
        corners: As in `clear_bends`, and all up to `tip_x`.
        radii: As there.
        lengths: As there.
        axis: As there.
        knots: As there.
        tips: As there.
        tip_x: As there.
        farthest: Signed largest move along the axis, shape (n,); [m].
        scan: Moves tried before the first clear one is narrowed down.
        halvings: Rounds of bisection.
    """
    moves = np.full(len(tips), np.nan)
    for k in range(len(tips)):
        low, high = 0.0, np.nan
        for step in range(1, scan + 1):
            part = step / scan
            move = part * farthest[k]
            if _clear(corners, radii, lengths, axis, knots[k], move, tips[k], tip_x[k]):
                high = part
                break
            low = part
        if np.isnan(high):
            continue
        for _ in range(halvings):
            middle = 0.5 * (low + high)
            move = middle * farthest[k]
            if _clear(corners, radii, lengths, axis, knots[k], move, tips[k], tip_x[k]):
                high = middle
            else:
                low = middle
        moves[k] = high * farthest[k]
    return moves
