"""Follow-the-leader: the arm laid on the curve that its tip has run along."""

from typing import Final

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.tolerances import TOLERANCES

PARTS: Final = 8
"""Pieces of the curve between two joints."""

SAME: Final = TOLERANCES.joint_centre
"""Places no farther apart are one corner of a curve; [m]."""


@compiled
def _beyond(
    curve: FloatArray, at: int, place: FloatArray, length: float, found: FloatArray
) -> int:
    """The next place on a polyline at a distance from a place on it.

    Args:
        curve: Its corners, shape (k, 3); [m].
        at: Corner that comes next after the place.
        place: Shape (3,); [m].
        length: The distance; [m].
        found: Set to what is found, shape (3,); [m].

    Returns:
        The corner that comes next after it, or the number of corners if there is none.
    """
    begin = place.copy()
    for k in range(at, curve.shape[0]):
        a = b = c = 0.0
        for i in range(3):
            side, off = curve[k, i] - begin[i], begin[i] - place[i]
            a += side * side
            b += side * off
            c += off * off
        square = b * b - a * (c - length * length)
        if a > 0.0 and square >= 0.0:
            t = (-b + np.sqrt(square)) / a
            if 0.0 <= t <= 1.0:
                for i in range(3):
                    found[i] = begin[i] + t * (curve[k, i] - begin[i])
                return k
        begin = curve[k].copy()
    return int(curve.shape[0])


@compiled
def _lay(
    curve: FloatArray, begin: int, lengths: FloatArray, centres: FloatArray
) -> None:
    """Lay one arm on a curve.

    Args:
        curve: From the tip backwards, ending far back on the rail, shape (k, 3); [m].
        begin: Corner that comes next after the tip.
        lengths: Of the links, shape (N,); [m].
        centres: Has the tip in its last row; set to the joint centres, NaN where there
            is no such arm, shape (N + 1, 3); [m].
    """
    count, at = lengths.size, begin
    place, found = centres[count].copy(), np.zeros(3)
    for joint in range(count - 1, 0, -1):
        at = _beyond(curve, at, place, lengths[joint], found)
        if at == curve.shape[0]:
            break
        centres[joint], place = found, found.copy()
    square = lengths[0] ** 2 - place[1] ** 2 - place[2] ** 2
    if at < curve.shape[0] and square >= 0.0:
        centres[0, 0] = place[0] - np.sqrt(square)
        centres[0, 1] = centres[0, 2] = 0.0
    else:
        centres[:] = np.nan


@compiled
def followed(centres: FloatArray, tips: FloatArray, lengths: FloatArray) -> FloatArray:
    """Arms whose joints have moved along the arm's own curve after the tip.

    The curve runs from the new tip over the old joint centres and along the rail. Where
    the tip draws back, the old tip is left out of it.

    Args:
        centres: Joint centres before, shape (n, N + 1, 3); [m].
        tips: Where the tips come to be, shape (n, 3); [m].
        lengths: Of the links, shape (N,); [m].

    Returns:
        Joint centres, shape (n, N + 1, 3), NaN where an arm cannot follow; [m].
    """
    count = lengths.size
    result = np.zeros(centres.shape)
    for r in range(centres.shape[0]):
        curve = np.zeros((count + 2, 3))
        ahead = 0.0
        for i in range(count + 1):
            curve[i] = centres[r, count - i]
        curve[count + 1] = curve[count]
        curve[count + 1, 0] -= 2.0 * lengths.sum() + np.abs(tips[r] - curve[0]).sum()
        for i in range(3):
            ahead += (tips[r, i] - curve[0, i]) * (curve[0, i] - curve[1, i])
        result[r, count] = tips[r]
        _lay(curve, 0 if ahead >= 0.0 else 1, lengths, result[r])
    return result


@compiled
def _laid_along(route: FloatArray, own: FloatArray, lengths: FloatArray) -> FloatArray:
    """As `led_along` has it; `own` is what `own_curve` returns for the start."""
    count, points = lengths.size, route.shape[0]
    # Corners from the tip on; ahead of them there is room for those of the route.
    curve = np.zeros((points + own.shape[0], 3))
    curve[points:] = own
    at, result = points, np.zeros((points, count + 1, 3))
    for k in range(points):
        behind = at + 1 < curve.shape[0]
        back = behind and np.abs(route[k] - curve[at + 1]).max() <= SAME
        at += 1 if back else -1
        curve[at] = route[k]
        result[k, count] = route[k]
        _lay(curve, at + 1, lengths, result[k])
    return result


def own_curve(centres: FloatArray) -> FloatArray:
    """What an arm lies on: smooth through its joints, from behind the tip to the rail.

    On chords joints that move on would cut the corners; an arm on an arc moves on along
    the arc.

    Args:
        centres: Joint centres, shape (N + 1, 3); [m].

    Returns:
        Shape (k, 3), far back on the rail at its end; [m].
    """
    joints = centres[::-1]
    sides = np.diff(joints, axis=0)
    size = np.linalg.norm(sides, axis=1, keepdims=True)
    chords = sides / size
    tangents = np.zeros_like(joints)
    # Of the circle through three joints; ahead of the tip it goes on.
    tangents[1:-1] = chords[:-1] * size[1:] + chords[1:] * size[:-1]
    tangents[-1, 0] = -1.0
    tangents[1:-1] /= np.linalg.norm(tangents[1:-1], axis=1, keepdims=True)
    tangents[0] = 2.0 * (chords[0] @ tangents[1]) * chords[0] - tangents[1]
    # Cubic, with tangents so long that it is nearly an arc between two of a circle.
    begin, end = (
        size * tangents[ends] * 2.0 / (1.0 + (chords * tangents[ends]).sum(1)[:, None])
        for ends in (slice(None, -1), slice(1, None))
    )
    t = np.arange(1, PARTS + 1)[:, None] / PARTS
    curve = joints[:-1, None] + t * t * (3.0 - 2.0 * t) * sides[:, None]
    curve += t * (1.0 - t) * ((1.0 - t) * begin[:, None] - t * end[:, None])
    far = joints[-1:] - [2.0 * float(size.sum()), 0.0, 0.0]
    return np.concatenate([curve.reshape(-1, 3), far])


def way_back(start: FloatArray) -> FloatArray:
    """Tips of an arm that draws back along what it lies on until it is straight.

    Args:
        start: Joint centres, shape (N + 1, 3); [m].

    Returns:
        Corners of its own curve, its tip first, shape (k, 3), k = 1 if it is straight.
    """
    curve = np.concatenate([start[-1:], own_curve(start)[:-1]])
    bent = np.flatnonzero(np.abs(curve[:, 1:]).max(axis=1) > SAME)
    return curve[: bent[-1] + 2] if bent.size else curve[:1]


def led_along(route: FloatArray, start: FloatArray, lengths: FloatArray) -> FloatArray:
    """The arm at every point of its tip's route, laid on what the tip has run along.

    Where the next point is the corner before, the arm draws back: what lay ahead of it
    is forgotten.

    Args:
        route: Of the tip, shape (k, 3); [m].
        start: Joint centres at its first point, shape (N + 1, 3); [m].
        lengths: Of the links, shape (N,); [m].

    Returns:
        Joint centres, shape (k, N + 1, 3), NaN where there is no such arm; [m].
    """
    laid = _laid_along(np.ascontiguousarray(route), own_curve(start), lengths)
    laid[0] = start
    return laid
