"""Closed-form kinematics of the arm (Eq. 1-3, 11-15), row by row of a motion.

In its parent frame a link points along (cos a cos t, sin a cos t, -sin t). Link frames
are R_i = R_{i-1} Rz(alpha_i) Ry(theta_i) and O_{i+1} = O_i + L_i R_i e_x. As a tree of
joints the arm is the rail, then yaw and pitch of every link.
"""

from functools import lru_cache
from typing import Final, NoReturn

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import WrongLinkLength
from vdsm_pin.geometry.arrays import FloatArray, read_only
from vdsm_pin.geometry.joint_kernels import centres_of, turns_of
from vdsm_pin.proof.tree import Joint, Kind, Tree, X, Y, Z, shifted
from vdsm_pin.tolerances import TOLERANCES

CHUNK: Final = 1024
"""Rows worked on at a time, so that the temporaries stay in the processor's cache."""


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
    values = read_only(x0), read_only(alpha), read_only(theta)
    return centres_of(*values, manipulator.link_lengths)


def row_centres(manipulator: Manipulator, joints: FloatArray) -> FloatArray:
    """As `joint_centres`, of rows (x0, alpha1, theta1, ..), shape (n, 1 + 2N)."""
    x0, alpha, theta = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    return joint_centres(manipulator, x0, alpha, theta)


def link_frames(alpha: FloatArray, theta: FloatArray) -> FloatArray:
    """Orientations R_base_link of every link, R_i = R_{i-1} Rz(alpha_i) Ry(theta_i).

    Args:
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].

    Returns:
        Shape (n_samples, N, 3, 3); [-].
    """
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    zero = np.zeros_like(ca)
    rows = [[ca * ct, -sa, ca * st], [sa * ct, ca, sa * st], [-st, zero, ct]]
    steps = np.moveaxis(np.array(rows), (0, 1), (-2, -1))
    frames = np.array(steps)
    for link in range(1, frames.shape[1]):
        frames[:, link] = frames[:, link - 1] @ steps[:, link]
    return frames


def tip_jacobian(
    manipulator: Manipulator, alpha: FloatArray, theta: FloatArray
) -> FloatArray:
    """How the tip moves with x0, alpha1, theta1, ..

    Args:
        manipulator: The arm.
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].

    Returns:
        Shape (n_samples, 3, 1 + 2N); [-], [m/rad].
    """
    n, n_links = alpha.shape
    frames = link_frames(alpha, theta)
    centres = joint_centres(manipulator, np.zeros(n), alpha, theta)
    arms = centres[:, -1:] - centres[:, :-1]
    jacobian = np.zeros((n, 3, 1 + 2 * n_links))
    jacobian[:, 0, 0] = 1.0
    before = np.concatenate([np.tile(np.eye(3), (n, 1, 1, 1)), frames[:, :-1]], axis=1)
    for first, axes in ((1, before[..., 2]), (2, frames[..., 1])):
        jacobian[:, :, first::2] = np.swapaxes(np.cross(axes, arms), 1, 2)
    return jacobian


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
        WrongLinkLength: If two centres are not one link length apart.
    """
    points, lengths = read_only(centres), manipulator.link_lengths
    alpha, theta = np.zeros((2, len(points), lengths.size))
    for first in range(0, len(points), CHUNK):
        rows = slice(first, first + CHUNK)
        turns = np.zeros((4, *alpha[rows].shape))
        if not turns_of(points[rows], lengths, turns) <= TOLERANCES.joint_centre:
            _refuse_lengths(manipulator, points)
        ahead, aside, down, reach = turns
        np.arctan2(aside, ahead, out=alpha[rows])
        np.arctan2(down, reach, out=theta[rows])
    return alpha, theta


def _refuse_lengths(manipulator: Manipulator, centres: FloatArray) -> NoReturn:
    """Name the link whose ends are farthest from being its length apart.

    Raises:
        WrongLinkLength: Always.
    """
    spans = np.linalg.norm(np.diff(centres, axis=1), axis=2)
    residual = np.abs(spans - manipulator.link_lengths)
    waypoint, link = np.unravel_index(int(np.argmax(residual)), residual.shape)
    raise WrongLinkLength(
        waypoint=int(waypoint),
        link=int(link) + 1,
        gap=float(spans[waypoint, link]),
        length=float(manipulator.link_lengths[link]),
    )


def straight_joints(manipulator: Manipulator, tip: FloatArray) -> FloatArray:
    """Joint values of the straight arm whose tip is at a place, its base behind it.

    Args:
        manipulator: The arm.
        tip: Shape (3,), nearer to the rail than the arm is long; [m].

    Returns:
        q = (x0, alpha1, theta1, ..), shape (1 + 2N,); [m] in the first entry, [rad] in
        the others.
    """
    length, (x, y, z) = manipulator.total_length, tip.tolist()
    along = float(np.sqrt(length**2 - y**2 - z**2))
    joints = np.zeros(1 + 2 * manipulator.n_links)
    joints[:3] = x - along, np.arctan2(y, along), np.arcsin(-z / length)
    return joints


def link_angles(alpha: FloatArray, theta: FloatArray) -> FloatArray:
    """psi_i, the angle between adjacent links, same shape; [rad] (Eq. 2).

    Written with atan2, which keeps full precision at zero where arccos loses half.
    """
    ct = np.cos(theta)
    st, side = np.sin(theta), ct * np.sin(alpha)
    across = np.sqrt(st * st + side * side)
    return np.asarray(np.arctan2(across, ct * np.cos(alpha)))


def position_angles(alpha: FloatArray, theta: FloatArray) -> FloatArray:
    """gamma_i in (-pi, pi], same shape; [rad] (Eq. 3 with its quadrant kept)."""
    return np.asarray(np.arctan2(-np.sin(theta), np.cos(theta) * np.sin(alpha)))


RAIL: int = 0
"""The joint that carries the base: its placement is where the base stands."""


def arm_tree(arm: Manipulator) -> Tree:
    """The arm's joints; q = (x0, alpha1, theta1, ..), as `Trajectory.joints`."""
    return _tree_of(tuple(map(float, arm.link_lengths)))


@lru_cache(maxsize=64)
def _tree_of(lengths: tuple[float, ...]) -> Tree:
    """The tree of an arm whose links have these lengths; [m]."""
    joints = [Joint(0, Kind.PRISMATIC, X, column=0, name="x0")]
    before = 0.0
    for link, length in enumerate(lengths):
        at, placed = 2 * link + 1, shifted(before, 0.0, 0.0)
        joints += [
            Joint(at, Kind.REVOLUTE, Z, placed, column=at, name=f"alpha{link + 1}"),
            Joint(at + 1, Kind.REVOLUTE, Y, column=at + 1, name=f"theta{link + 1}"),
        ]
        before = length
    return Tree(tuple(joints))


def link_frame(link: int) -> int:
    """The frame of a link, 1 to N: its origin at O_i, x along the link."""
    return 2 * link + 1
