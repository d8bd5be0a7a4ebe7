"""Closed-form kinematics of the arm (Eq. 1-3, 11-15), vectorised over samples.

In its parent frame a link points along (cos a cos t, sin a cos t, -sin t). Link frames
are R_i = R_{i-1} Rz(alpha_i) Ry(theta_i) and O_{i+1} = O_i + L_i R_i e_x.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from vdsm_pin.errors import LinkTooShort
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.tolerances import TOLERANCES

CHUNK: Final = 1024
"""Rows worked on at a time, so that the temporaries stay in the processor's cache."""


def link_rotations(alpha: FloatArray, theta: FloatArray) -> FloatArray:
    """Orientation of every link frame in the base frame (Eq. 1).

    Args:
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].

    Returns:
        Rs_base_link, shape (n_samples, N, 3, 3); [-].
    """
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    zero = np.zeros_like(ca)
    rows = [[ca * ct, -sa, ca * st], [sa * ct, ca, sa * st], [-st, zero, ct]]
    steps = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    rotations = np.zeros_like(steps)
    rotations[:, 0] = steps[:, 0]
    for i in range(1, alpha.shape[1]):
        rotations[:, i] = rotations[:, i - 1] @ steps[:, i]
    return rotations


def joint_centres(
    manipulator: Manipulator, x0: FloatArray, alpha: FloatArray, theta: FloatArray
) -> FloatArray:
    """Joint centres O_1..O_{N+1} in the base frame; the last one is the tip.

    Args:
        manipulator: The arm.
        x0: Base positions on the rail, shape (n_samples,); [m].
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].

    Returns:
        Centres, shape (n_samples, N + 1, 3); [m].
    """
    centres = np.zeros((x0.size, manipulator.n_links + 1, 3))
    for rows in _chunks(x0.size):
        # Joints first, so that the samples of one joint lie side by side.
        yaw, pitch = alpha[rows].T.copy(), theta[rows].T.copy()
        cos_sin = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
        x, y, z = _base_axes(yaw.shape[1])
        points = np.zeros((manipulator.n_links + 1, 3, yaw.shape[1]))
        points[0, 0] = x0[rows]
        for i, (ca, sa, ct, st) in enumerate(zip(*cos_sin, strict=True)):
            x, y = x * ca + y * sa, y * ca - x * sa
            x, z = x * ct - z * st, x * st + z * ct
            points[i + 1] = points[i] + manipulator.link_lengths[i] * x
        centres[rows] = points.transpose(2, 0, 1)
    return centres


def joint_angles(
    manipulator: Manipulator, centres: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Yaw and pitch of every joint from the joint centres (Eq. 11-15).

    Args:
        manipulator: The arm.
        centres: Joint centres, shape (n_samples, N + 1, 3); [m].

    Returns:
        alpha and theta, each of shape (n_samples, N), by atan2, so that alpha
        covers (-pi, pi]; [rad].

    Raises:
        LinkTooShort: If two centres are not one link length apart.
    """
    n_samples, n_links = len(centres), manipulator.n_links
    alpha, theta = np.zeros((n_samples, n_links)), np.zeros((n_samples, n_links))
    for rows in _chunks(n_samples):
        directions = _link_directions(manipulator, centres[rows], rows.start)
        yaw, pitch = np.zeros((2, n_links, directions.shape[2]))
        x, y, z = _base_axes(directions.shape[2])
        for i, link in enumerate(directions):
            ahead, aside, down = _dot(x, link), _dot(y, link), -_dot(z, link)
            reach = np.sqrt(ahead * ahead + aside * aside)
            yaw[i], pitch[i] = np.arctan2(aside, ahead), np.arctan2(down, reach)
            # The new y axis is the old one turned by alpha about z; z follows.
            upright = reach == 0.0  # a link along z: any alpha fits, atan2 says 0
            y = (y * (ahead + upright) - x * aside) / (reach + upright)
            x, z = link, _cross(link, y)
        alpha[rows], theta[rows] = yaw.T, pitch.T
    return alpha, theta


def _link_directions(
    manipulator: Manipulator, centres: FloatArray, first_waypoint: int
) -> FloatArray:
    """Unit vectors along the links, shape (N, 3, n_samples); [-].

    Raises:
        LinkTooShort: If two centres are not one link length apart.
    """
    points = centres.transpose(1, 2, 0).copy()
    links = points[1:] - points[:-1]
    spans = np.sqrt(np.einsum("icn,icn->in", links, links))
    residual = np.abs(spans - manipulator.link_lengths[:, None])
    if not (residual <= TOLERANCES.joint_centre).all():
        link, waypoint = np.unravel_index(int(np.argmax(residual)), residual.shape)
        raise LinkTooShort(
            waypoint=first_waypoint + int(waypoint),
            link=int(link) + 1,
            gap=float(spans[link, waypoint]),
            length=float(manipulator.link_lengths[link]),
        )
    return np.asarray(links / spans[:, None])


def _chunks(n_samples: int) -> Iterator[slice]:
    return (slice(k, min(k + CHUNK, n_samples)) for k in range(0, n_samples, CHUNK))


def _base_axes(n_samples: int) -> FloatArray:
    """Axes of the base frame for every sample, shape (3, 3, n_samples); [-]."""
    return np.repeat(np.eye(3)[:, :, None], n_samples, axis=2)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products along the first axis."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Vector products along the first axis."""
    return np.stack(
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    )


def link_angles(alpha: FloatArray, theta: FloatArray) -> FloatArray:
    """psi_i, the angle between adjacent links, same shape; [rad] (Eq. 2).

    Written with atan2, which keeps full precision at zero where arccos loses half.
    """
    ct = np.cos(theta)
    across = np.hypot(np.sin(theta), ct * np.sin(alpha))
    return np.asarray(np.arctan2(across, ct * np.cos(alpha)))


def position_angles(alpha: FloatArray, theta: FloatArray) -> FloatArray:
    """gamma_i in (-pi, pi], same shape; [rad] (Eq. 3 with its quadrant kept)."""
    return np.asarray(np.arctan2(-np.sin(theta), np.cos(theta) * np.sin(alpha)))
