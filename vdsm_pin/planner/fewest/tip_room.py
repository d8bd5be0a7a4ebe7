"""What the tip of an arm has to spare."""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.broad_phase import BroadPhase
from vdsm_pin.problem.held import TIP

LEAST: Final = 0.05
"""Cells smaller than this part of the body's radius are not halved; [-]."""
NARROW: Final = 0.3
"""Room below this part of the body's radius makes a way costly; [-]."""


class TipRoom(NamedTuple):
    """What a tip has to spare, at points and on lines.

    Args:
        arm: The arm.
        clearance: The clearance function, exact also where it is too small.
        required: Clearance that the tip must keep; [m].
    """

    arm: Manipulator
    clearance: BroadPhase
    required: float

    @property
    def near(self) -> "TipRoom":
        """The same, exact only where the room is not above what is narrow."""
        radius = self.arm.most_radius
        # Surfaces are never farther below than all of the body.
        clearance = replace(self.clearance, floor=-2.0 * radius)
        return self._replace(clearance=clearance.up_to(self.required + NARROW * radius))

    def spare(self, points: FloatArray, ends: FloatArray | None = None) -> FloatArray:
        """At points, or on lines from them to ends, (n, 3) each to (n,); [m]."""
        ends = points if ends is None else ends
        clearances = self.clearance(np.stack([points, ends], axis=1), TIP)[:, 0]
        return np.asarray(clearances - self.required)

    def narrowest(self, route: FloatArray) -> FloatArray:
        """The inner place of a route with the least clearance, shape (3,); [m]."""
        inner = route[1:-1] if len(route) > 2 else route
        return np.asarray(inner[int(np.argmin(self.spare(inner)))])
