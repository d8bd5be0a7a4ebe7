"""How close rows of a trajectory must be."""

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray, read_only
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
    _row_steps(*rows, manipulator.link_lengths, steps)
    return steps[0], steps[1]


@compiled
def _row_steps(
    alpha: FloatArray, theta: FloatArray, lengths: FloatArray, steps: FloatArray
) -> None:
    """What `row_steps` returns.

    Args:
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].
        lengths: Of the links, shape (N,); [m].
        steps: Set to the largest changes [rad] and the strays [m], (2, n_samples - 1).
    """
    for k in range(steps.shape[1]):
        largest = turning = bound = 0.0
        for i in range(lengths.size):
            yaw = abs(alpha[k + 1, i] - alpha[k, i])
            pitch = abs(theta[k + 1, i] - theta[k, i])
            largest = max(largest, yaw, pitch)
            turning += yaw + pitch
            bound += turning * turning * lengths[i]
        steps[0, k], steps[1, k] = largest, bound / 8.0
