"""A trajectory: rows of joint values, joined by straight lines or by smooth pieces."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import (
    BoolArray,
    FloatArray,
    freeze,
    frozen,
    same_arrays,
)
from vdsm_pin.problem.any_problem import BETWEEN, AnyMotion
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

MAX_ROWS: Final = 5_000_000
"""Largest number of rows of one trajectory."""

NUMBERS: Final = ("path_m", "x0", "alpha", "theta")
"""Fields of a trajectory that hold numbers of every row."""


def joint_names(n_links: int) -> tuple[str, ...]:
    """Names of the joints of an arm of N links, as in its URDF: x0, alpha1, .."""
    pairs = ((f"alpha{i}", f"theta{i}") for i in range(1, n_links + 1))
    return ("x0", *(name for pair in pairs for name in pair))


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(AnyMotion):
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

    Example:
        >>> motion = vp.plan(vp.read_problem("paper/free"), "paper").trajectory
        >>> motion.alpha.shape == motion.theta.shape == (motion.n_samples, 8)
        True
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
    OF_ROWS: ClassVar = ("on_path", *NUMBERS, *BETWEEN)

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
        self.check_between((n, 1 + 2 * self.n_links))
        for name in (*NUMBERS, *BETWEEN):
            values = getattr(self, name)
            if values is not None and not np.isfinite(values).all():
                message = f"trajectory has a value of {name} that is not finite"
                raise InvalidInput(message)
        if not (np.abs(self.path_m) <= TOLERANCES.path_extent).all():
            message = f"trajectory has a path_m beyond {TOLERANCES.path_extent:g} m"
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
    def n_links(self) -> int:
        """Number of links N."""
        return int(self.alpha.shape[1])

    @cached_property
    def joints(self) -> FloatArray:
        """All joint values q = (x0, alpha1, theta1, ..), shape (n_samples, 1 + 2N).

        Metres in the first column, radians in the others.
        """
        rows = np.zeros((len(self.x0), 1 + 2 * self.n_links))
        rows[:, 0], rows[:, 1::2], rows[:, 2::2] = self.x0, self.alpha, self.theta
        rows.setflags(write=False)
        return rows

    def same_as(self, other: "Trajectory") -> bool:
        """Whether all numbers are the same; notes do not count."""
        return same_arrays(self, other, self.OF_ROWS)

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
    def named(self) -> JointTrajectory:
        """The same rows by the joints of the arm's URDF: x0, alpha1, theta1, .."""
        names, between = joint_names(self.n_links), (self.rates, self.changes)
        return JointTrajectory(names, self.joints, self.times, *between)

    def part(self, first: int, last: int) -> "Trajectory":
        """The rows from `first` up to `last`, or to the end where there are fewer."""
        return self.only(slice(first, last))

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
        if not self.is_smooth:
            return self
        k, share = np.divmod(np.arange((self.n_samples - 1) * parts + 1), parts)
        after = np.minimum(k + 1, self.n_samples - 1)
        # A row in between is on the path where both its neighbours are.
        on_path = self.on_path[k] & (self.on_path[after] | (share == 0))
        share = share / parts
        path_m = self.path_m[k] + share * (self.path_m[after] - self.path_m[k])
        joints, times = self.path.at_moments(k + share), self.times_at(k + share)
        k, share[-1] = np.minimum(k, self.n_samples - 2), 1.0
        between = self.between(k, share)
        return Trajectory.of_joints(joints, on_path, path_m, times, *between)
