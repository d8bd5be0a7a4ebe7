"""Boxes of bodies over a block of intervals against those of obstacles, compiled.

Arrays have the obstacles last: the loops over them are what a compiler turns into
vector instructions.
"""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import turned_by
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.coasting import crude_growth
from vdsm_pin.proof.rows import BLOCK, Rows, place_corner
from vdsm_pin.proof.terms import Task


@compiled
def _growth(task: Task, rows: Rows, count: int, body: int, corner: int) -> float:
    """How far a corner may leave the box of its rows: sag and error box; [m]."""
    rules, bodies = task.rules, task.bodies
    link, lever = bodies.link[body], bodies.levers[bodies.first[body] + corner]
    sag = drift = 0.0
    error = lever * turned_by(rules.joint_errors, 0, link)
    for r in range(count):
        turning = 0.0
        for k in range(link + 1):
            turning += rows.turns[k, r]
        sag = max(sag, rows.sags[0, link, r] + 0.125 * lever * turning * turning)
        if rules.joints_err:
            drift = max(drift, rows.drifts[0, link, r] + error * turning)
    grown = sag + 0.5 * drift + bodies.discs[body, RADIUS]
    return float(grown + crude_growth(rules, 0, link, lever))


@compiled
def body_box(
    task: Task,
    rows: Rows,
    count: int,
    body: int,
    low: FloatArray,
    high: FloatArray,
) -> None:
    """Box of a body's core over a block and the error box, shape (3,) each; [m].

    Its ball and shifts are left to what every plane of a pair loses.
    """
    apart()
    low[:], high[:] = np.inf, -np.inf
    bodies, at = task.bodies, np.zeros((3, BLOCK + 1))
    first, link = bodies.first[body], bodies.link[body]
    for corner in range(bodies.first[body + 1] - first):
        grown = _growth(task, rows, count, body, corner)
        place_corner(rows, link, bodies.corners[first + corner], count + 1, at)
        if task.rules.base_turn > 0.0:
            far = 0.0
            for r in range(count + 1):
                far = max(far, at[0, r] ** 2 + at[1, r] ** 2 + at[2, r] ** 2)
            grown += task.rules.base_turn * (sqrt(far) + grown)
        for c in range(3):
            for r in range(count + 1):
                low[c] = min(low[c], at[c, r] - grown)
                high[c] = max(high[c], at[c, r] + grown)


@compiled
def box_gaps(
    box: FloatArray, low: FloatArray, high: FloatArray, gap: FloatArray
) -> None:
    """Distance of a body's box from every obstacle's."""
    apart()
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


@compiled
def box_reaches(
    point: FloatArray,
    low: FloatArray,
    high: FloatArray,
    rise: float,
    far: BoolArray,
    reach: FloatArray,
) -> None:
    """Upper bounds: the farthest corner from a point of the obstacle; inf if near."""
    apart()
    px, py, pz = point[0], point[1], point[2]
    ax, ay, az, bx, by, bz = low[0], low[1], low[2], high[0], high[1], high[2]
    for o in range(reach.size):
        x = max(px[o] - ax, bx - px[o])
        y = max(py[o] - ay, by - py[o])
        z = max(pz[o] - az, bz - pz[o])
        corner = sqrt(x * x + y * y + z * z) + rise
        reach[o] = corner if far[o] else np.inf
