"""Closed-form kinematics of the arm (Eq. 1-3, 11-15), vectorised over samples.

In its parent frame a link points along (cos a cos t, sin a cos t, -sin t). Link frames
are R_i = R_{i-1} Rz(alpha_i) Ry(theta_i) and O_{i+1} = O_i + L_i R_i e_x.
"""

import numpy as np

from vdsm_pin.errors import LinkTooShort
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.tolerances import TOLERANCES


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
    axes = link_rotations(alpha, theta)[..., 0]
    links = axes * manipulator.link_lengths[:, None]
    centres = np.zeros((x0.size, manipulator.n_links + 1, 3))
    centres[:, 0, 0] = x0
    centres[:, 1:] = centres[:, :1] + np.cumsum(links, axis=1)
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
    links = np.diff(centres, axis=1)
    lengths = manipulator.link_lengths
    spans = np.linalg.norm(links, axis=2)
    residual = np.abs(spans - lengths)
    if not (residual <= TOLERANCES.joint_centre).all():
        sample, link = np.unravel_index(int(np.argmax(residual)), residual.shape)
        raise LinkTooShort(
            sample=int(sample),
            link=int(link) + 1,
            gap=float(spans[sample, link]),
            length=float(lengths[link]),
        )
    axes = links / spans[..., None]
    alpha, theta = np.zeros(axes.shape[:2]), np.zeros(axes.shape[:2])
    frame = np.broadcast_to(np.eye(3), (axes.shape[0], 3, 3))
    for i in range(manipulator.n_links):
        x, y, z = np.einsum("nji,nj->in", frame, axes[:, i])
        alpha[:, i] = np.arctan2(y, x)
        theta[:, i] = np.arctan2(-z, np.hypot(x, y))
        frame = frame @ link_rotations(alpha[:, i : i + 1], theta[:, i : i + 1])[:, 0]
    return alpha, theta


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
