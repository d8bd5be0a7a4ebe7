"""What one plane and one witness point prove of a block of intervals, compiled.

Arrays have the rows last: a few operations an interval, many at a time.
"""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.proof.layouts import OWN_POINT, POINT, SUPPORT
from vdsm_pin.proof.rows import BLOCK, Rows, Tracks, carry, to_frame, turn_axis
from vdsm_pin.proof.terms import Mover

MANY_ROWS: Final = 16
"""From so many rows on loops over rows are quicker than over corners."""


class Runs(NamedTuple):
    """A block's intervals for one pair: its bounds and what they are made of.

    Args:
        lower: Lower bounds, shape (BLOCK,); [m].
        upper: Upper bounds, at the nearer of the two rows, shape (BLOCK,); [m].
        at_rows: Core distances at the rows, shape (BLOCK + 1,); [m].
        growth: What errors add to n.corner, shape (corners, <= BLOCK); [m].
        axis: Axis of the disc in the partner's frame, shape (3, BLOCK + 1); [-].
        own: The witness on a body that is no segment, shape (3, BLOCK + 1); [m].
        toward: n in the world's frame, shape (3, BLOCK + 1); [-].
        work: Working space, shape (4, BLOCK + 1).
    """

    lower: FloatArray
    upper: FloatArray
    at_rows: FloatArray
    growth: FloatArray
    axis: FloatArray
    own: FloatArray
    toward: FloatArray
    work: FloatArray


@compiled
def new_runs(corners: int, block: int) -> Runs:
    """Fresh working space; where errors add nothing `growth` is to be 0.

    Args:
        corners: Most corners of a body.
        block: Most intervals whose rows are filled at once, BLOCK at most.
    """
    return Runs(
        np.zeros(BLOCK),
        np.zeros(BLOCK),
        np.zeros(BLOCK + 1),
        np.zeros((corners, block)),
        np.zeros((3, BLOCK + 1)),
        np.zeros((3, BLOCK + 1)),
        np.zeros((3, BLOCK + 1)),
        np.zeros((4, BLOCK + 1)),
    )


@compiled
def place_disc(mover: Mover, rows: Rows, runs: Runs, count: int) -> None:
    """The axis of a body's disc over a block in its partner's frame."""
    if mover.disc[RADIUS] > 0.0:
        axis = mover.disc
        turn_axis(rows, mover.rest, mover.frame, axis, count + 1, runs.axis)


@compiled
def place_own(
    mover: Mover, rows: Rows, runs: Runs, plane: FloatArray, count: int
) -> None:
    """The witness on a body over a block, where the body is no segment."""
    if mover.inverse < 0.0:
        frame, at = mover.frame, plane[OWN_POINT : OWN_POINT + 3]
        carry(rows.origins[frame], rows.frames[frame], at, count + 1, runs.own)
        to_frame(rows, mover.rest, count + 1, runs.own, runs.own)


@compiled
def _reach(
    points: FloatArray,
    sags: FloatArray,
    growth: FloatArray,
    plane: FloatArray,
    along: FloatArray,
    reach: FloatArray,
) -> None:
    """Largest n.x of a corner over each interval, from the rows, (3, count + 1)."""
    nx, ny, nz = plane[0], plane[1], plane[2]
    x, y, z = points[0], points[1], points[2]
    for r in range(along.size):
        along[r] = nx * x[r] + ny * y[r] + nz * z[r]
    after = along[1:]
    for r in range(reach.size):
        more = along[r] if along[r] > after[r] else after[r]
        reach[r] = more + sags[r] + growth[r]


@compiled
def _distances(
    a: FloatArray, b: FloatArray, plane: FloatArray, share: float, out: FloatArray
) -> None:
    """Distance from a plane's witness to a point of each segment from a to b.

    Any point of the segment gives an upper bound, so the share 1 / length^2 need not
    be exact.
    """
    ax, ay, az, bx, by, bz = a[0], a[1], a[2], b[0], b[1], b[2]
    wx, wy, wz = plane[POINT], plane[POINT + 1], plane[POINT + 2]
    for r in range(out.size):
        dx, dy, dz = bx[r] - ax[r], by[r] - ay[r], bz[r] - az[r]
        px, py, pz = wx - ax[r], wy - ay[r], wz - az[r]
        t = share * (px * dx + py * dy + pz * dz)
        t = 0.0 if t < 0.0 else t
        t = 1.0 if t > 1.0 else t
        px, py, pz = px - t * dx, py - t * dy, pz - t * dz
        out[r] = sqrt(px * px + py * py + pz * pz)


@compiled
def _bound_few(
    tracks: Tracks,
    slots: IntArray,
    growth: FloatArray,
    plane: FloatArray,
    first: int,
    most: FloatArray,
) -> None:
    """Largest n.x over the corners of few intervals, corner by corner."""
    nx, ny, nz = plane[0], plane[1], plane[2]
    most[:] = -np.inf
    for k in range(slots.size):
        x, y, z = tracks.places[slots[k]]
        sags = tracks.sags[slots[k]]
        before = nx * x[first] + ny * y[first] + nz * z[first]
        for r in range(most.size):
            row = first + r
            after = nx * x[row + 1] + ny * y[row + 1] + nz * z[row + 1]
            reach = (after if after > before else before) + sags[row] + growth[k, row]
            most[r] = reach if reach > most[r] else most[r]
            before = after


@compiled
def bound_below(
    mover: Mover, tracks: Tracks, runs: Runs, plane: FloatArray, first: int, last: int
) -> None:
    """Lower bounds of the intervals [first, last) of a block by one plane."""
    gap, low = plane[SUPPORT] - mover.lost, runs.lower[first:last]
    work, slots = runs.work, mover.slots
    if low.size < MANY_ROWS < slots.size:
        _bound_few(tracks, slots, runs.growth, plane, first, low)
        for r in range(low.size):
            low[r] = gap - low[r]
        return
    most, along = work[0, first:last], work[2, first : last + 1]
    for k in range(slots.size):
        reach = work[k if k < 2 else 3, first:last]
        place = tracks.places[slots[k], :, first : last + 1]
        sags, growth = tracks.sags[slots[k], first:last], runs.growth[k, first:last]
        _reach(place, sags, growth, plane, along, reach)
        if k > 1:
            for r in range(most.size):
                most[r] = most[r] if most[r] > reach[r] else reach[r]
    if slots.size == 1:
        work[1, first:last] = -np.inf
    other = work[1, first:last]
    for r in range(low.size):
        low[r] = gap - (most[r] if most[r] > other[r] else other[r])


@compiled
def bound_above(
    mover: Mover, tracks: Tracks, runs: Runs, plane: FloatArray, first: int, last: int
) -> None:
    """Upper bounds of the intervals [first, last) by one witness of the partner."""
    a, b, share = runs.own, runs.own, 0.0
    if mover.inverse >= 0.0:
        slots, share = mover.slots, mover.inverse
        a, b = tracks.places[slots[0]], tracks.places[slots[slots.size - 1]]
    now, after = runs.at_rows[first : last + 1], runs.at_rows[first + 1 :]
    _distances(a[:, first:], b[:, first:], plane, share, now)
    high = runs.upper[first:last]
    for r in range(high.size):
        high[r] = mover.rise + (now[r] if now[r] < after[r] else after[r])


@compiled
def take_disc(
    axis: FloatArray,
    plane: FloatArray,
    radius: float,
    first: int,
    last: int,
    low: FloatArray,
) -> None:
    """Take what a disc adds to a body's reach off lower bounds, shape (BLOCK,)."""
    nx, ny, nz = plane[0], plane[1], plane[2]
    before = 0.0
    for r in range(first, last + 1):
        ux, uy, uz = axis[0, r], axis[1, r], axis[2, r]
        along = nx * ux + ny * uy + nz * uz
        x, y, z = nx - along * ux, ny - along * uy, nz - along * uz
        here = radius * sqrt(x * x + y * y + z * z)
        if r > first:
            low[r - 1] -= max(before, here)
        before = here
