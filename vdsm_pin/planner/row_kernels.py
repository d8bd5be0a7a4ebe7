"""Compiled Step 6, and what lies between two rows of a motion."""

from math import sqrt

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray


@compiled
def lift_rows(
    planar: FloatArray, tip_x: FloatArray, lengths: FloatArray, centres: FloatArray
) -> bool:
    """Joint centres from their projections (Eq. 7).

    Args:
        planar: P_1..P_{N+1}, shape (n_samples, N + 1, 2); [m].
        tip_x: x of the tip, shape (n_samples,); [m].
        lengths: Of the links, shape (N,); [m].
        centres: Set to O_1..O_{N+1}, shape (n_samples, N + 1, 3); [m].

    Returns:
        Whether all links are long enough.
    """
    n_links = lengths.size
    enough = True
    for k in range(planar.shape[0]):
        extent = 0.0
        for i in range(n_links, -1, -1):
            y, z = planar[k, i, 0], planar[k, i, 1]
            if i < n_links:
                gap_y, gap_z = planar[k, i + 1, 0] - y, planar[k, i + 1, 1] - z
                square = lengths[i] * lengths[i] - gap_y * gap_y - gap_z * gap_z
                if not square >= 0.0:
                    enough = False
                extent += sqrt(square)
            centres[k, i, 0], centres[k, i, 1], centres[k, i, 2] = (
                tip_x[k] - extent,
                y,
                z,
            )
    return enough


@compiled
def steps_between(
    alpha: FloatArray, theta: FloatArray, lengths: FloatArray, steps: FloatArray
) -> None:
    """What `vdsm_pin.planner.spacing.row_steps` returns.

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
