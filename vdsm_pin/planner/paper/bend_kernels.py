"""Compiled Step 5 across the rail: an arm of one bend, and its least move."""

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.planner.paper.region_kernels import keeps_out


@compiled
def _clear(
    corners: FloatArray,
    radii: FloatArray,
    lengths: FloatArray,
    axis: int,
    bend: FloatArray,
    moved: float,
    tip: FloatArray,
    tip_x: float,
) -> bool:
    """`clear_bends` for one arm, its bend moved along the axis."""
    along, across = bend[axis] + moved, bend[1 - axis]
    first = lengths[0] ** 2 - along * along - across * across
    ahead, aside = tip[axis] - along, tip[1 - axis] - across
    second = lengths[1] ** 2 - ahead * ahead - aside * aside
    if not (first > 0.0 and second > 0.0):
        return False
    bend_x = tip_x - np.sqrt(second)
    base_x = bend_x - np.sqrt(first)
    return keeps_out(corners, radii[0], base_x, 0.0, bend_x, along) and keeps_out(
        corners, radii[1], bend_x, along, tip_x, tip[axis]
    )


@compiled
def clear_bends(
    corners: FloatArray,
    radii: FloatArray,
    lengths: FloatArray,
    axis: int,
    bends: FloatArray,
    tips: FloatArray,
    tip_x: FloatArray,
) -> BoolArray:
    """Which arms of one bend stay out of the region, shape (n,).

    Args:
        corners: Of the region in the view (x, w), shape (m, 2); [m].
        radii: Of the region for each straight piece, shape (2,); [m].
        lengths: Of the two straight pieces, shape (2,); [m].
        axis: 0 where w is y, 1 where w is z.
        bends: Projected bend P_b, shape (n, 2); P_1 is the origin; [m].
        tips: Projected tip P_{N+1}, shape (n, 2); [m].
        tip_x: x of the tip, shape (n,); [m].
    """
    able = np.zeros(len(tips), np.bool_)
    for k in range(len(tips)):
        able[k] = _clear(
            corners, radii, lengths, axis, bends[k], 0.0, tips[k], tip_x[k]
        )
    return able


@compiled
def least_moves(
    corners: FloatArray,
    radii: FloatArray,
    lengths: FloatArray,
    axis: int,
    bends: FloatArray,
    tips: FloatArray,
    tip_x: FloatArray,
    farthest: FloatArray,
    scan: int,
    halvings: int,
) -> FloatArray:
    """Smallest moves of the bends that clear the region, shape (n,); nan for none.

    Args:
        corners: As in `clear_bends`, and all up to `tip_x`.
        radii: As there.
        lengths: As there.
        axis: As there.
        bends: As there.
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
            if _clear(corners, radii, lengths, axis, bends[k], move, tips[k], tip_x[k]):
                high = part
                break
            low = part
        if np.isnan(high):
            continue
        for _ in range(halvings):
            middle = 0.5 * (low + high)
            move = middle * farthest[k]
            if _clear(corners, radii, lengths, axis, bends[k], move, tips[k], tip_x[k]):
                high = middle
            else:
                low = middle
        moves[k] = high * farthest[k]
    return moves
