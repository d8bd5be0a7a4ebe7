"""Joint angles from cable lengths, compiled: Eq. 16-21 of the paper inverted.

Seven functions of a joint's angles times seven constants of a hole give the squared
span of a cable (see `vdsm_pin.cables`). In u = tan(alpha / 2) and v = tan(theta / 2)
all seven are rational. Samples run along the last axis, innermost, where the compiler
works on several at once.
"""

from math import sqrt
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import compiled

STARTS: Final = 9
"""Starts per angle where Newton's method fails from the first guess."""

LARGEST_START: Final = 0.8
"""Tangent of half the largest angle started from, 77 deg."""


@compiled
def peel(
    holes: FloatArray,
    guesses: FloatArray,
    left: FloatArray,
    u: FloatArray,
    v: FloatArray,
    rounds: int,
    enough: float,
    tolerance: float,
) -> None:
    """Solve joint by joint; a solved joint's spans come off all cables through it.

    Args:
        holes: Constants of all holes, shape (N, 3, 7); [m^2].
        guesses: A first u and v as linear maps of three spans, shape (N, 2, 3); [1/m].
        left: Cable lengths inside the joints, shape (N, 3, n_samples), overwritten;
            what stays of a link's own cables is how far they contradict; [m].
        u: Result, tan(alpha / 2), shape (N, n_samples); [-].
        v: Result, tan(theta / 2), shape (N, n_samples); [-].
        rounds: Largest number of Newton steps per joint.
        enough: Step after which the next one would be rounding; [-].
        tolerance: Contradiction of three cables that makes other starts needed; [m].
    """
    n_links, n_samples = u.shape
    step = np.zeros(n_samples)
    for i in range(n_links):
        for k in range(n_samples):
            a, b, c = left[i, 0, k], left[i, 1, k], left[i, 2, k]
            u[i, k] = guesses[i, 0, 0] * a + guesses[i, 0, 1] * b + guesses[i, 0, 2] * c
            v[i, k] = guesses[i, 1, 0] * a + guesses[i, 1, 1] * b + guesses[i, 1, 2] * c
        for _ in range(rounds):
            newton_step(holes[i], left[i], u[i], v[i], step)
            if step.max() <= enough:
                break
        own = left[i].copy()
        for hole in range(3):
            take_off(holes[i, hole], u[i], v[i], left[i, hole])
        searched = False
        for k in range(n_samples):
            if not fits(left[i], k, tolerance):
                found = search(holes[i], own, k, rounds, tolerance)
                if not np.isnan(found[0]):
                    u[i, k], v[i, k] = found
                    searched = True
        if searched:
            left[i] = own
            for hole in range(3):
                take_off(holes[i, hole], u[i], v[i], left[i, hole])
        for j in range(i + 1, n_links):
            for hole in range(3):
                take_off(holes[j, hole], u[i], v[i], left[j, hole])


@compiled
def fits(left: FloatArray, k: int, tolerance: float) -> bool:
    """Whether what is left of the three spans of sample k is rounding; NaN is not."""
    worst = max(abs(left[0, k]), abs(left[1, k]), abs(left[2, k]))
    total = left[0, k] + left[1, k] + left[2, k]
    return bool(worst <= tolerance and not np.isnan(total))


@compiled
def search(
    holes: FloatArray, spans: FloatArray, sample: int, rounds: int, tolerance: float
) -> tuple[float, float]:
    """Newton's method from a grid of starts, for the rare joint that needs it.

    Near the end of the domain, and with holes close to each other, the residual has
    hollows in which the first guess may end.

    Args:
        holes: Constants of the three holes, shape (3, 7); [m^2].
        spans: Cable lengths inside the joint, shape (3, n_samples); [m].
        sample: The column meant.
        rounds: Largest number of Newton steps.
        tolerance: Contradiction of the spans at which a solution fits; [m].

    Returns:
        tan(alpha / 2) and tan(theta / 2) of the fitting solution nearest to straight;
        NaN where nothing fits; [-].
    """
    count = STARTS * STARTS
    us, vs, step = np.zeros(count), np.zeros(count), np.zeros(count)
    left = np.zeros((3, count))
    for k in range(count):
        us[k] = LARGEST_START * (2 * (k // STARTS) / (STARTS - 1) - 1)
        vs[k] = LARGEST_START * (2 * (k % STARTS) / (STARTS - 1) - 1)
        left[:, k] = spans[:, sample]
    for _ in range(rounds):
        newton_step(holes, left, us, vs, step)
    for hole in range(3):
        take_off(holes[hole], us, vs, left[hole])
    nearest, u, v = np.inf, np.nan, np.nan
    for k in range(count):
        size = us[k] * us[k] + vs[k] * vs[k]
        if size < nearest and fits(left, k, tolerance):
            nearest, u, v = size, us[k], vs[k]
    return u, v


@compiled
def newton_step(
    holes: FloatArray, spans: FloatArray, u: FloatArray, v: FloatArray, step: FloatArray
) -> None:
    """One Gauss-Newton step on the squared spans of one joint.

    Args:
        holes: Constants of the three holes, shape (3, 7); [m^2].
        spans: Cable lengths inside the joint, shape (3, n_samples); [m].
        u: tan(alpha / 2), shape (n_samples,), improved; [-].
        v: tan(theta / 2), shape (n_samples,), improved; [-].
        step: Largest change of the two, shape (n_samples,), written; [-].
    """
    for k in range(u.size):
        square_u, square_v = u[k] * u[k], v[k] * v[k]
        scale_u, scale_v = 1.0 / (1.0 + square_u), 1.0 / (1.0 + square_v)
        ca, sa = (1.0 - square_u) * scale_u, 2.0 * u[k] * scale_u
        ct, st = (1.0 - square_v) * scale_v, 2.0 * v[k] * scale_v
        aa = at = tt = ae = te = 0.0
        for hole in range(3):
            c = holes[hole]
            error = (
                (c[0] - spans[hole, k] * spans[hole, k] + c[1] * ca * ct)
                + (c[2] * sa * (1.0 + ct) + c[3] * st * (1.0 + ca))
                + (c[4] * ca + c[5] * ct + c[6] * sa * st)
            )
            a = (c[2] * ca * (1.0 + ct) - c[1] * sa * ct - c[3] * sa * st) + (
                c[6] * ca * st - c[4] * sa
            )
            t = (c[3] * ct * (1.0 + ca) - c[1] * ca * st - c[2] * sa * st) + (
                c[6] * sa * ct - c[5] * st
            )
            aa, at, tt = aa + a * a, at + a * t, tt + t * t
            ae, te = ae + a * error, te + t * error
        half = 0.5 / (aa * tt - at * at)
        du = (at * te - tt * ae) * half * (1.0 + square_u)
        dv = (at * ae - aa * te) * half * (1.0 + square_v)
        u[k] += du
        v[k] += dv
        step[k] = abs(du) + abs(dv)


@compiled
def take_off(hole: FloatArray, u: FloatArray, v: FloatArray, left: FloatArray) -> None:
    """Subtract the spans of one hole in one joint (Eq. 20).

    Args:
        hole: Constants of the hole, shape (7,); [m^2].
        u: tan(alpha / 2) of the joint, shape (n_samples,); [-].
        v: tan(theta / 2) of the joint, shape (n_samples,); [-].
        left: Cable length not yet accounted for, shape (n_samples,), reduced; [m].
    """
    for k in range(u.size):
        square_u, square_v = u[k] * u[k], v[k] * v[k]
        scale_u, scale_v = 1.0 / (1.0 + square_u), 1.0 / (1.0 + square_v)
        ca, sa = (1.0 - square_u) * scale_u, 2.0 * u[k] * scale_u
        ct, st = (1.0 - square_v) * scale_v, 2.0 * v[k] * scale_v
        square = (
            (hole[0] + hole[1] * ca * ct)
            + (hole[2] * sa * (1.0 + ct) + hole[3] * st * (1.0 + ca))
            + (hole[4] * ca + hole[5] * ct + hole[6] * sa * st)
        )
        left[k] -= sqrt(max(square, 0.0))
