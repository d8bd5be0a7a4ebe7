"""The loops that prove most intervals: one remembered plane, one remembered point.

They take bare arrays with the rows last: a few operations an interval, many at a time.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import second_order
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.holding import raise_to_held
from vdsm_pin.proof.layouts import (
    HELD_CLEARANCE,
    POINT,
    SUPPORT,
    WIDTH,
)
from vdsm_pin.proof.rows import BLOCK, Rows, error_growth
from vdsm_pin.proof.terms import BASE, Rules, losses


class Runs(NamedTuple):
    """Bounds of a block's intervals for one pair, and what they are made of.

    Args:
        lower: Lower bounds, shape (BLOCK,); [m].
        upper: Upper bounds, at the nearer of the two rows, shape (BLOCK,); [m].
        at_rows: Core distances at the rows, shape (BLOCK + 1,); [m].
        growth: What joint errors add to n.O of both centres, shape (2, BLOCK); [m].
        work: Working space, shape (3, BLOCK + 1).
    """

    lower: FloatArray
    upper: FloatArray
    at_rows: FloatArray
    growth: FloatArray
    work: FloatArray


@compiled
def new_runs() -> Runs:
    """Fresh working space; without joint errors `growth` is to be 0."""
    return Runs(
        np.zeros(BLOCK),
        np.zeros(BLOCK),
        np.zeros(BLOCK + 1),
        np.zeros((2, BLOCK)),
        np.zeros((3, BLOCK + 1)),
    )


@compiled
def _reach(
    points: FloatArray,
    sags: FloatArray,
    growth: FloatArray,
    plane: FloatArray,
    along: FloatArray,
    reach: FloatArray,
) -> None:
    """Largest n.O_j over each interval, from O_j at the rows, shape (3, count + 1)."""
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
def glide(
    centres: FloatArray,
    sags: FloatArray,
    growth: FloatArray,
    plane: FloatArray,
    link: int,
    length: float,
    lost: float,
    rise: float,
    first: int,
    last: int,
    lower: FloatArray,
    upper: FloatArray,
    at_rows: FloatArray,
    work: FloatArray,
) -> None:
    """Bound intervals by one plane and one witness: what `coast` does, of bare arrays.

    Args:
        centres: Joint centres in the partner's frame, shape (N + 1, 3, BLOCK + 1); [m].
        sags: Of that frame, shape (N + 1, BLOCK); [m].
        growth: What joint errors add, shape (2, BLOCK); [m].
        plane: What the pair remembers, shape (PLANE,).
        link: The link.
        length: Its length; [m].
        lost: What the plane loses; [m].
        rise: What turns a core distance into an upper bound; [m].
        first: First interval of the block to look at.
        last: One past the last.
        lower: Result, shape (BLOCK,); [m].
        upper: Result, shape (BLOCK,); [m].
        at_rows: Result, shape (BLOCK + 1,); [m].
        work: Working space, shape (3, BLOCK + 1).
    """
    apart()
    for k in range(2):
        _reach(
            centres[link + k, :, first : last + 1],
            sags[link + k, first:last],
            growth[k, first:last],
            plane,
            work[2, first : last + 1],
            work[k, first:last],
        )
    gap, low = plane[SUPPORT] - lost, lower[first:last]
    start, end = work[0, first:last], work[1, first:last]
    for r in range(low.size):
        low[r] = gap - (start[r] if start[r] > end[r] else end[r])
    points, ends = centres[link, :, first : last + 1], centres[link + 1, :, first:]
    now, after, high = (
        at_rows[first : last + 1],
        at_rows[first + 1 :],
        upper[first:last],
    )
    _distances(points, ends, plane, 1.0 / (length * length), now)
    for r in range(high.size):
        high[r] = rise + (now[r] if now[r] < after[r] else after[r])


@compiled
def served(
    lower: FloatArray, upper: FloatArray, bar: float, slack: float, width: float
) -> int:
    """How many of the first intervals a plane serves.

    Args:
        lower: Lower bounds, shape (count,); [m].
        upper: Upper bounds, shape (count,); [m].
        bar: A lower bound below it does not serve; [m].
        slack: A bracket may be as wide as this part of the clearance, and wider
        width: by so much; [m].
    """
    missed = 0
    for r in range(lower.size):
        low = not lower[r] >= bar
        wide = not upper[r] - lower[r] <= width + slack * upper[r]
        missed |= low | wide
    if not missed:
        return lower.size
    for r in range(lower.size):
        if not lower[r] >= bar:
            return r
        if not upper[r] - lower[r] <= width + slack * upper[r]:
            return r
    return lower.size


@compiled
def crude_growth(lengths: FloatArray, error: float, first: int, joint: int) -> float:
    """`error_growth` for any n and any shape: both axes of a joint are at right angles.

    What an interval's own motion adds, half the error times its drift, comes on top;
    [m].
    """
    levers = reach = 0.0
    for k in range(joint - 1, first - 1, -1):
        reach += lengths[k]
        levers += reach
    return second_order(lengths, first, joint, error) + sqrt(2.0) * error * levers


@compiled
def _grow(
    rules: Rules,
    rows: Rows,
    growth: FloatArray,
    plane: FloatArray,
    link: int,
    f: int,
    first: int,
    last: int,
    crudely: bool,
) -> None:
    """What joint errors add to n.O of a link's centres, shape (2, BLOCK); [m]."""
    apart()
    for k in range(2):
        joint, out = link + k, growth[k]
        if not crudely:
            error_growth(rules, rows, f, joint, plane, first, last, out)
            continue
        most = crude_growth(rules.lengths, rules.joint_error, f, joint)
        drift, half = rows.drifts[f, joint], 0.5 * rules.joint_error
        for r in range(first, last):
            out[r] = most + half * drift[r]


@compiled
def coast(
    rules: Rules,
    rows: Rows,
    runs: Runs,
    plane: FloatArray,
    link: int,
    frame: int,
    first: int,
    last: int,
    bar: float,
    slack: float,
    fresh: bool,
    proved: float,
) -> int:
    """Bound intervals with a pair's remembered plane and witness.

    Args:
        rules: What the proof has to cover.
        rows: The block.
        runs: Bounds of the intervals [first, last) are written.
        plane: What the pair remembers, shape (PLANE,).
        link: The link.
        frame: Frame of its partner.
        first: First interval of the block to look at.
        last: One past the last.
        bar: A lower bound below it does not serve; [m].
        slack: As for `served`; inf where narrow brackets are not wanted.
        fresh: Whether the plane was made for the first interval: its bracket there is
            what the following ones are measured by.
        proved: Clearance proved for that interval otherwise, or -inf; [m].

    Returns:
        The first interval that the plane does not serve, or `last`.
    """
    apart()
    f, done = frame + 1, first
    base = abs(plane[0]) * rules.base_error if frame == BASE else 0.0
    crudely = rules.joint_error > 0.0 and np.isinf(slack)
    lower, upper = runs.lower[first:last], runs.upper[first:last]
    for _ in range(2):
        if rules.joint_error > 0.0:
            _grow(rules, rows, runs.growth, plane, link, f, first, last, crudely)
        glide(
            rows.centres[f],
            rows.sags[f],
            runs.growth,
            plane,
            link,
            rules.lengths[link],
            losses(rules, frame) + base,
            rules.pad - rules.radius,
            first,
            last,
            runs.lower,
            runs.upper,
            runs.at_rows,
            runs.work,
        )
        if rules.joint_error == 0.0 and plane[HELD_CLEARANCE] > -np.inf:
            held = rows.centres[f], rows.sags[f]
            raise_to_held(*held, plane, link, first, last, runs.lower)
        if fresh:
            lower[0] = max(lower[0], proved)
            plane[WIDTH] = upper[0] - lower[0]
        done = first + served(lower, upper, bar, slack, 2.0 * plane[WIDTH])
        if not crudely or done == last:
            break
        crudely = False
    return done
