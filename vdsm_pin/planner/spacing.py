"""How close rows of a trajectory must be."""

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray, IntArray, read_only
from vdsm_pin.planner.row_kernels import steps_between
from vdsm_pin.tolerances import TOLERANCES


def count_of(parts: FloatArray) -> IntArray:
    """Whole numbers not less than these, but for rounding; same shape."""
    whole = np.ceil(np.asarray(parts) - TOLERANCES.whole_parts)
    return np.asarray(whole.astype(np.int64))


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
    steps = np.zeros((2, max(len(alpha) - 1, 0)))
    rows = read_only(alpha), read_only(theta)
    steps_between(*rows, manipulator.link_lengths, steps)
    return steps[0], steps[1]
