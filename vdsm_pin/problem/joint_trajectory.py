"""A trajectory of named joints, of any robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, freeze
from vdsm_pin.problem.any_problem import BETWEEN, AnyMotion


@dataclass(frozen=True, eq=False, repr=False)
class JointTrajectory(AnyMotion):
    """Waypoints of named joints.

    Straight lines join them; cubic pieces where there are times and rates, and quintic
    ones where there are changes of the rates too, as trajectory controllers run them.

    Args:
        names: One for each column.
        q: Shape (n_samples, n_columns), at least one row; [rad], [m].
        times: Shape (n_samples,), rising; [s]. None where not known.
        rates: Velocities, as q; per [s]. None where not known.
        changes: Accelerations, as q; per [s^2]. None where not known.
        notes: What else a reader should know, a sentence each.
        in_degrees: Joints whose unit the file states as degrees, or as millimetres.

    Raises:
        InvalidInput: If shapes disagree, a name is there twice, velocities lack times,
            or accelerations lack velocities.

    Example:
        >>> both = JointTrajectory(("shoulder", "elbow"), [[0.0, 0.0], [1.0, 0.5]])
        >>> both.path.n_intervals
        1
    """

    names: tuple[str, ...]
    q: FloatArray
    times: FloatArray | None = None
    rates: FloatArray | None = None
    changes: FloatArray | None = None
    notes: tuple[str, ...] = ()
    in_degrees: tuple[str, ...] = ()
    OF_ROWS: ClassVar = ("q", *BETWEEN)

    def __post_init__(self) -> None:
        """Freeze the arrays and check their shapes."""
        freeze(self, *self.OF_ROWS)
        object.__setattr__(self, "names", tuple(self.names))
        names, q = self.names, self.q
        if q.ndim != 2 or not len(q) or q.shape[1] != len(names):
            expected = f"(1 or more, {len(names)})"
            message = f"positions have shape {q.shape}, expected {expected}"
            raise InvalidInput(message)
        if not all(isinstance(name, str) for name in names):
            message = f"joint names are {names!r}, expected text"
            raise InvalidInput(message)
        if len(set(names)) < len(names):
            message = f"joint names are {', '.join(names)}, expected each once"
            raise InvalidInput(message)
        if not np.isfinite(q).all():
            row, k = np.argwhere(~np.isfinite(q))[0]
            found = f"joint {names[k]!r} is {q[row, k]} at waypoint {row}"
            message = f"{found}, expected a finite number"
            raise InvalidInput(message)
        self.check_between(q.shape)
        self._check_smooth()

    def _check_smooth(self) -> None:
        """Refuse rates that no piece would take, unless nothing moves.

        Raises:
            InvalidInput: If times or velocities are missing.
        """
        for what, values, needed in (
            ("velocities", self.rates, {"times": self.times}),
            (
                "accelerations",
                self.changes,
                {"velocities": self.rates, "times": self.times},
            ),
        ):
            lacks = " and ".join(key for key, known in needed.items() if known is None)
            if lacks and values is not None and values.any() and self.n_samples > 1:
                message = f"has {what}, expected {lacks} too"
                raise InvalidInput(message)

    @property
    def joints(self) -> FloatArray:
        """All joint values, `q`."""
        return self.q

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Its joints, its size and its time."""
        times = self.times
        known = "none" if times is None else f"{times[0]:g} s to {times[-1]:g} s"
        return (
            ("joints", ", ".join(self.names)),
            ("waypoints", str(self.n_samples)),
            ("times", known),
        )

    def of(self, names: Sequence[str]) -> "JointTrajectory":
        """The columns of some of its joints, in their order."""
        order = [self.names.index(name) for name in names]
        parts = (self.rates, self.changes)
        rates, changes = (None if part is None else part[:, order] for part in parts)
        return JointTrajectory(
            tuple(names),
            self.q[:, order],
            self.times,
            rates,
            changes,
            in_degrees=tuple(name for name in names if name in self.in_degrees),
        )
