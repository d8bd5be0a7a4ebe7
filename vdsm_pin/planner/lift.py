"""Step 6: 2D to 3D (paper, 4.4, Eq. 7)."""

import numpy as np

from vdsm_pin.errors import LinkTooShort
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator


def rises_squared(manipulator: Manipulator, planar: FloatArray) -> FloatArray:
    """(x_{i+1} - x_i)^2, what Eq. 7 takes the root of, negative where a link is short.

    Args:
        manipulator: The arm.
        planar: Projected joint centres, shape (n_samples, N + 1, 2); [m].

    Returns:
        Shape (n_samples, N); [m^2].
    """
    y, z = planar[..., 0], planar[..., 1]
    gap_y, gap_z = y[:, 1:] - y[:, :-1], z[:, 1:] - z[:, :-1]
    return np.asarray(manipulator.link_lengths**2 - gap_y * gap_y - gap_z * gap_z)


def lift(manipulator: Manipulator, planar: FloatArray, tip_x: FloatArray) -> FloatArray:
    """Joint centres from their projections and the tip's x (Eq. 7).

    Going back from the tip, x_i = x_{i+1} - sqrt(L_i^2 - |P_{i+1} - P_i|^2): links keep
    their length exactly and the base lands on its rail.

    Args:
        manipulator: The arm.
        planar: Projected joint centres P_1..P_{N+1}, shape (n_samples, N + 1, 2); [m].
        tip_x: x of the tip, shape (n_samples,); [m].

    Returns:
        Centres O_1..O_{N+1}, shape (n_samples, N + 1, 3); [m].

    Raises:
        LinkTooShort: If two projections are farther apart than their link.
    """
    squares = rises_squared(manipulator, planar)
    if not (squares >= 0.0).all():
        waypoint, link = np.unravel_index(int(np.argmin(squares)), squares.shape)
        gap = np.linalg.norm(planar[waypoint, link + 1] - planar[waypoint, link])
        length = float(manipulator.link_lengths[link])
        raise LinkTooShort(
            waypoint=int(waypoint), link=int(link) + 1, gap=float(gap), length=length
        )
    rises = np.sqrt(squares)
    centres = np.zeros((*planar.shape[:2], 3))
    centres[..., 1:] = planar
    centres[:, -1, 0] = tip_x
    centres[:, :-1, 0] = tip_x[:, None] - np.cumsum(rises[:, ::-1], axis=1)[:, ::-1]
    return centres
