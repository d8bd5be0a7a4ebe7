"""Cable lengths from joint angles and back (paper, section 5.2, Eq. 16-21).

The three cables that drive link j run through the joints 1..j, each time through the
holes at link j's own angles phi. At a joint a cable spans from the hole of one end
face, -d e_x + h, to that of the next, R (d e_x + h), with h = r (0, sin phi, cos phi)
and R = Rz(alpha) Ry(theta). `geometry/cable_kernels.py` has Eq. 20 multiplied out.

Back: the cables of link 1 depend on joint 1 only, so its two angles follow from three
lengths; what the other cables spend in joint 1 is then known and taken off, and so on
along the arm. One joint is solved by Gauss-Newton in the tangents of the half angles,
in which every function is rational.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InconsistentCables, InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, frozen, read_only
from vdsm_pin.geometry.cable_kernels import Holes, add_spans, solve_joint, take_off
from vdsm_pin.tolerances import TOLERANCES

CHUNK: Final = 1024
"""Rows worked on at a time, so that the temporaries stay in the processor's cache."""

NEWTON_STEPS: Final = 60
"""Budget of the solver of one joint; 4 steps are usual, 25 were seen to succeed."""

STARTS: Final = frozen(np.linspace(-0.8, 0.8, 9))
"""Tangents of half the angles, up to 77 deg, from which the solver starts again."""


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
    lengths = np.repeat(_straight_parts(manipulator)[None], n_samples, axis=0)
    add_spans(read_only(alpha), read_only(theta), _holes(manipulator), lengths)
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
    n_samples, n_links = len(lengths), manipulator.n_links
    if lengths.shape != (n_samples, n_links, 3):
        shape = lengths.shape
        message = f"cable lengths have shape {shape}, expected (n, {n_links}, 3)"
        raise InvalidInput(message)
    holes, guesses = _holes(manipulator), _first_guesses(manipulator)
    straight = _straight_parts(manipulator)[:, None]
    alpha, theta = np.zeros((n_samples, n_links)), np.zeros((n_samples, n_links))
    for rows in _chunks(n_samples):
        left = np.ascontiguousarray(lengths[rows].reshape(-1, 3 * n_links).T) - straight
        u, v = _peel(holes, guesses, left, rows.start)
        alpha[rows], theta[rows] = 2.0 * np.arctan(u.T), 2.0 * np.arctan(v.T)
    return alpha, theta


def _peel(
    holes: Holes, guesses: FloatArray, left: FloatArray, first_waypoint: int
) -> FloatArray:
    """Solve joint by joint; a solved joint's spans come off all cables through it.

    Args:
        holes: All of them.
        guesses: First guesses as linear maps of spans, shape (N, 2, 3); [1/m].
        left: Cable lengths inside the joints, shape (3N, n), used up; [m].
        first_waypoint: Number of the first column, for messages.

    Returns:
        tan(alpha / 2) and tan(theta / 2), shape (2, N, n); [-].

    Raises:
        InconsistentCables: If a link's cables contradict each other.
    """
    half = np.zeros((2, len(guesses), left.shape[1]))
    for i, guess in enumerate(guesses):
        own, beyond = slice(3 * i, 3 * i + 3), slice(3 * i + 3, None)
        here, spans = _some(holes, own), left[own]
        half[:, i] = guess @ spans
        u, v = half[:, i]
        solve_joint(here, spans, u, v, NEWTON_STEPS, TOLERANCES.cable_step)
        residual = _residual(here, spans, u, v)
        for k in np.flatnonzero(~(residual <= TOLERANCES.cable_length)):
            u[k], v[k] = _search(here, spans[:, k])
            if np.isnan(u[k]):
                raise InconsistentCables(
                    waypoint=first_waypoint + int(k),
                    link=i + 1,
                    residual=float(residual[k]),
                    tolerance=TOLERANCES.cable_length,
                )
        take_off(_some(holes, beyond), u, v, left[beyond])
    return half


def _some(holes: Holes, which: slice) -> Holes:
    return holes._replace(y=holes.y[which], z=holes.z[which])


def _residual(
    holes: Holes, spans: FloatArray, u: FloatArray, v: FloatArray
) -> FloatArray:
    """Largest error of a joint's three spans, shape (n,); NaN if there is one; [m]."""
    left = spans.copy()
    take_off(holes, u, v, left)
    return np.asarray(np.abs(left).max(axis=0))


def _search(holes: Holes, spans: FloatArray) -> FloatArray:
    """Newton's method from a grid of starts, for the rare joint that needs it.

    Near the end of the domain, and with holes close to each other, the residual has
    hollows in which the first guess may end.

    Args:
        holes: The joint's three.
        spans: Cable lengths inside the joint, shape (3,); [m].

    Returns:
        tan(alpha / 2) and tan(theta / 2), shape (2,): the fitting ones nearest to
        straight, NaN if none fit; [-].
    """
    u, v = np.stack(np.meshgrid(STARTS, STARTS)).reshape(2, -1)
    many = np.repeat(spans[:, None], u.size, axis=1)
    solve_joint(holes, many, u, v, NEWTON_STEPS, 0.0)
    size = u * u + v * v
    size[~(_residual(holes, many, u, v) <= TOLERANCES.cable_length)] = np.inf
    best = int(np.argmin(size))
    return np.array([u[best], v[best]]) if size[best] < np.inf else np.full(2, np.nan)


def _chunks(n_samples: int) -> Iterator[slice]:
    return (slice(k, min(k + CHUNK, n_samples)) for k in range(0, n_samples, CHUNK))


def _straight_parts(manipulator: Manipulator) -> FloatArray:
    """What a cable runs inside the links, sum of L_i - 2d, shape (3N,); [m]."""
    joints = np.arange(1, manipulator.n_links + 1)
    inside = manipulator.stations[1:] - 2.0 * manipulator.cables.half_gap * joints
    inside[-1] -= manipulator.tool_length
    return np.repeat(inside, 3)


def _holes(manipulator: Manipulator) -> Holes:
    """Where cables run through the joints."""
    cables = manipulator.cables
    phi, r = cables.hole_angles.ravel(), cables.hole_radius
    y, z = r * np.sin(phi), r * np.cos(phi)
    return Holes(cables.half_gap, r, read_only(y), read_only(z))


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
