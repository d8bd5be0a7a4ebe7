"""Cable lengths from joint angles and back, compiled (Eq. 16-21 of the paper).

A cable spans a joint from the hole h = (0, y, z) in one end face to that in the next.
With d half the gap, r the radius of the hole circle, and c, s for cosine and sine, the
square of the span (Eq. 20) is, multiplied out, g0 + y (z g4 - g1) + z (z g3 + g2) of

    g0 = 2 d^2 (1 + c_alpha c_theta) + 2 r^2 (1 - c_alpha)
    g1 = 2 d s_alpha (1 + c_theta)         g3 = 2 (c_alpha - c_theta)
    g2 = 2 d s_theta (1 + c_alpha)         g4 = -2 s_alpha s_theta

In u = tan(alpha / 2) and v = tan(theta / 2) all five are rational. Innermost loops run
from 0 over what is stored side by side: there the compiler works on several at once.
"""

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray


class Holes(NamedTuple):
    """Holes that cables run through."""

    half_gap: float
    """d; [m]."""

    radius: float
    """r; [m]."""

    y: FloatArray
    """Shape (m,); [m]."""

    z: FloatArray
    """Shape (m,); [m]."""


@compiled
def add_spans(
    alpha: FloatArray, theta: FloatArray, holes: Holes, lengths: FloatArray
) -> None:
    """Add to every cable what it spans in the joints that it runs through.

    Args:
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].
        holes: Of all joints, 3N of them.
        lengths: Of the cables, increased, shape (n_samples, 3N); [m].
    """
    d, bulge = 2.0 * holes.half_gap, 2.0 * holes.radius * holes.radius
    gap, y, z = holes.half_gap * d, holes.y, holes.z
    for k in range(alpha.shape[0]):
        for i in range(alpha.shape[1]):
            ca, sa = cos(alpha[k, i]), sin(alpha[k, i])
            ct, st = cos(theta[k, i]), sin(theta[k, i])
            g0 = gap * (1.0 + ca * ct) + bulge * (1.0 - ca)
            g1, g2 = d * sa * (1.0 + ct), d * st * (1.0 + ca)
            g3, g4 = 2.0 * (ca - ct), -2.0 * sa * st
            total, ys, zs = lengths[k, 3 * i :], y[3 * i :], z[3 * i :]
            for m in range(total.size):
                square = g0 + ys[m] * (zs[m] * g4 - g1) + zs[m] * (zs[m] * g3 + g2)
                # Rounding may take it below zero where the two holes coincide.
                total[m] += sqrt(0.0 if square < 0.0 else square)


@compiled
def solve_joint(
    holes: Holes,
    spans: FloatArray,
    u: FloatArray,
    v: FloatArray,
    rounds: int,
    enough: float,
) -> None:
    """Gauss-Newton for the two angles of a joint that give its three spans.

    Args:
        holes: The three of the joint.
        spans: Cable lengths inside the joint, shape (3, n_samples); [m].
        u: A guess of tan(alpha / 2), overwritten by the result, (n_samples,); [-].
        v: A guess of tan(theta / 2), overwritten by the result, (n_samples,); [-].
        rounds: Largest number of steps.
        enough: Step after which the next one would be rounding; [-].
    """
    d, bulge = 2.0 * holes.half_gap, 2.0 * holes.radius * holes.radius
    gap, y, z = holes.half_gap * d, holes.y, holes.z
    for _ in range(rounds):
        # An integer, because the order of a sum of floats would forbid vector code.
        moving = 0
        for k in range(u.size):
            square_u, square_v = u[k] * u[k], v[k] * v[k]
            scale_u, scale_v = 1.0 / (1.0 + square_u), 1.0 / (1.0 + square_v)
            ca, sa = (1.0 - square_u) * scale_u, 2.0 * u[k] * scale_u
            ct, st = (1.0 - square_v) * scale_v, 2.0 * v[k] * scale_v
            g0 = gap * (1.0 + ca * ct) + bulge * (1.0 - ca)
            g1, g2 = d * sa * (1.0 + ct), d * st * (1.0 + ca)
            g3, g4 = 2.0 * (ca - ct), -2.0 * sa * st
            aa = at = tt = ae = te = 0.0
            for hole in range(3):
                b, c = y[hole], z[hole]
                error = (g0 - spans[hole, k] * spans[hole, k]) + (
                    b * (c * g4 - g1) + c * (c * g3 + g2)
                )
                a = (bulge - 2.0 * c * c) * sa - gap * sa * ct
                a -= b * (c * (2.0 * ca * st) + d * ca * (1.0 + ct)) + c * d * sa * st
                t = c * (2.0 * c * st + d * ct * (1.0 + ca)) - gap * ca * st
                t -= b * (c * (2.0 * sa * ct) - d * sa * st)
                aa, at, tt = aa + a * a, at + a * t, tt + t * t
                ae, te = ae + a * error, te + t * error
            half = 0.5 / (aa * tt - at * at)
            du = (at * te - tt * ae) * half * (1.0 + square_u)
            dv = (at * ae - aa * te) * half * (1.0 + square_v)
            u[k] += du
            v[k] += dv
            moving += abs(du) + abs(dv) > enough
        if moving == 0:
            break


@compiled
def take_off(holes: Holes, u: FloatArray, v: FloatArray, left: FloatArray) -> None:
    """Subtract what cables spend in one joint.

    Args:
        holes: Of the cables, m of them.
        u: tan(alpha / 2) of the joint, shape (n_samples,); [-].
        v: tan(theta / 2) of the joint, shape (n_samples,); [-].
        left: Cable lengths not yet accounted for, shape (m, n_samples), reduced; [m].
    """
    d, bulge = 2.0 * holes.half_gap, 2.0 * holes.radius * holes.radius
    gap, y, z = holes.half_gap * d, holes.y, holes.z
    parts = np.zeros((5, u.size))
    g0, g1, g2, g3, g4 = parts[0], parts[1], parts[2], parts[3], parts[4]
    for k in range(u.size):
        square_u, square_v = u[k] * u[k], v[k] * v[k]
        scale_u, scale_v = 1.0 / (1.0 + square_u), 1.0 / (1.0 + square_v)
        ca, sa = (1.0 - square_u) * scale_u, 2.0 * u[k] * scale_u
        ct, st = (1.0 - square_v) * scale_v, 2.0 * v[k] * scale_v
        g0[k] = gap * (1.0 + ca * ct) + bulge * (1.0 - ca)
        g1[k], g2[k] = d * sa * (1.0 + ct), d * st * (1.0 + ca)
        g3[k], g4[k] = 2.0 * (ca - ct), -2.0 * sa * st
    for hole in range(y.size):
        b, c, row = y[hole], z[hole], left[hole]
        for k in range(row.size):
            square = g0[k] + b * (c * g4[k] - g1[k]) + c * (c * g3[k] + g2[k])
            row[k] -= sqrt(0.0 if square < 0.0 else square)
