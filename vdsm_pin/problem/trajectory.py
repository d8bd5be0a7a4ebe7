"""A trajectory: rows of joint values, joined by straight lines or by smooth pieces."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import (
    BoolArray,
    ByValue,
    FloatArray,
    freeze,
    frozen,
    same_arrays,
)
from vdsm_pin.geometry.bernstein import derivative, value
from vdsm_pin.notebook import Summarised
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

if TYPE_CHECKING:
    from vdsm_pin.proof.paths import Path

Joined: TypeAlias = Literal["linear", "cubic", "quintic"]
"""What joins the rows of a motion."""

JOINED: Final[Mapping[int, Joined]] = {1: "linear", 3: "cubic", 5: "quintic"}
"""The same by the degree of the pieces."""

MAX_ROWS: Final = 5_000_000
"""Largest number of rows of one trajectory."""

NUMBERS: Final = ("path_m", "x0", "alpha", "theta")
"""Fields of a trajectory that hold numbers of every row."""

BETWEEN: Final = ("times", "rates", "changes")
"""Those that tell what lies between them; None where not known."""


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Summarised, ByValue):
    """What a planner hands over and a verifier judges.

    Args:
        on_path: Whether the tip is on the desired path, shape (n_samples,).
        path_m: Arc length of the tip along the desired path (on detours: of the place
            where it left), shape (n_samples,); [m].
        x0: Base position on the rail, shape (n_samples,); [m].
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].
        notes: What its file had besides, one phrase each.
        times: Of the rows, rising, shape (n_samples,); [s]. None where not known.
        rates: Velocities of `joints`, shape (n_samples, 1 + 2N): cubic pieces join the
            rows; None for straight lines; [m/s], [rad/s].
        changes: Accelerations of `joints`, the same shape: the pieces are quintic;
            [m/s^2], [rad/s^2].

    Raises:
        InvalidInput: If shapes disagree, a value is not finite, times do not rise, a
            path_m goes beyond `TOLERANCES.path_extent`, or there is no row.
    """

    on_path: BoolArray
    path_m: FloatArray
    x0: FloatArray
    alpha: FloatArray
    theta: FloatArray
    notes: tuple[str, ...] = ()
    times: FloatArray | None = None
    rates: FloatArray | None = None
    changes: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays and check their shapes."""
        freeze(self, "on_path", dtype=np.bool_)
        freeze(self, *NUMBERS, *BETWEEN)
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
        for name in NUMBERS:
            if not np.isfinite(getattr(self, name)).all():
                message = f"trajectory has a value of {name} that is not finite"
                raise InvalidInput(message)
        if not (np.abs(self.path_m) <= TOLERANCES.path_extent).all():
            message = f"trajectory has a path_m beyond {TOLERANCES.path_extent:g} m"
            raise InvalidInput(message)
        self._check_motion()

    def _check_motion(self) -> None:
        """Check what is known of the motion between the rows.

        Raises:
            InvalidInput: If it does not fit the rows.
        """
        n, width = self.n_samples, 1 + 2 * self.n_links
        shapes = {"times": (n,), "rates": (n, width), "changes": (n, width)}
        for name, shape in shapes.items():
            if (values := getattr(self, name)) is None:
                continue
            if values.shape != shape or not np.isfinite(values).all():
                message = (
                    f"trajectory has {name} of shape {values.shape}, expected {shape}, "
                    "all of them finite"
                )
                raise InvalidInput(message)
        if self.times is not None and not (np.diff(self.times) > 0.0).all():
            message = "trajectory has times that do not rise from row to row"
            raise InvalidInput(message)
        if self.rates is not None and self.times is None:
            message = "trajectory has velocities but no times"
            raise InvalidInput(message)
        if self.changes is not None and self.rates is None:
            message = "trajectory has accelerations but no velocities"
            raise InvalidInput(message)

    @classmethod
    def of_joints(
        cls,
        joints: FloatArray,
        on_path: BoolArray | None = None,
        path_m: FloatArray | None = None,
        times: FloatArray | None = None,
        rates: FloatArray | None = None,
        changes: FloatArray | None = None,
        notes: tuple[str, ...] = (),
    ) -> "Trajectory":
        """A trajectory from its rows of joint values, shape (n_samples, 1 + 2N).

        Without `on_path` it draws nothing, without `path_m` it is at 0 m of the path.
        """
        joints = frozen(joints)
        nothing = np.zeros(len(joints))
        return cls(
            nothing.astype(np.bool_) if on_path is None else on_path,
            nothing if path_m is None else path_m,
            joints[:, 0],
            joints[:, 1::2],
            joints[:, 2::2],
            notes,
            times,
            rates,
            changes,
        )

    @property
    def n_samples(self) -> int:
        """Number of rows."""
        return int(self.x0.size)

    @property
    def n_links(self) -> int:
        """Number of links N."""
        return int(self.alpha.shape[1])

    @cached_property
    def joints(self) -> FloatArray:
        """All joint values q = (x0, alpha1, theta1, ..), shape (n_samples, 1 + 2N).

        Metres in the first column, radians in the others.
        """
        rows = np.zeros((self.n_samples, 1 + 2 * self.n_links))
        rows[:, 0], rows[:, 1::2], rows[:, 2::2] = self.x0, self.alpha, self.theta
        rows.setflags(write=False)
        return rows

    def same_as(self, other: "Trajectory") -> bool:
        """Whether all numbers are the same; notes do not count."""
        return same_arrays(self, other, ("on_path", *NUMBERS, *BETWEEN))

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Its size and what it moves."""
        low, high = float(self.x0.min()), float(self.x0.max())
        largest = float(np.rad2deg(max(abs(self.alpha).max(), abs(self.theta).max())))
        return (
            ("links", str(self.n_links)),
            ("waypoints", f"{self.n_samples}, {int(self.on_path.sum())} on the path"),
            ("x0", f"{in_mm(low)} to {in_mm(high)}"),
            ("largest angle", f"{largest:.3f}°"),
        )

    @property
    def is_smooth(self) -> bool:
        """Whether smooth pieces join the rows, not straight lines."""
        return self.rates is not None and self.n_samples > 1

    @property
    def interpolation(self) -> Joined:
        """What joins the rows: linear, cubic or quintic pieces."""
        if self.rates is None:
            return "linear"
        return "cubic" if self.changes is None else "quintic"

    @cached_property
    def path(self) -> "Path":
        """How `joints` move: the rows and what joins them."""
        from vdsm_pin.proof.paths import Path  # compiled code, which few need

        return Path.through(self.joints, self.times, self.rates, self.changes)

    def part(self, first: int, last: int) -> "Trajectory":
        """The rows from `first` up to `last`, or to the end where there are fewer."""
        rows = slice(first, last)
        return Trajectory.of_joints(
            self.joints[rows],
            self.on_path[rows],
            self.path_m[rows],
            None if self.times is None else self.times[rows],
            None if self.rates is None else self.rates[rows],
            None if self.changes is None else self.changes[rows],
        )

    def times_at(self, moments: FloatArray) -> FloatArray | None:
        """Times of moments in waypoints, shape (m,); [s]. None where not known."""
        return self.path.times_at(moments)

    def at(self, moments: FloatArray) -> "Trajectory":
        """Rows at moments in waypoints, shape (m,); with times where those rise."""
        before = np.minimum(moments.astype(np.int64), self.n_samples - 1)
        joints, times = self.path.at_moments(moments), self.times_at(moments)
        if times is not None and not (np.diff(times) > 0.0).all():
            times = None
        return Trajectory.of_joints(
            joints, self.on_path[before], self.path_m[before], times
        )

    def refined(self, parts: int) -> "Trajectory":
        """The same smooth motion with every piece cut into so many equal ones."""
        if self.rates is None or self.times is None or self.n_samples == 1:
            return self
        k, share = np.divmod(np.arange((self.n_samples - 1) * parts + 1), parts)
        after = np.minimum(k + 1, self.n_samples - 1)
        # A row in between is on the path where both its neighbours are.
        on_path = self.on_path[k] & (self.on_path[after] | (share == 0))
        share = share / parts
        path_m = self.path_m[k] + share * (self.path_m[after] - self.path_m[k])
        rows = self.path.at_moments(k + share), on_path, path_m
        k, share[-1] = np.minimum(k, self.n_samples - 2), 1.0
        step, once = np.diff(self.times)[k, None], derivative(self.path.pieces(k))
        rates, changes = value(once, share) / step, None
        if self.changes is not None:
            changes = value(derivative(once), share) / step**2
        times = np.interp(k + share, np.arange(self.n_samples), self.times)
        return Trajectory.of_joints(*rows, times, rates, changes)
