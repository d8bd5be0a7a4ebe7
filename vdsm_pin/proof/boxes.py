"""Boxes of bodies over some intervals against those of obstacles, compiled.

Arrays have the obstacles last: the loops over them are what a compiler turns into
vector instructions.
"""

from math import sqrt

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.proof.error_growth import crude_growth
from vdsm_pin.proof.row_places import seen
from vdsm_pin.proof.rows import Rows
from vdsm_pin.proof.terms import Task, finer


@compiled(inline=False)
def body_box(
    task: Task,
    rows: Rows,
    span: tuple[int, int],
    pair: int,
    low: FloatArray,
    high: FloatArray,
) -> float:
    """Box of a body's core over intervals and the error box, shape (3,) each; [m].

    Its ball and shifts are left to what every plane of a pair loses. Of many corners
    few are looked at.

    Args:
        task: The bodies and the error box.
        rows: The block.
        span: Its first interval and one past the last.
        pair: A pair of the body with a partner in the world.
        low: Written.
        high: Written.

    Returns:
        The sum of its sides; [m].
    """
    first, last = span
    low[:], high[:] = np.inf, -np.inf
    bodies, places, tracks = task.bodies, task.places, rows.tracks
    body, few = task.pairs.body[pair], finer(task.pairs, pair, pair)
    loose = task.pairs.loose[few]
    for place in seen(task, rows, few).slots:
        grown, sag = bodies.discs[body, RADIUS] + loose, tracks.sags[place]
        drift = 0.0
        for r in range(first, last):
            drift = max(drift, sag[r])
        grown += drift
        if not task.rules.steady:
            drift = 0.0
            for r in range(first, last):
                drift = max(drift, tracks.drifts[place, r])
            way, lever = places.way[place], places.lever[place]
            grown += 0.5 * drift + crude_growth(task.errors, way, lever)
        for c in range(3):
            at = tracks.places[place, c]
            for r in range(first, last + 1):
                low[c] = min(low[c], at[r] - grown)
                high[c] = max(high[c], at[r] + grown)
    return float(high[0] - low[0] + high[1] - low[1] + high[2] - low[2])


@compiled(inline=False)
def box_gaps(
    box: FloatArray, low: FloatArray, high: FloatArray, gap: FloatArray
) -> None:
    """Distance of a body's box from every obstacle's; [m]."""
    lx, ly, lz, hx, hy, hz = (
        box[0, 0],
        box[0, 1],
        box[0, 2],
        box[1, 0],
        box[1, 1],
        box[1, 2],
    )
    ax, ay, az, bx, by, bz = low[0], low[1], low[2], high[0], high[1], high[2]
    for o in range(gap.size):
        x = max(lx[o] - bx, ax - hx[o], 0.0)
        y = max(ly[o] - by, ay - hy[o], 0.0)
        z = max(lz[o] - bz, az - hz[o], 0.0)
        gap[o] = sqrt(x * x + y * y + z * z)


@compiled(inline=False)
def box_reaches(
    point: FloatArray, low: FloatArray, high: FloatArray, rise: float, reach: FloatArray
) -> None:
    """Upper bounds: the farthest corner from a point of each obstacle; [m]."""
    px, py, pz = point[0], point[1], point[2]
    ax, ay, az, bx, by, bz = low[0], low[1], low[2], high[0], high[1], high[2]
    for o in range(reach.size):
        x = max(px[o] - ax, bx - px[o])
        y = max(py[o] - ay, by - py[o])
        z = max(pz[o] - az, bz - pz[o])
        reach[o] = sqrt(x * x + y * y + z * z) + rise
