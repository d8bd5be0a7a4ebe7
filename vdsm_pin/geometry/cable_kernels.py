"""Joint angles from cable lengths, compiled: Eq. 16-21 of the paper inverted.

Seven functions of a joint's angles times seven constants of a hole give the squared
span of a cable (see `vdsm_pin.cables`). In u = tan(alpha / 2) and v = tan(theta / 2)
all seven are rational. Samples run along the last axis, innermost, where the compiler
works on several at once.
"""

from math import sqrt

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import compiled


@compiled
def solve_joint(
    holes: FloatArray,
    spans: FloatArray,
    u: FloatArray,
    v: FloatArray,
    rounds: int,
    enough: float,
) -> None:
    """Gauss-Newton for the two angles of a joint that give its three spans.

    Args:
        holes: Constants of the three holes, shape (3, 7); [m^2].
        spans: Cable lengths inside the joint, shape (3, n_samples); [m].
        u: A guess of tan(alpha / 2), overwritten by the result, (n_samples,); [-].
        v: A guess of tan(theta / 2), overwritten by the result, (n_samples,); [-].
        rounds: Largest number of steps.
        enough: Step after which the next one would be rounding; [-].
    """
    for _ in range(rounds):
        # An integer, because the order of a sum of floats would forbid vector code.
        moving = 0
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
            moving += abs(du) + abs(dv) > enough
        if moving == 0:
            break


@compiled
def take_off(holes: FloatArray, u: FloatArray, v: FloatArray, left: FloatArray) -> None:
    """Subtract what cables spend in one joint (Eq. 20).

    Args:
        holes: Constants of the holes, shape (m, 7); [m^2].
        u: tan(alpha / 2) of the joint, shape (n_samples,); [-].
        v: tan(theta / 2) of the joint, shape (n_samples,); [-].
        left: Cable lengths not yet accounted for, shape (m, n_samples), reduced; [m].
    """
    for hole in range(len(holes)):
        c = holes[hole]
        for k in range(u.size):
            square_u, square_v = u[k] * u[k], v[k] * v[k]
            scale_u, scale_v = 1.0 / (1.0 + square_u), 1.0 / (1.0 + square_v)
            ca, sa = (1.0 - square_u) * scale_u, 2.0 * u[k] * scale_u
            ct, st = (1.0 - square_v) * scale_v, 2.0 * v[k] * scale_v
            square = (
                (c[0] + c[1] * ca * ct)
                + (c[2] * sa * (1.0 + ct) + c[3] * st * (1.0 + ca))
                + (c[4] * ca + c[5] * ct + c[6] * sa * st)
            )
            left[hole, k] -= sqrt(max(square, 0.0))
