"""Compiled geometry of the danger region: lines and circles out of it, distances to it.

A region is the convex hull of `corners`, counterclockwise, (n, 2), n >= 1, grown by
`radius`; `sides` are the straight parts of its boundary, (n, 2 ends, 2), for n > 1.
Everything is in the projection plane and in metres.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray


class Core(NamedTuple):
    """A region, as compiled code takes it."""

    corners: FloatArray
    """Shape (n, 2); [m]."""

    radius: float
    """[m]."""


@compiled
def leave_along(
    corners: FloatArray,
    sides: FloatArray,
    radius: float,
    x: float,
    y: float,
    ux: float,
    uy: float,
) -> float:
    """How far along (ux, uy) the line through (x, y) leaves the region; -inf: never."""
    far = -np.inf
    for i in range(corners.shape[0]):
        dx, dy = corners[i, 0] - x, corners[i, 1] - y
        squared = radius * radius - (ux * dy - uy * dx) ** 2
        if squared >= 0.0:
            far = max(far, dx * ux + dy * uy + np.sqrt(squared))
    for i in range(sides.shape[0]):
        ax, ay = sides[i, 0, 0] - x, sides[i, 0, 1] - y
        bx, by = sides[i, 1, 0] - x, sides[i, 1, 1] - y
        # The ends lie on either side of the line where it crosses.
        a, b = ux * ay - uy * ax, ux * by - uy * bx
        if a * b <= 0.0 and a != b:
            part = a / (a - b)
            hit_x, hit_y = ax + part * (bx - ax), ay + part * (by - ay)
            far = max(far, hit_x * ux + hit_y * uy)
    return far


@compiled
def wrapped(angle: float) -> float:
    """The angle brought into [-pi, pi); [rad]."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


@compiled
def reach_along_circle(
    corners: FloatArray,
    sides: FloatArray,
    radius: float,
    circle: float,
    bearing: float,
    side: int,
) -> float:
    """Largest angle, from a bearing to a side, at which a circle meets the boundary.

    The circle is about the origin; -inf where it does not meet the boundary.
    """
    extent = -np.inf
    for i in range(corners.shape[0]):
        cx, cy = corners[i, 0], corners[i, 1]
        distance = np.hypot(cx, cy)
        cosine = circle * circle + distance * distance - radius * radius
        cosine /= 2.0 * circle * distance
        if abs(cosine) <= 1.0:
            towards = side * wrapped(np.arctan2(cy, cx) - bearing)
            extent = max(extent, towards + np.arccos(cosine))
    for i in range(sides.shape[0]):
        ax, ay = sides[i, 0, 0], sides[i, 0, 1]
        ux, uy = sides[i, 1, 0] - ax, sides[i, 1, 1] - ay
        squared, half = ux * ux + uy * uy, ax * ux + ay * uy
        under = half * half - squared * (ax * ax + ay * ay - circle * circle)
        if under < 0.0:
            continue
        for sign in (1.0, -1.0):
            part = (sign * np.sqrt(under) - half) / squared
            if 0.0 <= part <= 1.0:
                hit = np.arctan2(ay + part * uy, ax + part * ux)
                extent = max(extent, side * wrapped(hit - bearing))
    return extent


@compiled
def _squared(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Square of the distance of p from the segment a-b."""
    ux, uy, vx, vy = bx - ax, by - ay, px - ax, py - ay
    squared = ux * ux + uy * uy
    part = 0.0
    if squared > 0.0:
        part = min(max((vx * ux + vy * uy) / squared, 0.0), 1.0)
    across, along = vx - part * ux, vy - part * uy
    return across * across + along * along


@compiled
def segment_to_core(
    corners: FloatArray, ax: float, ay: float, bx: float, by: float
) -> float:
    """Distance of the segment a-b from the hull of the corners; 0 where they meet."""
    n = corners.shape[0]
    nearest = np.inf
    # The part of the segment inside every edge's half-plane, from low to high.
    low, high = 0.0, 1.0 if n > 2 else -1.0
    for i in range(n):
        cx, cy = corners[i, 0], corners[i, 1]
        nearest = min(nearest, _squared(cx, cy, ax, ay, bx, by))
        if n == 1:
            break
        dx, dy = corners[(i + 1) % n, 0], corners[(i + 1) % n, 1]
        nearest = min(nearest, _squared(ax, ay, cx, cy, dx, dy))
        nearest = min(nearest, _squared(bx, by, cx, cy, dx, dy))
        inside_a = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
        inside_b = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
        if n == 2 and i == 0 and inside_a * inside_b < 0.0:
            # Two segments cross where either separates the ends of the other.
            of_c = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            of_d = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
            if of_c * of_d < 0.0:
                return 0.0
        if inside_a < 0.0 and inside_b < 0.0:
            high = -1.0
        elif inside_a < 0.0:
            low = max(low, inside_a / (inside_a - inside_b))
        elif inside_b < 0.0:
            high = min(high, inside_a / (inside_a - inside_b))
    return 0.0 if low <= high else sqrt(nearest)


@compiled
def keeps_out(
    corners: FloatArray, radius: float, ax: float, ay: float, bx: float, by: float
) -> bool:
    """Whether the segment a-b stays out of the region."""
    n, squared = corners.shape[0], radius * radius
    for i in range(n):
        cx, cy = corners[i, 0], corners[i, 1]
        if not _squared(cx, cy, ax, ay, bx, by) >= squared:
            return False
    return n == 1 or segment_to_core(corners, ax, ay, bx, by) >= radius


@compiled
def point_to_core(corners: FloatArray, x: float, y: float) -> float:
    """Distance of a point from the hull of the corners; 0 inside."""
    n = corners.shape[0]
    nearest, inside = np.inf, n > 2
    for i in range(n):
        ax, ay = corners[i, 0], corners[i, 1]
        bx, by = corners[(i + 1) % n, 0], corners[(i + 1) % n, 1]
        nearest = min(nearest, _squared(x, y, ax, ay, bx, by))
        if (bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0.0:
            inside = False
    return 0.0 if inside else sqrt(nearest)


@compiled
def core_distances(corners: FloatArray, chains: FloatArray) -> FloatArray:
    """Distance of each side of polylines from the hull, (n, m, 2) to (n, m - 1)."""
    result = np.zeros((chains.shape[0], chains.shape[1] - 1))
    for k in range(chains.shape[0]):
        for i in range(chains.shape[1] - 1):
            a, b = chains[k, i], chains[k, i + 1]
            result[k, i] = segment_to_core(corners, a[0], a[1], b[0], b[1])
    return result


@compiled
def core_gaps(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Distance of each point from the hull of the corners, (n, 2) to (n,)."""
    result = np.zeros(points.shape[0])
    for k in range(points.shape[0]):
        result[k] = point_to_core(corners, points[k, 0], points[k, 1])
    return result


@compiled
def sides_of(corners: FloatArray, radius: float) -> FloatArray:
    """Straight parts of the boundary, shape (n, 2 ends, 2); empty for a disc."""
    n = corners.shape[0]
    sides = np.zeros((n if n > 1 else 0, 2, 2))
    for i in range(sides.shape[0]):
        a, b = corners[i], corners[(i + 1) % n]
        ux, uy = b[0] - a[0], b[1] - a[1]
        length = np.hypot(ux, uy)
        out_x, out_y = radius * uy / length, -radius * ux / length
        sides[i, 0, 0], sides[i, 0, 1] = a[0] + out_x, a[1] + out_y
        sides[i, 1, 0], sides[i, 1, 1] = b[0] + out_x, b[1] + out_y
    return sides
