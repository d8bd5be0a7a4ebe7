"""Where the driving cables run through the links (paper, section 5.2, Fig. 10)."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import ByValue, FloatArray, check_numbers, freeze


@dataclass(frozen=True, eq=False)
class CableLayout(ByValue):
    """Where the three driving cables of each link run (paper, section 5.2).

    Args:
        hole_radius: Radius r of the circle of cable holes; [m].
        half_gap: Distance d from a joint centre to the link's end face; [m].
        hole_angles: phi of the holes a, b, c of each link, shape (N, 3); [rad].

    Example:
        >>> vp.CableLayout(0.02, 0.01, np.radians([[0.0, 120.0, 240.0]])).hole_radius
        0.02
    """

    hole_radius: float
    half_gap: float
    hole_angles: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array and refuse impossible sizes."""
        freeze(self, "hole_angles")
        check_numbers(self, "hole_radius", "half_gap")
        if not 0.0 < self.hole_radius < np.inf:
            message = f"hole_radius is {self.hole_radius} m, expected above 0"
            raise InvalidInput(message)
        if not 0.0 < self.half_gap < np.inf:
            message = f"half_gap is {self.half_gap} m, expected above 0"
            raise InvalidInput(message)
        if self.hole_angles.ndim != 2 or self.hole_angles.shape[1] != 3:
            shape = self.hole_angles.shape
            message = f"hole_angles has shape {shape}, expected (N, 3)"
            raise InvalidInput(message)
        if not np.isfinite(self.hole_angles).all():
            message = "hole_angles has a value that is not finite"
            raise InvalidInput(message)


def paper_hole_angles(n_links: int) -> FloatArray:
    """Hole angles as in Fig. 10, for any number of links.

    The 3N holes are 360/3N deg apart; phi_b of link 5 is 0 in the paper's arm of eight
    (phi_ijb = 15 (j - 5) deg), and a and c lie 120 deg to either side of b.

    Args:
        n_links: Number of links N.

    Returns:
        phi of the holes a, b, c, shape (N, 3), in [0, 2 pi); [rad].
    """
    step = 2.0 * np.pi / (3 * n_links)
    phi_b = step * (np.arange(1, n_links + 1) - (n_links // 2 + 1))
    third = 2.0 * np.pi / 3.0
    return np.mod(np.stack([phi_b - third, phi_b, phi_b + third], axis=1), 2.0 * np.pi)
