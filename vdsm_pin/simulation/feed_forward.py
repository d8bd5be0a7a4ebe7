"""Tensions that hold the arm: bounded least squares, and how stiff the cables make it.

With J = dL/dq of the cable lengths the tensions T act on the joints by -J^T T. Held
against gravity g(q) they solve J^T T = -g with T_min <= T <= T_max, as near to the
pretension as that leaves free (Stark and Parker's bounded least squares).
"""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import link_frames
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.simulation.plant import stiffnesses
from vdsm_pin.simulation.settings import Settings

STEP = 1e-5
"""Of the central differences; [rad]."""

HALVINGS = 30
"""Rounds of bisection: 4 kN / 2^30 is far below a newton."""

EVENNESS = 1e-4
"""Weight of the pretension against the torque that is left over; [m]."""


@dataclass(frozen=True)
class Statics:
    """The arm at rest, held by its cables.

    Args:
        manipulator: The arm.
        settings: Masses, gravity, cables.
    """

    manipulator: Manipulator
    settings: Settings

    def lengths(self, angles: FloatArray) -> FloatArray:
        """Cable lengths at alpha1, theta1, .., shape (n, 2N) to (n, 3N); [m]."""
        found = cable_lengths(self.manipulator, angles[:, ::2], angles[:, 1::2])
        return found.reshape(len(angles), -1)

    def slopes(self, angles: FloatArray) -> FloatArray:
        """J = dL/dq at one configuration (2N,), shape (3N, 2N); [m/rad]."""
        steps = STEP * np.eye(angles.size)
        ahead, behind = self.lengths(angles + steps), self.lengths(angles - steps)
        return (ahead - behind).T / (2.0 * STEP)

    def gravity(self, angles: FloatArray) -> FloatArray:
        """dV/dq of the weight at configurations (n, 2N), shape (n, 2N); [N m].

        A joint turns all links from its own on about its axis.
        """
        frames = link_frames(angles[:, ::2], angles[:, 1::2])
        before = np.concatenate([np.tile(np.eye(3), (len(angles), 1, 1, 1)), frames], 1)
        bodies, lengths = self.settings.bodies, self.manipulator.link_lengths
        weights = bodies.gravity_m_s2 * bodies.mass_per_length_kg_m * lengths
        moments = lengths * (np.cumsum(weights[::-1])[::-1] - 0.5 * weights)
        beyond = np.cumsum((moments[:, None] * frames[..., 0])[:, ::-1], axis=1)[
            :, ::-1
        ]
        found = np.zeros(angles.shape)
        for first, axes in ((0, before[:, :-1, :, 2]), (1, frames[..., 1])):
            found[:, first::2] = np.cross(axes, beyond)[..., 2]
        return found

    def tensions(self, angles: FloatArray) -> FloatArray:
        """Tensions that hold one configuration (2N,), shape (3N,); [N]."""
        from scipy.optimize import lsq_linear

        cables = self.settings.cables
        slopes, torque = self.slopes(angles), self.gravity(angles[None])[0]
        even = np.full(len(slopes), cables.pretension_n)
        rows = np.vstack([slopes.T, EVENNESS * np.eye(len(slopes))])
        aims = np.concatenate([-torque, EVENNESS * even])
        bounds = (cables.least_tension_n, cables.largest_tension_n)
        return np.asarray(lsq_linear(rows, aims, bounds, tol=1e-10).x)

    def least_stiffness(self, angles: FloatArray, tensions: FloatArray) -> float:
        """Least eigenvalue of the joint stiffness, motors held; [N m/rad].

        Below 0 the arm buckles: pretension pushes a straight chain of joints out.
        """
        return _least_eigenvalue(self.stiffness(angles, tensions))

    def tension_margin(self, angles: FloatArray, tensions: FloatArray) -> float:
        """Tension that may be added to every cable; [N].

        Before the arm buckles or a cable has its largest tension; 0 where it buckles
        already. The stiffness is linear in the tensions.
        """
        room = self.settings.cables.largest_tension_n - float(tensions.max())
        if room <= 0.0:
            return 0.0
        now = self.stiffness(angles, tensions)
        more = (self.stiffness(angles, tensions + room) - now) / room
        low, high = 0.0, room
        if _least_eigenvalue(now + room * more) > 0.0:
            return room
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            stands = _least_eigenvalue(now + middle * more) > 0.0
            low, high = (middle, high) if stands else (low, middle)
        return low

    def stiffness(self, angles: FloatArray, tensions: FloatArray) -> FloatArray:
        """Joint stiffness, motors held, shape (2N, 2N); [N m/rad]."""
        k = stiffnesses(self.manipulator, self.settings)
        rest = self.lengths(angles[None])[0] - tensions / k

        def torque(at: FloatArray) -> FloatArray:
            pull = np.maximum(k * (self.lengths(at[None])[0] - rest), 0.0)
            return np.asarray(self.slopes(at).T @ pull + self.gravity(at[None])[0])

        steps = 1e-4 * np.eye(angles.size)
        columns = [(torque(angles + h) - torque(angles - h)) / 2e-4 for h in steps]
        matrix = np.stack(columns, axis=1)
        return np.asarray(0.5 * (matrix + matrix.T))


def _least_eigenvalue(matrix: FloatArray) -> float:
    return float(np.linalg.eigvalsh(matrix)[0])
