"""Arcs and splines as polylines that stay within a stated distance of them."""

from math import asin, ceil, pi, sqrt
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.tolerances import TOLERANCES

MOST_CORNERS: Final = 1_000_000
"""Of one curve: a tolerance that asks for more is a slip."""


def circle_from(
    start: FloatArray,
    centre: FloatArray,
    normal: FloatArray,
    turn: float,
    tolerance: float,
) -> FloatArray:
    """Corners of the arc that begins at a point and turns about an axis.

    Args:
        start: Where it begins, shape (3,); the corners come after it.
        centre: Shape (3,).
        normal: Axis of the turn, right-handed, of any length, shape (3,).
        turn: How far; a whole turn ends in the start, to the last bit; [rad].
        tolerance: Largest distance of the polyline from the arc.

    Returns:
        Shape (n, 3), in the unit of the arguments.

    Raises:
        InvalidInput: If the start is the centre or off the plane of the circle, the
            axis has no direction, or the corners would be too many.
    """
    length = float(np.linalg.norm(normal))
    arm = start - centre
    if not length > 0.0:
        message = "has a normal without direction"
        raise InvalidInput(message)
    axis = normal / length
    height = float(arm @ axis)
    across = arm - height * axis
    radius = float(np.linalg.norm(across))
    if not radius > 0.0:
        message = "begins at its own centre"
        raise InvalidInput(message)
    if not abs(height) <= TOLERANCES.circle_plane * radius:
        message = (
            f"begins {abs(height) / radius:.3g} radii off the plane of the "
            "circle, expected in it"
        )
        raise InvalidInput(message)
    # The chord of the widest step leaves the arc by the tolerance.
    widest = 4.0 * asin(min(sqrt(0.5 * tolerance / radius), 0.25))
    count = _steps(abs(turn), widest)
    angles = turn * np.arange(1, count + 1)[:, None] / count
    sideways = np.cross(axis, across)
    corners = centre + height * axis + np.cos(angles) * across
    corners += np.sin(angles) * sideways
    if abs(turn) == 2.0 * pi:
        corners[-1] = start
    return corners


def arc_through(
    start: FloatArray, middle: FloatArray, end: FloatArray, tolerance: float
) -> FloatArray:
    """Corners of the arc from one point through a second to a third.

    Args:
        start: Shape (3,); the corners come after it.
        middle: Shape (3,).
        end: Shape (3,); the last corner, to the last bit.
        tolerance: Largest distance of the polyline from the arc.

    Returns:
        Shape (n, 3), in the unit of the arguments.

    Raises:
        InvalidInput: If the three points lie on one line, or the corners would be too
            many.
    """
    u, v = middle - start, end - start
    normal = np.cross(u, v)
    uu, vv, nn = float(u @ u), float(v @ v), float(normal @ normal)
    if not nn > TOLERANCES.parallel**2 * uu * vv:
        message = "goes through three points on one line, which is no arc"
        raise InvalidInput(message)
    arm = np.cross(uu * v - vv * u, normal) / (2.0 * nn)
    begin, ahead = -arm, v - arm
    turn = float(np.arctan2(normal @ np.cross(begin, ahead) / sqrt(nn), begin @ ahead))
    turn = turn if turn > 0.0 else turn + 2.0 * pi
    corners = circle_from(start, start + arm, normal, turn, tolerance)
    corners[-1] = end
    return corners


def spline_through(points: FloatArray, tolerance: float) -> FloatArray:
    """Corners of the centripetal Catmull-Rom spline through points.

    It has a tangent everywhere, turns into no loop between two points (Yuksel, Schaefer
    and Keyser 2011), and changes only near a point that is moved.

    Args:
        points: No two in a row equal, shape (n, 3), n >= 2; corners come after the
            first.
        tolerance: Largest distance of the polyline from the spline.

    Returns:
        Shape (m, 3), in the unit of the arguments; the points are among them, to the
        last bit.

    Raises:
        InvalidInput: If two points in a row are equal, or the corners would be too
            many.
    """
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not (chords > 0.0).all():
        message = "has a point twice in a row"
        raise InvalidInput(message)
    spans = np.sqrt(chords)
    slopes = _slopes(points, spans)
    pieces = [
        _hermite(points[i : i + 2], spans[i] * slopes[i : i + 2], tolerance)
        for i in range(len(spans))
    ]
    return np.concatenate(pieces)


def _slopes(points: FloatArray, spans: FloatArray) -> FloatArray:
    """Tangents by the spline's parameter: of the parabola through three points."""
    slopes = np.zeros_like(points)
    rates = np.diff(points, axis=0) / spans[:, None]
    before, after = spans[:-1, None], spans[1:, None]
    slopes[1:-1] = (after * rates[:-1] + before * rates[1:]) / (before + after)
    slopes[0] = rates[0] if len(spans) < 2 else 2.0 * rates[0] - slopes[1]
    slopes[-1] = rates[-1] if len(spans) < 2 else 2.0 * rates[-1] - slopes[-2]
    return slopes


def _hermite(ends: FloatArray, tangents: FloatArray, tolerance: float) -> FloatArray:
    """A cubic piece cut evenly: its chord strays at most |p''| h^2 / 8."""
    (p, q), (u, v) = ends, tangents
    bend_p, bend_q = (
        6.0 * (q - p) - 4.0 * u - 2.0 * v,
        6.0 * (p - q) + 2.0 * u + 4.0 * v,
    )
    bend = max(float(np.linalg.norm(bend_p)), float(np.linalg.norm(bend_q)))
    count = _steps(sqrt(bend), sqrt(8.0 * tolerance))
    s = np.arange(1, count + 1)[:, None] / count
    basis = s * s * (3.0 - 2.0 * s), s * (1.0 - s) ** 2, s * s * (s - 1.0)
    corners: FloatArray = p + basis[0] * (q - p) + basis[1] * u + basis[2] * v
    corners[-1] = q
    return corners


def _steps(whole: float, widest: float) -> int:
    if not whole <= MOST_CORNERS * widest:
        message = f"needs more than {MOST_CORNERS} corners at this tolerance"
        raise InvalidInput(message)
    return max(1, ceil(whole / widest))
