"""Where the last link shall look while the tip draws."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, frozen

WIDEST: Final = np.pi / 2.0
"""Cones are narrower than this; [rad]."""


@dataclass(frozen=True)
class Pointing:
    """A cone in which the axis of the last link lies wherever the tip draws.

    The cone's axis runs from the tip to a target, or has a given direction, or one that
    changes along each side of the path from the direction of one corner to that of the
    next one, along the chord between their unit vectors.

    Args:
        cone: Largest angle between the link's axis and the cone's; [rad].
        target: Shape (3,); None where directions are given; [m].
        directions: Of the cone's axis, unit vectors, one for the whole path or one for
            each corner of it, shape (1 or m, 3); None where a target is given; [-].

    Raises:
        InvalidInput: If a value breaks its range, or not one of the two is given.
    """

    cone: float
    target: FloatArray | None = None
    directions: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays and check the values."""
        if not 0.0 < self.cone < WIDEST:
            message = f"pointing cone is {self.cone} rad, expected above 0, below pi/2"
            raise InvalidInput(message)
        if (self.target is None) == (self.directions is None):
            message = "pointing needs a target or directions, one of the two"
            raise InvalidInput(message)
        if self.target is not None:
            object.__setattr__(self, "target", frozen(self.target))
            if self.target.shape != (3,) or not np.isfinite(self.target).all():
                message = "pointing target is not three finite numbers"
                raise InvalidInput(message)
        if self.directions is not None:
            sizes = np.linalg.norm(self.directions, axis=-1, keepdims=True)
            if not (np.isfinite(sizes).all() and (sizes > 0.0).all()):
                message = "a pointing direction has no length, or is not finite"
                raise InvalidInput(message)
            object.__setattr__(self, "directions", frozen(self.directions / sizes))

    def aims(
        self, corner_stations: FloatArray, tips: FloatArray, stations: FloatArray
    ) -> FloatArray:
        """Vectors along the cone's axis, linear along each side of the path.

        Args:
            corner_stations: Arc length at each corner of the path, shape (m,); [m].
            tips: Where the tip is on the path, shape (n, 3); [m].
            stations: Arc length along the path there, within it, shape (n,); [m].

        Returns:
            Shape (n, 3), of any length: to the target [m], or of unit vectors [-].
        """
        if self.target is not None:
            return np.asarray(self.target - tips)
        directions = self.directions
        assert directions is not None
        if len(directions) == 1:
            return np.broadcast_to(directions[0], tips.shape).copy()
        columns = [np.interp(stations, corner_stations, one) for one in directions.T]
        return np.stack(columns, axis=-1)


def angles_between(one: FloatArray, other: FloatArray) -> FloatArray:
    """Angles between vectors of any length, shape (n, 3) each, to (n,); [rad].

    NaN where a vector has no length.
    """
    dots = (one * other).sum(axis=-1)
    crosses = np.linalg.norm(np.cross(one, other), axis=-1)
    angles = np.arctan2(crosses, dots)
    return np.asarray(np.where((crosses > 0.0) | (dots != 0.0), angles, np.nan))
