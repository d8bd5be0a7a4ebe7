"""Poses of arms with one knee: every shape at every tip, in compiled code."""

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray

COSINE_ROUNDING = 1e-12
"""By which cosines of angles at their limit may be less; arctan decides; [-]."""


@compiled
def pose_shapes(
    tips: FloatArray,
    whole: BoolArray,
    knees: IntArray,
    slopes: FloatArray,
    stations: FloatArray,
    limit: float,
    base_range: tuple[float, float],
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Every shape at every tip, where it keeps the joint limits (Eq. 7).

    Args:
        tips: Shape (k, 3); [m].
        whole: Tips where all shapes are wanted; elsewhere it is shape 0, shape (k,).
        knees: Of `Shapes`, shape (n,).
        slopes: Of `Shapes`, shape (n, 2); [-].
        stations: Arc length of each joint centre, shape (N + 1,); [m].
        limit: Largest link angle; [rad].
        base_range: Smallest and largest x0; [m].

    Returns:
        node numbers tip * n + shape, ascending, shape (v,); the ends of both straight
        pieces, shape (v, 3, 3) [m]; psi of joint 1 and of the knee, (v, 2) [rad].
    """
    size = tips.shape[0] + whole.sum() * (knees.shape[0] - 1)
    node = np.zeros(size, dtype=np.int64)
    ends, bends = np.zeros((size, 3, 3)), np.zeros((size, 2))
    tried = (tips, whole, knees, slopes, stations)
    count = _pose_all(tried, limit, base_range, (node, ends, bends))
    return node[:count], ends[:count], bends[:count]


@compiled(inline=False)
def _pose_all(
    tried: tuple[FloatArray, BoolArray, IntArray, FloatArray, FloatArray],
    limit: float,
    base_range: tuple[float, float],
    out: tuple[IntArray, FloatArray, FloatArray],
) -> int:
    """Write what `pose_shapes` returns; its number of rows is returned."""
    tips, whole, knees, slopes, stations = borrowed(tried)
    node, ends, bends = borrowed(out)
    n_shapes, count = knees.shape[0], 0
    for k in range(tips.shape[0]):
        for c in range(n_shapes if whole[k] else 1):
            fits = _pose(
                tips[k], knees[c], slopes[c], stations, limit, ends[count], bends[count]
            )
            if fits and base_range[0] <= ends[count, 0, 0] <= base_range[1]:
                node[count] = k * n_shapes + c
                count += 1
    return count


@compiled
def _pose(
    tip: FloatArray,
    knee: int,
    slopes: FloatArray,
    stations: FloatArray,
    limit: float,
    ends: FloatArray,
    bends: FloatArray,
) -> bool:
    """One shape at one tip, back from the tip; False where it breaks the limit."""
    before, after = stations[knee], stations[-1] - stations[knee]
    y, z = before * slopes[0], before * slopes[1]
    vy, vz = (tip[1] - y) / after, (tip[2] - z) / after
    across = vy * vy + vz * vz
    if across >= 1.0:
        return False
    vx = np.sqrt(1.0 - across)
    wy, wz = slopes
    if knee == 0:
        wy, wz = vy, vz
    wx = np.sqrt(1.0 - wy * wy - wz * wz)
    # Most poses break the limit; cosines tell so without an arctan.
    least = np.cos(limit) - COSINE_ROUNDING
    if wx < least or wx * vx + wy * vy + wz * vz < least:
        return False
    bends[0] = np.arctan2(np.sqrt(wy * wy + wz * wz), wx)
    bends[1] = _angle(wx, wy, wz, vx, vy, vz)
    if not (bends[0] <= limit and bends[1] <= limit):
        return False
    x = tip[0] - after * vx
    ends[0, 0], ends[0, 1], ends[0, 2] = x - before * wx, 0.0, 0.0
    ends[1, 0], ends[1, 1], ends[1, 2] = x, y, z
    ends[2, 0], ends[2, 1], ends[2, 2] = tip
    return True


@compiled
def _angle(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    cross = np.sqrt(cx * cx + cy * cy + cz * cz)
    return float(np.arctan2(cross, ax * bx + ay * by + az * bz))
