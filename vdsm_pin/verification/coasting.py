"""The loop that proves most intervals: one remembered plane, one remembered point.

It takes bare arrays, because unpacking a tuple of arrays costs more than the arithmetic
of a step.
"""

from math import sqrt
from typing import Final

from vdsm_pin.geometry.arm import second_order, sway
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.verification.slices import BASE, base_direction

SUPPORT: Final = 3
POINT: Final = 4
WIDTH: Final = 7
PLANE: Final = 8
"""Layout of what a pair remembers: n (3), support in n, witness on the partner (3),
width of the bracket when they were found."""

RUN: Final = 10
"""Layout of an interval: lower, upper, time, witness on the link (3) and on the
partner (3), and 1 where these are surface points in the base frame, 0 where they are
core points in the partner's."""

SLACK: Final = 0.05
"""A bracket is renewed where it is wider than this part of the clearance, and wider
than twice what it was when its plane was found."""


@compiled
def _load(
    centres: FloatArray,
    frames: FloatArray,
    row: int,
    link: int,
    frame: int,
    points: FloatArray,
    at: int,
) -> None:
    """O_i and O_{i+1} at a row, in the partner's frame, to points[at : at + 2]."""
    for k in range(2):
        if frame == BASE:
            for c in range(3):
                points[at + k, c] = centres[row, link + k, c]
            continue
        x = centres[row, link + k, 0] - centres[row, frame, 0]
        y = centres[row, link + k, 1] - centres[row, frame, 1]
        z = centres[row, link + k, 2] - centres[row, frame, 2]
        for c in range(3):
            points[at + k, c] = (
                frames[row, frame, 0, c] * x
                + frames[row, frame, 1, c] * y
                + frames[row, frame, 2, c] * z
            )


@compiled
def _error_growth(
    centres: FloatArray,
    frames: FloatArray,
    drift: float,
    lengths: FloatArray,
    error: float,
    row: int,
    frame: int,
    joint: int,
    n: FloatArray,
    turned: FloatArray,
) -> float:
    """How far joint errors may push O_joint along n over an interval; [m]."""
    apart()
    growth = second_order(lengths, frame + 1, joint, error) + 0.5 * error * drift
    for k in (row, row + 1):
        base_direction(frames[k], frame, n, turned)
        swing = sway(turned, centres[k], frames[k], frame + 1, joint)
        growth += 0.5 * error * swing
    return growth


@compiled
def crude_growth(lengths: FloatArray, error: float, first: int, joint: int) -> float:
    """The same for any n and any shape: both axes of a joint are at right angles; [m].

    What an interval's own motion adds, half the error times its drift, comes on top.
    """
    levers = reach = 0.0
    for k in range(joint - 1, first - 1, -1):
        reach += lengths[k]
        levers += reach
    return second_order(lengths, first, joint, error) + sqrt(2.0) * error * levers


@compiled
def _far(points: FloatArray, plane: FloatArray, k: int) -> float:
    """How far end k of a link gets along the plane's normal, at both rows; [m]."""
    start = end = 0.0
    for c in range(3):
        start += plane[c] * points[k, c]
        end += plane[c] * points[2 + k, c]
    return max(start, end)


@compiled
def _near_upper(points: FloatArray, plane: FloatArray, run: FloatArray) -> float:
    """Distance of the remembered witness from the link's axis at the first row."""
    span = along = 0.0
    for c in range(3):
        d = points[1, c] - points[0, c]
        span += d * d
        along += d * (plane[POINT + c] - points[0, c])
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    squared = 0.0
    for c in range(3):
        foot = points[0, c] + t * (points[1, c] - points[0, c])
        run[3 + c], run[6 + c] = foot, plane[POINT + c]
        d = plane[POINT + c] - foot
        squared += d * d
    return sqrt(squared)


@compiled
def coast(
    centres: FloatArray,
    frames: FloatArray,
    bends: FloatArray,
    drifts: FloatArray,
    lengths: FloatArray,
    link: int,
    frame: int,
    plane: FloatArray,
    errors: FloatArray,
    crude: FloatArray,
    lost: float,
    rise: float,
    threshold: float,
    limit: FloatArray,
    points: FloatArray,
    runs: FloatArray,
    local: int,
    count: int,
) -> int:
    """Prove intervals with a pair's remembered plane as long as it serves.

    Args:
        centres: Joint centres of the block's rows, shape (rows, N + 1, 3); [m].
        frames: Link frames, shape (rows, N, 3, 3); [-].
        bends: M of the block's intervals, shape (rows, N + 1, N + 1); [m].
        drifts: D, the same shape; [m].
        lengths: Link lengths, shape (N,); [m].
        link: The link.
        frame: Frame of its partner.
        plane: What the pair remembers, shape (PLANE,).
        errors: Joint error [rad] and base error [m], shape (2,).
        crude: What joint errors add at most at the link's ends, shape (2,), tried
            first; inf where narrow bounds are wanted; [m].
        lost: What every plane loses; [m].
        rise: What turns a core distance into an upper bound; [m].
        threshold: A lower bound below it does not serve; [m].
        limit: Least upper bound so far, shape (1,): improved where the error box is
            empty, and then the threshold of the least bound; else inf is left.
        points: Working space, shape (5, 3).
        runs: Results, shape (rows, RUN).
        local: First interval of the block to look at.
        count: Intervals in the block.

    Returns:
        The first interval that the plane does not serve, or `count`.
    """
    apart()
    support, first = plane[SUPPORT], frame + 1
    base = abs(plane[0]) * errors[1] if frame == BASE else 0.0
    _load(centres, frames, local, link, frame, points, 2)
    while local < count:
        points[:2] = points[2:4]
        _load(centres, frames, local + 1, link, frame, points, 2)
        reach = -1e300
        for k in range(2):
            far = _far(points, plane, k) + 0.125 * bends[local, first, link + k]
            wander = 0.5 * errors[0] * drifts[local, first, link + k]
            reach = max(reach, far + wander + crude[k])
        lower = support - reach - base - lost
        if errors[0] > 0.0 and not lower >= threshold:
            reach = -1e300
            for k in range(2):
                far = _far(points, plane, k) + 0.125 * bends[local, first, link + k]
                far += _error_growth(
                    centres,
                    frames,
                    drifts[local, first, link + k],
                    lengths,
                    errors[0],
                    local,
                    frame,
                    link + k,
                    plane[:3],
                    points[4],
                )
                reach = max(reach, far)
            lower = support - reach - base - lost
        upper = _near_upper(points, plane, runs[local]) + rise
        allowed = 2.0 * plane[WIDTH] + SLACK * upper
        if not (lower >= threshold and upper - lower <= allowed):
            break
        run = runs[local]
        run[0], run[1], run[2], run[9] = lower, upper, 0.0, 0.0
        if upper < limit[0]:
            limit[0] = upper
        local += 1
    return local
