"""What takes the place of constant ratios about the rail (paper, section 8)."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from vdsm_pin.errors import InvalidInput, NoPlanFound
from vdsm_pin.geometry.arrays import ByValue, FloatArray, freeze
from vdsm_pin.units import in_mm


@dataclass(frozen=True, eq=False)
class OtherRatios(ByValue):
    """Projections P_i = k_i T with ratios of the user's own.

    Args:
        values: k_2..k_N, shape (N - 1,); [-].

    Raises:
        InvalidInput: If a ratio is not finite.
    """

    values: FloatArray

    def __post_init__(self) -> None:
        """Freeze the ratios and check them."""
        freeze(self, "values")
        if self.values.ndim != 1 or not np.isfinite(self.values).all():
            message = f"ratios are {self.values.tolist()}, expected finite numbers"
            raise InvalidInput(message)

    def check(self, n_links: int) -> None:
        """Hold the number of ratios against that of the links.

        Raises:
            InvalidInput: If they do not fit.
        """
        if len(self.values) != n_links - 1:
            message = (
                f"there are {len(self.values)} ratios, expected {n_links - 1}: "
                f"k_2 to k_{n_links}"
            )
            raise InvalidInput(message)

    def planar(self, stations: FloatArray, tip: FloatArray) -> FloatArray:
        """Projected joint centres; for what is given and returned see `Scaling`."""
        ratios = np.concatenate([[0.0], self.values, [1.0]])
        return np.asarray(ratios[:, None] * tip[:, None, :])


@dataclass(frozen=True, eq=False)
class ScalingCentre(ByValue):
    """One joint stays over a centre C, about which the joints after it are scaled.

    P_i = C + k_i (T - C) after joint m, with k_i = (s_i - s_m) / (s_{N+1} - s_m), and
    P_i = s_i / s_m C before it.

    Args:
        centre: C, y and z, shape (2,); [m].
        joint: m, 2 to N.

    Raises:
        InvalidInput: If the centre is not two finite numbers.
    """

    centre: FloatArray
    joint: int

    def __post_init__(self) -> None:
        """Freeze the centre and check it."""
        freeze(self, "centre")
        if self.centre.shape != (2,) or not np.isfinite(self.centre).all():
            found = self.centre.tolist()
            message = f"the scaling centre is {found}, expected 2 finite numbers"
            raise InvalidInput(message)

    def check(self, n_links: int) -> None:
        """Hold the joint against the arm.

        Raises:
            InvalidInput: If it has no such joint.
        """
        if not 2 <= self.joint <= n_links:
            message = f"the scaling joint is {self.joint}, expected 2 to {n_links}"
            raise InvalidInput(message)

    def planar(self, stations: FloatArray, tip: FloatArray) -> FloatArray:
        """Projected joint centres; for what is given and returned see `Scaling`."""
        at, last = stations[self.joint - 1], stations[-1]
        ahead = np.minimum(stations / at, 1.0)[:, None]
        after = np.maximum((stations - at) / (last - at), 0.0)[:, None]
        return np.asarray(ahead * self.centre + after * (tip - self.centre)[:, None, :])


@dataclass(frozen=True)
class ProjectionCylinder:
    """Points are projected along X onto a cylinder, and scaled on its unrolled surface.

    The cylinder touches the plane Y0Z0 along the axis y or z. Unrolled, the coordinate
    w across that axis is R asin(w / R), so that w_i = R sin(k_i asin(w / R)); the other
    one is scaled as in the plane. With R to infinity this is the paper's scaling.

    Args:
        radius: R; [m].
        axis: Of the cylinder.

    Raises:
        InvalidInput: If the radius is not above 0.
    """

    radius: float
    axis: Literal["y", "z"] = "z"

    def __post_init__(self) -> None:
        """Check the radius."""
        if not 0.0 < self.radius < np.inf:
            message = f"the cylinder's radius is {self.radius} m, expected above 0"
            raise InvalidInput(message)

    def check(self, n_links: int) -> None:
        """Nothing: a cylinder suits every arm."""

    def planar(self, stations: FloatArray, tip: FloatArray) -> FloatArray:
        """Projected joint centres; for what is given and returned see `Scaling`.

        Raises:
            NoPlanFound: If the tip is farther from the axis than the radius.
        """
        ratios = (stations / stations[-1])[:, None]
        across = 0 if self.axis == "z" else 1
        part = tip[:, across] / self.radius
        if not (np.abs(part) <= 1.0).all():
            farthest = float(np.abs(tip[:, across]).max())
            message = (
                f"the tip comes {in_mm(farthest)} off the {self.axis} axis, beyond the "
                f"projection cylinder of radius {in_mm(self.radius)}"
            )
            raise NoPlanFound(message)
        planar = np.asarray(ratios * tip[:, None, :])
        angles = ratios[:, 0] * np.arcsin(part)[:, None]
        planar[..., across] = self.radius * np.sin(angles)
        planar[:, -1] = tip
        return planar


Scaling: TypeAlias = OtherRatios | ScalingCentre | ProjectionCylinder
"""Step 3 by another rule: `planar(stations, tip)` places the joints.

`stations` are the arm's, shape (N + 1,); `tip` holds P_{N+1}, shape (n, 2). It returns
P_1..P_{N+1}, shape (n, N + 1, 2); [m].
"""
