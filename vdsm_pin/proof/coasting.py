"""The loops that prove most intervals: one remembered plane, one remembered point.

They take bare arrays with the rows last: a few operations an interval, many at a time.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import second_order, turned_by
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.holding import raise_to_held
from vdsm_pin.proof.layouts import (
    HELD_CLEARANCE,
    OWN_POINT,
    POINT,
    SUPPORT,
    WIDTH,
)
from vdsm_pin.proof.rows import (
    BLOCK,
    Rows,
    add_errors,
    place_corner,
    to_frame,
    turn_axis,
    turning_of,
)
from vdsm_pin.proof.terms import BASE, Mover, Rules


class Runs(NamedTuple):
    """A block's intervals for one pair: its corners, bounds, what they are made of.

    Args:
        lower: Lower bounds, shape (BLOCK,); [m].
        upper: Upper bounds, at the nearer of the two rows, shape (BLOCK,); [m].
        at_rows: Core distances at the rows, shape (BLOCK + 1,); [m].
        points: Corners in the partner's frame, shape (corners, 3, BLOCK + 1); [m].
        based: The same in the base frame, of bodies that are no axis of a link or
            where errors turn; [m].
        sags: How far corners may leave their chords, shape (corners, BLOCK); [m].
        growth: What errors add to n.corner, shape (corners, BLOCK); [m].
        axis: Axis of the disc in the partner's frame, shape (3, BLOCK + 1); [-].
        own: The witness on the body, shape (3, BLOCK + 1); [m].
        work: Working space, shape (4, BLOCK + 1).
    """

    lower: FloatArray
    upper: FloatArray
    at_rows: FloatArray
    points: FloatArray
    based: FloatArray
    sags: FloatArray
    growth: FloatArray
    axis: FloatArray
    own: FloatArray
    work: FloatArray


@compiled
def new_runs(corners: int) -> Runs:
    """Fresh working space; where errors add nothing `growth` is to be 0."""
    return Runs(
        np.zeros(BLOCK),
        np.zeros(BLOCK),
        np.zeros(BLOCK + 1),
        np.zeros((corners, 3, BLOCK + 1)),
        np.zeros((corners, 3, BLOCK + 1)),
        np.zeros((corners, BLOCK)),
        np.zeros((corners, BLOCK)),
        np.zeros((3, BLOCK + 1)),
        np.zeros((3, BLOCK + 1)),
        np.zeros((4, BLOCK + 1)),
    )


@compiled
def take_axis(
    centres: FloatArray,
    sags: FloatArray,
    link: int,
    points: FloatArray,
    out: FloatArray,
) -> None:
    """Corners and sags of a link's axis, of bare arrays of one frame of a block."""
    for k in range(2):
        for c in range(3):
            x, y = centres[link + k, c], points[k, c]
            for r in range(y.size):
                y[r] = x[r]
        sag, here = sags[link + k], out[k]
        for r in range(here.size):
            here[r] = sag[r]


@compiled
def place_body(mover: Mover, rows: Rows, runs: Runs, count: int, steady: bool) -> None:
    """Corners of a body over a block and how far they leave their chords."""
    apart()
    link, f = mover.link, mover.first
    if mover.axial:
        take_axis(rows.centres[f], rows.sags[f], link, runs.points, runs.sags)
        if not steady:
            take_axis(rows.centres[0], rows.sags[f], link, runs.based, runs.sags)
        return
    turning = runs.work[0]
    turning_of(rows, f, link, count, turning)
    for k in range(mover.levers.size):
        based, sags = runs.based[k], runs.sags[k]
        place_corner(rows, link, mover.corners[k], count + 1, based)
        to_frame(rows, f, count + 1, based, runs.points[k])
        lever, before = 0.125 * mover.levers[k], rows.sags[f, link]
        for r in range(count):
            sags[r] = before[r] + lever * turning[r] * turning[r]
    if mover.disc[RADIUS] > 0.0:
        turn_axis(rows, f, link, mover.disc, count + 1, runs.axis)


@compiled
def place_own(
    mover: Mover, rows: Rows, runs: Runs, plane: FloatArray, count: int
) -> None:
    """The witness on a body over a block, where the body is no axis."""
    if not mover.axial:
        at = plane[OWN_POINT : OWN_POINT + 3]
        place_corner(rows, mover.link, at, count + 1, runs.own)
        to_frame(rows, mover.first, count + 1, runs.own, runs.own)


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
def bound_below(
    points: FloatArray,
    sags: FloatArray,
    growth: FloatArray,
    plane: FloatArray,
    corners: int,
    lost: float,
    first: int,
    last: int,
    lower: FloatArray,
    work: FloatArray,
) -> None:
    """Lower bounds of intervals by one plane, of bare arrays.

    Args:
        points: Corners in the partner's frame, shape (corners, 3, BLOCK + 1); [m].
        sags: Shape (corners, BLOCK); [m].
        growth: What errors add, shape (corners, BLOCK); [m].
        plane: What the pair remembers.
        corners: How many the body has.
        lost: What the plane loses; [m].
        first: First interval of the block to look at.
        last: One past the last.
        lower: Result, shape (BLOCK,); [m].
        work: Working space, shape (4, BLOCK + 1).
    """
    apart()
    gap, low = plane[SUPPORT] - lost, lower[first:last]
    most, along = work[0, first:last], work[2, first : last + 1]
    for k in range(corners):
        reach = work[k if k < 2 else 3, first:last]
        place = points[k, :, first : last + 1]
        _reach(place, sags[k, first:last], growth[k, first:last], plane, along, reach)
        if k > 1:
            for r in range(most.size):
                most[r] = most[r] if most[r] > reach[r] else reach[r]
    if corners == 1:
        work[1, first:last] = -np.inf
    other = work[1, first:last]
    for r in range(low.size):
        low[r] = gap - (most[r] if most[r] > other[r] else other[r])


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


@compiled
def bound_above(
    a: FloatArray,
    b: FloatArray,
    plane: FloatArray,
    share: float,
    rise: float,
    first: int,
    last: int,
    upper: FloatArray,
    at_rows: FloatArray,
) -> None:
    """Upper bounds of intervals by one witness of the partner, of bare arrays.

    Args:
        a: Ends of segments in the body, shape (3, BLOCK + 1); [m].
        b: Their other ends; [m].
        plane: What the pair remembers.
        share: 1 / length^2 of the segments; 0 for points; [1/m^2].
        rise: What turns a core distance into an upper bound; [m].
        first: First interval of the block to look at.
        last: One past the last.
        upper: Result, shape (BLOCK,); [m].
        at_rows: Result, shape (BLOCK + 1,); [m].
    """
    now, after = at_rows[first : last + 1], at_rows[first + 1 :]
    _distances(a[:, first:], b[:, first:], plane, share, now)
    high = upper[first:last]
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
def crude_growth(rules: Rules, f: int, link: int, lever: float) -> float:
    """What joint errors add to n.x of a point for any n and any shape; [m].

    Both axes of a joint are at right angles. What an interval's own motion adds, half
    its drift, comes on top.
    """
    levers, reach, errors = 0.0, lever, rules.joint_errors
    for k in range(link, f - 1, -1):
        levers += sqrt(errors[k, 0] ** 2 + errors[k, 1] ** 2) * reach
        reach += rules.lengths[k - 1] if k > f else 0.0
    return levers + second_order(rules.lengths, errors, f, link, lever)


@compiled
def point_drift(
    rules: Rules,
    rows: Rows,
    f: int,
    link: int,
    lever: float,
    count: int,
    out: FloatArray,
) -> None:
    """D of a point over a block, written, shape (>= count,); [m]."""
    turning_of(rows, f, link, count, out)
    error = lever * turned_by(rules.joint_errors, f, link)
    drift = rows.drifts[f, link]
    for r in range(count):
        out[r] = drift[r] + error * out[r]


@compiled
def _turn_base(
    based: FloatArray,
    turn: float,
    beyond: FloatArray,
    out: FloatArray,
    first: int,
    last: int,
) -> None:
    """Add what a turn of the base does to a corner and what is around it; [m]."""
    before = 0.0
    for r in range(first, last + 1):
        x, y, z = based[0, r], based[1, r], based[2, r]
        here = sqrt(x * x + y * y + z * z)
        if r > first:
            out[r - 1] += turn * (max(before, here) + beyond[r - 1])
        before = here


@compiled
def _grow(
    rules: Rules,
    mover: Mover,
    rows: Rows,
    runs: Runs,
    n: FloatArray,
    first: int,
    last: int,
    crudely: bool,
) -> None:
    """What errors that turn add to n.x of a body's corners, to `runs.growth`; [m]."""
    apart()
    link, f, disc, errors = (
        mover.link,
        mover.first,
        mover.disc[RADIUS],
        rules.joint_errors,
    )
    beyond, turned = disc * turned_by(errors, f, link), runs.work[2]
    for k in range(mover.levers.size):
        lever, out, drift = mover.levers[k], runs.growth[k], runs.work[1]
        crude = crude_growth(rules, f, link, lever)
        least = second_order(rules.lengths, errors, f, link, lever) + beyond
        out[first:last] = crude if crudely else least
        if rules.joints_err:
            if mover.axial:
                drift = rows.drifts[f, link + k]
            else:
                point_drift(rules, rows, f, link, lever, last, drift)
            for r in range(first, last):
                out[r] += 0.5 * drift[r]
            if not crudely:
                # A corner at the joint's centre is not moved by this joint.
                end = link if lever > 0.0 else link - 1
                add_errors(rules, rows, f, end, runs.based[k], n, first, last, out)
        if f == BASE + 1 and rules.base_turn > 0.0:
            for r in range(first, last):
                turned[r] = crude + disc + runs.sags[k, r]
                turned[r] += 0.5 * drift[r] if rules.joints_err else 0.0
            _turn_base(runs.based[k], rules.base_turn, turned, out, first, last)


@compiled
def coast(
    rules: Rules,
    mover: Mover,
    rows: Rows,
    runs: Runs,
    plane: FloatArray,
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
        mover: The body of the pair.
        rows: The block.
        runs: The body's corners and witness are placed; bounds of the intervals
            [first, last) are written.
        plane: What the pair remembers.
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
    corners, done, disc = mover.levers.size, first, mover.disc[RADIUS]
    crudely = not rules.steady and np.isinf(slack)
    lower, upper = runs.lower[first:last], runs.upper[first:last]
    a, b, share = runs.own, runs.own, 0.0
    if mover.axial:
        length = rules.lengths[mover.link]
        a, b, share = runs.points[0], runs.points[1], 1.0 / (length * length)
    bound_above(a, b, plane, share, mover.rise, first, last, runs.upper, runs.at_rows)
    for _ in range(2):
        if not rules.steady:
            _grow(rules, mover, rows, runs, plane[:3], first, last, crudely)
        bound_below(
            runs.points,
            runs.sags,
            runs.growth,
            plane,
            corners,
            mover.lost,
            first,
            last,
            runs.lower,
            runs.work,
        )
        if disc > 0.0:
            take_disc(runs.axis, plane, disc, first, last, runs.lower)
        if rules.steady and plane[HELD_CLEARANCE] > -np.inf:
            raise_to_held(
                runs.points, runs.sags, plane, corners, first, last, runs.lower
            )
        if fresh:
            lower[0] = max(lower[0], proved)
            plane[WIDTH] = upper[0] - lower[0]
        done = first + served(lower, upper, bar, slack, 2.0 * plane[WIDTH])
        if not crudely or done == last:
            break
        crudely = False
    return done
