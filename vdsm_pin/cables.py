"""Cable lengths from joint angles and back (paper, section 5.2, Eq. 16-21).

The three cables that drive link j run through the joints 1..j, each time through the
holes at link j's own angles phi. At a joint a cable spans from the hole of one end
face, -d e_x + h, to that of the next, R (d e_x + h), with h = r (0, sin phi, cos phi)
and R = Rz(alpha) Ry(theta). Multiplied out, the squared span (Eq. 20) is a sum of seven
functions of the joint's angles times seven constants of the hole, so that one matrix
product per joint gives all spans.

Back: the cables of link 1 depend on joint 1 only, so its two angles follow from three
lengths; what the other cables spend in joint 1 is then known and taken off, and so on
along the arm. One joint is solved by Gauss-Newton in the tangents of the half angles,
in which every function is rational.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from vdsm_pin.errors import InconsistentCables, InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.tolerances import TOLERANCES

CHUNK: Final = 512
"""Rows worked on at a time, so that the temporaries stay in the processor's cache."""

NEWTON_STEPS: Final = 60
"""Budget of the solver of one joint; 4 steps are usual, 25 were seen to succeed."""


def cable_lengths(
    manipulator: Manipulator, alpha: FloatArray, theta: FloatArray
) -> FloatArray:
    """Total length of the three cables of every link (Eq. 21).

    Args:
        manipulator: The arm with its cable holes.
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].

    Returns:
        Lengths from the base's face to the link's holes a, b, c, shape
        (n_samples, N, 3); [m].
    """
    n_samples, n_links = alpha.shape
    holes = _hole_constants(manipulator)
    straight = _straight_parts(manipulator)[:, None]
    lengths = np.zeros((n_samples, 3 * n_links))
    for rows in _chunks(n_samples):
        # Joints first, so that the samples of one joint lie side by side.
        yaw, pitch = alpha[rows].T.copy(), theta[rows].T.copy()
        joints = _joint_functions(
            np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
        )
        total = np.repeat(straight, yaw.shape[1], axis=1)
        for i in range(n_links):
            total[3 * i :] += _spans(joints[:, i], holes[3 * i :])
        lengths[rows] = total.T
    return lengths.reshape(n_samples, n_links, 3)


def angles_from_cables(
    manipulator: Manipulator, lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Yaw and pitch of every joint from the cable lengths: Eq. 16-21 inverted.

    The answer is unique, and the one found, where at every joint tan(psi / 2) < d / r:
    up to there the end faces do not meet and a cable shortens when the link turns
    towards it. Beyond, angles that fit are found or the lengths are refused.

    Args:
        manipulator: The arm with its cable holes.
        lengths: Total lengths, shape (n_samples, N, 3); [m].

    Returns:
        alpha and theta, each of shape (n_samples, N); [rad].

    Raises:
        InvalidInput: If the shape is not (n_samples, N, 3).
        InconsistentCables: If no angles are found that give these lengths.
    """
    # Compiled code takes half a second to import, and the planners never come here.
    from vdsm_pin.geometry.cable_kernels import peel

    n_samples, n_links = len(lengths), manipulator.n_links
    if lengths.shape != (n_samples, n_links, 3):
        shape = lengths.shape
        message = f"cable lengths have shape {shape}, expected (n, {n_links}, 3)"
        raise InvalidInput(message)
    holes = _hole_constants(manipulator).reshape(n_links, 3, -1)
    guesses = _first_guesses(manipulator)
    straight = _straight_parts(manipulator)[:, None]
    alpha, theta = np.zeros((n_samples, n_links)), np.zeros((n_samples, n_links))
    for rows in _chunks(n_samples):
        inside = lengths[rows].reshape(-1, 3 * n_links).T - straight
        left = np.ascontiguousarray(inside).reshape(n_links, 3, -1)
        u, v = np.zeros((2, n_links, left.shape[2]))
        peel(
            holes,
            guesses,
            left,
            u,
            v,
            NEWTON_STEPS,
            TOLERANCES.cable_step,
            TOLERANCES.cable_length,
        )
        _check_consistent(left, rows.start)
        alpha[rows], theta[rows] = 2.0 * np.arctan(u.T), 2.0 * np.arctan(v.T)
    return alpha, theta


def _chunks(n_samples: int) -> Iterator[slice]:
    return (slice(k, min(k + CHUNK, n_samples)) for k in range(0, n_samples, CHUNK))


def _straight_parts(manipulator: Manipulator) -> FloatArray:
    """What a cable runs inside the links, sum of L_i - 2d, shape (3N,); [m]."""
    joints = np.arange(1, manipulator.n_links + 1)
    inside = manipulator.stations[1:] - 2.0 * manipulator.cables.half_gap * joints
    return np.repeat(inside, 3)


def _hole_constants(manipulator: Manipulator) -> FloatArray:
    """The factors of `_joint_functions` in the squared span, shape (3N, 7); [m^2]."""
    cables = manipulator.cables
    d, r = cables.half_gap, cables.hole_radius
    phi = cables.hole_angles.ravel()
    y, z = r * np.sin(phi), r * np.cos(phi)
    columns = [
        np.full_like(phi, 2.0 * (d * d + r * r)),
        np.full_like(phi, 2.0 * d * d),
        -2.0 * d * y,
        2.0 * d * z,
        -2.0 * y * y,
        -2.0 * z * z,
        -2.0 * y * z,
    ]
    return np.stack(columns, axis=1)


def _joint_functions(
    ca: FloatArray, sa: FloatArray, ct: FloatArray, st: FloatArray
) -> FloatArray:
    """The seven functions of Eq. 20, multiplied out, shape (7, ..); [-]."""
    one = np.ones_like(ca)
    return np.stack([one, ca * ct, sa * (one + ct), st * (one + ca), ca, ct, sa * st])


def _spans(joint: FloatArray, holes: FloatArray) -> FloatArray:
    """Cable length inside one joint per hole and sample (Eq. 20); [m]."""
    squared = holes @ joint
    # Rounding may take a square below zero where the two holes coincide.
    np.maximum(squared, 0.0, out=squared)
    return np.sqrt(squared, out=squared)


def _first_guesses(manipulator: Manipulator) -> FloatArray:
    """Linear maps from three spans to about tan(alpha / 2) and tan(theta / 2).

    A plain tilt by psi towards gamma spans 2 d cos(psi / 2) - 2 r sin(psi / 2)
    cos(phi - gamma): a constant and one harmonic in phi, which three holes determine.

    Returns:
        Shape (N, 2, 3); [1/m].
    """
    phi = manipulator.cables.hole_angles
    lever = 2.0 * manipulator.cables.hole_radius
    columns = [np.ones_like(phi), -lever * np.sin(phi), lever * np.cos(phi)]
    return np.ascontiguousarray(np.linalg.pinv(np.stack(columns, axis=-1))[:, 1:])


def _check_consistent(left: FloatArray, first_sample: int) -> None:
    """Refuse what three cables of a link contradict each other by, (N, 3, n); [m]."""
    residual = np.abs(left).max(axis=1)
    wrong = ~(residual <= TOLERANCES.cable_length)
    if wrong.any():
        # The first link at fault: those beyond it inherit its error.
        link = int(np.argmax(wrong.any(axis=1)))
        sample = int(np.argmax(wrong[link]))
        raise InconsistentCables(
            sample=first_sample + sample,
            link=link + 1,
            residual=float(residual[link, sample]),
            tolerance=TOLERANCES.cable_length,
        )
