"""How close rows of a trajectory must be."""

from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.tolerances import TOLERANCES

STRAYS: Final = 0.95
"""Share of the spacing that the tip may stray from a straight line, by its bound; [-].

Verifiers ask for the whole, what the tip is off at the waypoints included."""


def count_of(parts: FloatArray) -> IntArray:
    """Whole numbers not less than these, but for rounding; same shape."""
    whole = np.ceil(np.asarray(parts) - TOLERANCES.whole_parts)
    return np.asarray(whole.astype(np.int64))


def spread(counts: IntArray) -> tuple[IntArray, FloatArray]:
    """Places that divide each interval evenly, the very last corner included.

    Args:
        counts: Number of places from each corner (included) to the next (left out).

    Returns:
        The interval of each place, and where in it, 0 to 1, shape (r,) each.
    """
    interval = np.repeat(np.arange(len(counts)), counts)
    begin = np.cumsum(counts) - counts
    share = (np.arange(counts.sum()) - begin[interval]) / counts[interval]
    return np.append(interval, len(counts) - 1), np.append(share, 1.0)


def stepped(corners: FloatArray, step: float) -> tuple[FloatArray, BoolArray]:
    """Points along a polyline at most a step apart, and which are corners.

    Args:
        corners: Shape (k, d); [m].
        step: [m].

    Returns:
        Shape (n, d), every corner among them; shape (n,).
    """
    sides = np.diff(corners, axis=0)
    counts = np.maximum(1, count_of(np.linalg.norm(sides, axis=1) / step))
    side = np.repeat(np.arange(len(counts)), counts)
    number = 1 + np.arange(len(side)) - (np.cumsum(counts) - counts)[side]
    points = corners[side] + sides[side] * number[:, None] / counts[side, None]
    last = number == counts[side]
    points[last] = corners[1:]
    return np.concatenate([corners[:1], points]), np.append(True, last)


def row_steps(
    manipulator: Manipulator, alpha: FloatArray, theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How far joints turn and the tip may stray from a straight line between two rows.

    The tip's second derivative is at most M = sum of L_l W_l^2, where W_l is how much
    all joints up to link l turn; so the tip stays within M / 8 of its chord.

    Args:
        manipulator: The arm.
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].

    Returns:
        Largest change of a joint angle [rad] and M / 8 [m], (n_samples - 1,) each.
    """
    yaw, pitch = np.abs(np.diff(alpha, axis=0)), np.abs(np.diff(theta, axis=0))
    largest = np.maximum(yaw, pitch).max(axis=1)
    turning = np.cumsum(yaw + pitch, axis=1)
    bounds = np.cumsum(turning * turning * manipulator.link_lengths, axis=1)
    return largest, bounds[:, -1] / 8.0
