"""Boxes of links over a block of intervals against those of obstacles, compiled.

Arrays have the obstacles last: the loops over them are what a compiler turns into
vector instructions.
"""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import second_order
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.rows import Rows
from vdsm_pin.proof.terms import Rules


@compiled
def _growth(rules: Rules, rows: Rows, count: int, joint: int) -> float:
    """How far O_joint may leave the box of its rows: sag and error box; [m]."""
    sag = drift = swing = behind = 0.0
    for r in range(count):
        sag = max(sag, rows.sags[0, joint, r])
        drift = max(drift, rows.drifts[0, joint, r])
    for link in range(joint - 1, -1, -1):
        behind += rules.lengths[link]
        swing += 2.0 * behind
    error = rules.joint_error * (swing + 0.5 * drift) + rules.base_error
    return error + sag + second_order(rules.lengths, 0, joint, rules.joint_error)


@compiled
def link_box(
    rules: Rules, rows: Rows, count: int, link: int, low: FloatArray, high: FloatArray
) -> None:
    """Box of a link over a block and the error box, shape (3,) each; [m]."""
    apart()
    low[:], high[:] = np.inf, -np.inf
    for joint in (link, link + 1):
        grown = _growth(rules, rows, count, joint)
        for c in range(3):
            at = rows.centres[0, joint, c, : count + 1]
            for r in range(at.size):
                low[c] = min(low[c], at[r] - grown)
                high[c] = max(high[c], at[r] + grown)


@compiled
def box_gaps(
    box: FloatArray, low: FloatArray, high: FloatArray, lost: float, gap: FloatArray
) -> None:
    """Distance of a link's box from every obstacle's, less what every bound loses."""
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
        gap[o] = sqrt(x * x + y * y + z * z) - lost


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
