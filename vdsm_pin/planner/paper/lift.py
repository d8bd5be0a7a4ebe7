"""Step 6: 2D to 3D (paper, 4.4, Eq. 7)."""

from math import sqrt
from typing import NoReturn

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.compiled import compiled
from vdsm_pin.errors import LinkTooShort
from vdsm_pin.geometry.arrays import FloatArray, read_only


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
    n_samples = len(planar)
    centres = np.zeros((n_samples, manipulator.n_links + 1, 3))
    points, x = read_only(planar), read_only(tip_x)
    if not _lift_rows(points, x, manipulator.link_lengths, centres):
        _refuse_gap(manipulator, planar)
    return centres


@compiled
def _lift_rows(
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


def largest_angles(planar: FloatArray, lengths: FloatArray) -> FloatArray:
    """Largest link angle of arms seen along X; infinite where a link is too short.

    Args:
        planar: Projected ends of the links, shape (n, k + 1, 2); [m].
        lengths: Of the links, shape (k,); [m].

    Returns:
        Shape (n,); [rad].
    """
    across = np.diff(planar, axis=1) / lengths[:, None]
    square = 1.0 - (across**2).sum(axis=2)
    along = np.sqrt(np.maximum(square, 0.0))
    cosines = along[:, 1:] * along[:, :-1]
    cosines += (across[:, 1:] * across[:, :-1]).sum(axis=2)
    least = np.minimum(cosines.min(axis=1, initial=1.0), along[:, 0])
    angles = np.arccos(np.clip(least, -1.0, 1.0))
    return np.where((square > 0.0).all(axis=1), angles, np.inf)


def _refuse_gap(manipulator: Manipulator, planar: FloatArray) -> NoReturn:
    """Name the link that falls shortest of the gap it spans.

    Raises:
        LinkTooShort: Always.
    """
    gaps = np.linalg.norm(np.diff(planar, axis=1), axis=2)
    squares = manipulator.link_lengths**2 - gaps**2
    waypoint, link = np.unravel_index(int(np.argmin(squares)), squares.shape)
    raise LinkTooShort(
        waypoint=int(waypoint),
        link=int(link) + 1,
        gap=float(gaps[waypoint, link]),
        length=float(manipulator.link_lengths[link]),
    )
