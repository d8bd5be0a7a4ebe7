"""Compiled Step 5 across the rail: an arm of straight pieces, and its least move.

The joints between the pieces (knots) move along one axis, each by its share: one of
them, or the two at the ends of a link that is laid past the obstacle.
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.paper.region_kernels import keeps_out

SCAN: Final = 12
"""Moves of the bend tried before the first clear one is narrowed down."""

HALVINGS: Final = 24
"""Rounds of bisection: 2 m / 12 / 2^24 is 1e-8 m, far below every margin."""


class Passing(NamedTuple):
    """What an arm of straight pieces passes, in the view (x, w)."""

    corners: FloatArray
    """Of the region, shape (m, 2); [m]."""

    radii: FloatArray
    """Of the region for each straight piece, shape (k,); [m]."""

    lengths: FloatArray
    """Of the straight pieces, shape (k,); [m]."""

    axis: int
    """0 where w is y, 1 where w is z."""


class Bends(NamedTuple):
    """Arms of straight pieces, in the projection."""

    knots: FloatArray
    """Joints between the pieces, shape (n, k - 1, 2); P_1 is the origin; [m]."""

    tips: FloatArray
    """P_{N+1}, shape (n, 2); [m]."""

    tip_x: FloatArray
    """x of the tip, shape (n,); [m]."""

    shares: FloatArray
    """Part of the move that each knot makes, shape (n, k - 1); [-]."""


@compiled
def _clear(passing: Passing, bends: Bends, row: int, moved: float) -> bool:
    """Whether one arm stays out of the region, its knots moved along the axis."""
    axis, lengths, knots = passing.axis, passing.lengths, bends.knots[row]
    tip, x = bends.tips[row], bends.tip_x[row]
    along, across = tip[axis], tip[1 - axis]
    for i in range(lengths.shape[0] - 1, -1, -1):
        next_along, next_across = 0.0, 0.0
        if i > 0:
            next_along = knots[i - 1, axis] + moved * bends.shares[row, i - 1]
            next_across = knots[i - 1, 1 - axis]
        square = lengths[i] ** 2 - (along - next_along) ** 2
        square -= (across - next_across) ** 2
        if not square > 0.0:
            return False
        next_x = x - np.sqrt(square)
        radius = passing.radii[i]
        if not keeps_out(passing.corners, radius, next_x, next_along, x, along):
            return False
        x, along, across = next_x, next_along, next_across
    return True


@compiled
def clear_bends(passing: Passing, bends: Bends) -> BoolArray:
    """Which arms stay out of the region, shape (n,)."""
    able = np.zeros(len(bends.tips), np.bool_)
    for k in range(len(able)):
        able[k] = _clear(passing, bends, k, 0.0)
    return able


@compiled
def least_moves(passing: Passing, bends: Bends, farthest: FloatArray) -> FloatArray:
    """Smallest moves of the knots that clear the region, shape (n,); nan for none.

    Args:
        passing: What is passed.
        bends: The arms before they move.
        farthest: Signed largest move along the axis, shape (n,); [m].
    """
    moves = np.full(len(farthest), np.nan)
    for k in range(len(farthest)):
        low, high = 0.0, np.nan
        for step in range(1, SCAN + 1):
            part = step / SCAN
            if _clear(passing, bends, k, part * farthest[k]):
                high = part
                break
            low = part
        if np.isnan(high):
            continue
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if _clear(passing, bends, k, middle * farthest[k]):
                high = middle
            else:
                low = middle
        moves[k] = high * farthest[k]
    return moves
