"""The arm in compiled code: joint centres, their bend off a chord.

Formulas of docs/certificate.md, "The bound".

Links, joints and centres count from 0 here: link l joins O_l and O_{l+1}, joint l turns
links l, l + 1, ...
"""

from math import cos, sin

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import apart, compiled


@compiled
def place(
    x0: float,
    alpha: FloatArray,
    theta: FloatArray,
    lengths: FloatArray,
    centres: FloatArray,
    frames: FloatArray,
) -> None:
    """Joint centres and link frames of one configuration.

    Args:
        x0: Base position; [m].
        alpha: Yaw angles, shape (N,); [rad].
        theta: Pitch angles, shape (N,); [rad].
        lengths: Link lengths, shape (N,); [m].
        centres: Result, shape (N + 1, 3); [m].
        frames: Result R_base_link, shape (N, 3, 3); [-].
    """
    apart()
    centres[0, 0], centres[0, 1], centres[0, 2] = x0, 0.0, 0.0
    for link in range(lengths.size):
        ca, sa = cos(alpha[link]), sin(alpha[link])
        ct, st = cos(theta[link]), sin(theta[link])
        for row in range(3):
            if link == 0:
                x, y = 1.0 if row == 0 else 0.0, 1.0 if row == 1 else 0.0
                z = 1.0 if row == 2 else 0.0
            else:
                x, y = frames[link - 1, row, 0], frames[link - 1, row, 1]
                z = frames[link - 1, row, 2]
            across = ca * x + sa * y
            frames[link, row, 0] = ct * across - st * z
            frames[link, row, 1] = ca * y - sa * x
            frames[link, row, 2] = st * across + ct * z
            step = lengths[link] * frames[link, row, 0]
            centres[link + 1, row] = centres[link, row] + step


@compiled
def place_between(
    t: float,
    x0: FloatArray,
    alpha: FloatArray,
    theta: FloatArray,
    lengths: FloatArray,
    centres: FloatArray,
    frames: FloatArray,
) -> None:
    """The same at time t between two rows, arrays of shape (2,) and (2, N)."""
    if t == 0.0 or t == 1.0:
        k = int(t)
        place(x0[k], alpha[k], theta[k], lengths, centres, frames)
        return
    place(
        x0[0] + t * (x0[1] - x0[0]),
        alpha[0] + t * (alpha[1] - alpha[0]),
        theta[0] + t * (theta[1] - theta[0]),
        lengths,
        centres,
        frames,
    )


@compiled
def bends_and_drifts(
    alpha: FloatArray,
    theta: FloatArray,
    lengths: FloatArray,
    errors: FloatArray,
    bends: FloatArray,
    drifts: FloatArray,
    rates: FloatArray,
) -> None:
    """How far from linear a motion between two rows is.

    Args:
        alpha: Yaw angles of the two rows, shape (2, N); [rad].
        theta: Pitch angles, shape (2, N); [rad].
        lengths: Link lengths, shape (N,); [m].
        errors: Largest errors of alpha_l and theta_l, shape (N, 2); [rad].
        bends: Result M, bound of the second derivative of O_j with joints below f at
            rest, at [f, j], shape (N + 1, N + 1); [m].
        drifts: Result D, bound of the rate at which what the errors do to O_j changes,
            at [f, j]; [m].
        rates: Result W, total turning of link l with joints below f at rest, at [f, l],
            shape (N, N); [rad].
    """
    apart()
    for f in range(lengths.size):
        turning = bend = drift = error = 0.0
        bends[f, f] = drifts[f, f] = 0.0
        for link in range(f, lengths.size):
            turning += abs(alpha[1, link] - alpha[0, link])
            turning += abs(theta[1, link] - theta[0, link])
            error += errors[link, 0] + errors[link, 1]
            bend += lengths[link] * turning * turning
            drift += lengths[link] * error * turning
            bends[f, link + 1], drifts[f, link + 1] = bend, drift
            rates[f, link] = turning


@compiled
def turned_by(errors: FloatArray, f: int, link: int) -> float:
    """Sum of the errors of the angles of joints f to `link`; [rad]."""
    total = 0.0
    for k in range(f, link + 1):
        total += errors[k, 0] + errors[k, 1]
    return total


@compiled
def second_order(
    lengths: FloatArray, errors: FloatArray, f: int, link: int, lever: float
) -> float:
    """Second order of joint errors in a point of a link, joints below f at rest; [m].

    Args:
        lengths: Link lengths, shape (N,); [m].
        errors: Largest errors of alpha_l and theta_l, shape (N, 2); [rad].
        f: First joint that errs.
        link: The link.
        lever: Distance of the point from the link's origin; [m].
    """
    total = turned = 0.0
    for k in range(f, link + 1):
        turned += errors[k, 0] + errors[k, 1]
        total += (lever if k == link else lengths[k]) * turned * turned
    return 0.5 * total
