"""A trajectory: rows of joint values, joined by straight lines in joint space."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, frozen
from vdsm_pin.notebook import Summarised
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

MAX_ROWS: Final = 5_000_000
"""Largest number of rows of one trajectory."""


@dataclass(frozen=True, repr=False)
class Trajectory(Summarised):
    """What a planner hands over and a verifier judges.

    Args:
        on_path: Whether the tip is on the desired path, shape (n_samples,).
        path_m: Arc length of the tip along the desired path (on detours: of the place
            where it left), shape (n_samples,); [m].
        x0: Base position on the rail, shape (n_samples,); [m].
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].
        notes: What its file had besides, one phrase each.

    Raises:
        InvalidInput: If shapes disagree, a value is not finite, a path_m goes beyond
            `TOLERANCES.path_extent`, or there is no row.
    """

    on_path: BoolArray
    path_m: FloatArray
    x0: FloatArray
    alpha: FloatArray
    theta: FloatArray
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Freeze the arrays and check their shapes."""
        object.__setattr__(self, "on_path", frozen(self.on_path, np.bool_))
        for name in ("path_m", "x0", "alpha", "theta"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        n, shape = self.x0.size, self.alpha.shape
        if n == 0:
            message = "a trajectory needs at least one row"
            raise InvalidInput(message)
        same = self.on_path.shape == self.path_m.shape == self.x0.shape == (n,)
        if (
            not same
            or self.theta.shape != shape
            or shape[:1] != (n,)
            or len(shape) != 2
        ):
            message = f"trajectory arrays disagree: x0 {self.x0.shape}, alpha {shape}"
            raise InvalidInput(message)
        for name in ("path_m", "x0", "alpha", "theta"):
            if not np.isfinite(getattr(self, name)).all():
                message = f"trajectory has a value of {name} that is not finite"
                raise InvalidInput(message)
        if not (np.abs(self.path_m) <= TOLERANCES.path_extent).all():
            message = f"trajectory has a path_m beyond {TOLERANCES.path_extent:g} m"
            raise InvalidInput(message)

    @property
    def n_samples(self) -> int:
        """Number of rows."""
        return int(self.x0.size)

    @property
    def n_links(self) -> int:
        """Number of links N."""
        return int(self.alpha.shape[1])

    @property
    def joints(self) -> FloatArray:
        """All joint values q = (x0, alpha1, theta1, ..), shape (n_samples, 1 + 2N).

        Metres in the first column, radians in the others.
        """
        angles = np.stack([self.alpha, self.theta], axis=2).reshape(self.n_samples, -1)
        return np.concatenate([self.x0[:, None], angles], axis=1)

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Its size and what it moves."""
        low, high = float(self.x0.min()), float(self.x0.max())
        largest = float(np.rad2deg(max(abs(self.alpha).max(), abs(self.theta).max())))
        return (
            ("links", str(self.n_links)),
            ("waypoints", f"{self.n_samples}, {int(self.on_path.sum())} on the path"),
            ("x0", f"{in_mm(low)} to {in_mm(high)}"),
            ("largest angle", f"{largest:.3f} deg"),
        )

    def part(self, first: int, last: int) -> "Trajectory":
        """The rows from `first` up to `last`, or to the end where there are fewer."""
        rows = slice(first, last)
        return Trajectory(
            self.on_path[rows],
            self.path_m[rows],
            self.x0[rows],
            self.alpha[rows],
            self.theta[rows],
        )
