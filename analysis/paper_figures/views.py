"""Orthographic views of the base frame and lines thinned for print."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.units import MM_PER_M

FINE: Final = 0.4
"""A drawn line may stray this far from the computed one, a tenth of its width; [mm]."""


@dataclass(frozen=True)
class View:
    """An orthographic view.

    Args:
        right: Base-frame direction drawn to the right, shape (3,); [-].
        up: Base-frame direction drawn upwards, shape (3,); [-].
        labels: What the two axes of the drawing show; empty for an oblique view.
    """

    right: FloatArray
    up: FloatArray
    labels: tuple[str, ...] = ()

    @property
    def towards(self) -> FloatArray:
        """Direction to the viewer, shape (3,); [-]."""
        return np.cross(self.right, self.up)

    def __call__(self, points: FloatArray) -> FloatArray:
        """Base frame to drawing, shape (.., 3) to (.., 2); [m] to [mm]."""
        return points @ np.stack([self.right, self.up], axis=1) * MM_PER_M

    def depth(self, points: FloatArray) -> FloatArray:
        """Larger is nearer to the viewer, shape (.., 3) to (..,); [m]."""
        return points @ self.towards


X, Y, Z = np.eye(3)

FRONT: Final = View(X, Z, ("x [mm]", "z [mm]"))
SIDE: Final = View(Y, Z, ("y [mm]", "z [mm]"))
TOP: Final = View(X, Y, ("x [mm]", "y [mm]"))


def oblique(turn_deg: float, rise_deg: float) -> View:
    """A view from the side of the arm, turned towards the tip and raised.

    Args:
        turn_deg: 0 looks along y, 90 looks from the tip back at the base; [deg].
        rise_deg: 0 is level, 90 looks down; [deg].
    """
    turn, rise = np.deg2rad(turn_deg), np.deg2rad(rise_deg)
    right = np.cos(turn) * X + np.sin(turn) * Y
    towards = np.cos(rise) * (np.sin(turn) * X - np.cos(turn) * Y) + np.sin(rise) * Z
    return View(right, np.cross(towards, right))


OBLIQUE: Final = oblique(38.0, 22.0)


def thin(line: FloatArray) -> FloatArray:
    """A drawn polyline with only the corners it needs, shape (n, 2) to (m, 2); [mm]."""
    if len(line) < 3:
        return line
    return shapely.get_coordinates(shapely.simplify(shapely.linestrings(line), FINE))
