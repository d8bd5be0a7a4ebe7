"""What each link keeps so that the whole arm survives one error of all joints.

An error of every joint moves a point of the arm farther the farther out it is.
Clearance that grows alike along the arm is worth as much everywhere.
"""

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray


def levers(arm: Manipulator) -> FloatArray:
    """How far the end of each link of the straight arm moves as all joints turn alike.

    It is the sum of its distances to the joints before it; the second axis of a joint
    adds a factor that is much the same for all links.

    Returns:
        Shape (N,), ascending; [m/rad].
    """
    joints = np.arange(1, arm.n_links + 1)
    return np.asarray(np.cumsum(arm.link_lengths * joints))


def link_margins(arm: Manipulator, error: float) -> FloatArray | None:
    """What each link keeps for an error of all joints, None for no error.

    Args:
        arm: The arm.
        error: Of every joint; [rad].

    Returns:
        Shape (N,), ascending; [m].
    """
    return error * levers(arm) if error > 0.0 else None


def link_by_link(corners: FloatArray, stations: FloatArray) -> FloatArray:
    """Joint centres of arms that are told by their corners.

    Args:
        corners: Base, knees and tip, in line between them, shape (v, p + 1, 3); [m].
        stations: Arc length of the joints, shape (N + 1,); [m].

    Returns:
        Shape (v, N + 1, 3); [m].
    """
    sizes = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    ends = np.cumsum(sizes, axis=1)
    piece = (stations[None, :, None] > ends[:, None, :-1]).sum(axis=2)
    size = np.take_along_axis(sizes, piece, axis=1)
    left = np.take_along_axis(ends, piece, axis=1) - stations
    # A piece may have no length: two knees that are one.
    share = (left / np.where(size > 0.0, size, 1.0))[..., None]
    begin = np.take_along_axis(corners, piece[..., None], axis=1)
    end = np.take_along_axis(corners, piece[..., None] + 1, axis=1)
    return np.asarray(share * begin + (1.0 - share) * end)
