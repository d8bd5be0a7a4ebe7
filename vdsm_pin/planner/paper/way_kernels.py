"""Compiled ways round the danger region: tangents, what it hides, the taut way.

Regions as in `region_kernels.py`.
"""

from math import sqrt

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.paper.region_kernels import Core, point_to_core, sides_of, wrapped


@compiled
def tangent_of(
    core: Core, centre: FloatArray, point: FloatArray, sense: int
) -> tuple[int, float]:
    """Where the tangent from a point outside touches.

    Args:
        core: Of the region.
        centre: A point inside, shape (2,).
        point: Shape (2,).
        sense: 1 for the tangent a counterclockwise walk leaves on (region on the left),
            -1 for the other.

    Returns:
        The corner whose arc is touched, and the direction of the boundary's outward
        normal there; [rad].
    """
    corners, radius = core
    towards = np.arctan2(centre[1] - point[1], centre[0] - point[0])
    touched, least, heading = 0, np.inf, towards
    for i in range(corners.shape[0]):
        x, y = corners[i, 0] - point[0], corners[i, 1] - point[1]
        spread = np.arcsin(min(radius / sqrt(x * x + y * y), 1.0))
        swing = wrapped(np.arctan2(y, x) - towards) - sense * spread
        if sense * swing < least:
            touched, least, heading = i, sense * swing, towards + swing
    return touched, heading - sense * np.pi / 2.0


@compiled
def covered(
    core: Core, centre: FloatArray, touch: float, points: FloatArray
) -> BoolArray:
    """Which points the straight arm from the origin reaches through the region only.

    Args:
        core: Of the region.
        centre: A point inside, shape (2,).
        touch: Points nearer to the core count as inside, not as covered.
        points: Shape (n, 2).
    """
    (corners, radius), origin = core, np.zeros(2)
    low, low_normal = tangent_of(core, centre, origin, 1)
    high, high_normal = tangent_of(core, centre, origin, -1)
    right_x = corners[low, 0] + radius * np.cos(low_normal)
    right_y = corners[low, 1] + radius * np.sin(low_normal)
    left_x = corners[high, 0] + radius * np.cos(high_normal)
    left_y = corners[high, 1] + radius * np.sin(high_normal)
    chord_x, chord_y = left_x - right_x, left_y - right_y
    result = np.zeros(points.shape[0], np.bool_)
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        # Outside the region but inside the wedge: beyond it iff beyond its chord.
        result[k] = (
            right_x * y - right_y * x > 0.0
            and left_x * y - left_y * x < 0.0
            and chord_x * (y - right_y) - chord_y * (x - right_x) < 0.0
            and not point_to_core(corners, x, y) < touch
        )
    return result


@compiled
def walk_round(
    core: Core,
    centre: FloatArray,
    start: FloatArray,
    end: FloatArray,
    sense: int,
    step: float,
) -> FloatArray:
    """The taut way from start round the region to end.

    Args:
        core: Of the region.
        centre: A point inside, shape (2,).
        start: Outside or on the boundary, shape (2,).
        end: Outside or on the boundary, shape (2,).
        sense: 1 counterclockwise, -1 clockwise.
        step: Turn between two corners of the way along an arc; [rad].

    Returns:
        Polyline from start to end, shape (m, 2).
    """
    corners, radius = core
    leave = tangent_of(core, centre, start, sense)[1]
    arrive = tangent_of(core, centre, end, -sense)[1]
    turn = (sense * (arrive - leave)) % (2.0 * np.pi)
    # Corners of a way lie outside the arc, so that its chords do not cut in.
    grown = radius / np.cos(0.5 * step)
    sides = sides_of(corners, grown)
    passed = np.full(len(sides), np.inf)
    for i in range(len(sides)):
        along = np.arctan2(
            sides[i, 1, 1] - sides[i, 0, 1], sides[i, 1, 0] - sides[i, 0, 0]
        )
        passed[i] = (sense * (along - np.pi / 2.0 - leave)) % (2.0 * np.pi)
    n_arcs = int(np.ceil(turn / step)) + 1
    way = np.zeros((n_arcs + 2 * len(sides) + 2, 2))
    way[0], m = start, 1
    for j in range(n_arcs):
        turned = turn if j == n_arcs - 1 else j * step
        # The straight sides passed on the way, each by its two ends.
        while len(sides) > 0 and passed.min() < turned:
            i = int(np.argmin(passed))
            first = 0 if sense > 0 else 1
            way[m], way[m + 1] = sides[i, first], sides[i, 1 - first]
            passed[i] = np.inf
            m += 2
        normal = leave + sense * turned
        x, y = np.cos(normal), np.sin(normal)
        best, ahead = 0, -np.inf
        for i in range(corners.shape[0]):
            reach = corners[i, 0] * x + corners[i, 1] * y
            if reach > ahead:
                best, ahead = i, reach
        way[m, 0], way[m, 1] = (
            corners[best, 0] + grown * x,
            corners[best, 1] + grown * y,
        )
        m += 1
    way[m] = end
    return way[: m + 1]
