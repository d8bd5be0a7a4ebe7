"""What problems and motions of snake arms and of any other robot have in common."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from pathlib import Path as File
from typing import TYPE_CHECKING, ClassVar, Final, Literal, Self, TypeAlias

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import (
    BoolArray,
    ByValue,
    FloatArray,
    IntArray,
    check_numbers,
    freeze,
    is_rigid,
)
from vdsm_pin.geometry.bernstein import derivative, value
from vdsm_pin.notebook import Summarised
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene

if TYPE_CHECKING:
    from vdsm_pin.proof.paths import Path

Joined: TypeAlias = Literal["linear", "cubic", "quintic"]
"""What joins the rows of a motion."""

JOINED: Final[Mapping[int, Joined]] = {1: "linear", 3: "cubic", 5: "quintic"}
"""The same by the degree of the pieces."""

BETWEEN: Final = ("times", "rates", "changes")
"""Fields of a motion that tell what lies between its rows; None where not known."""


@dataclass(frozen=True)
class ProblemSource:
    """The files a problem was read from.

    Args:
        path: The problem file.
        sha256: Of its bytes followed by those of the files it names.
        named: The files it names: the arm's URDF, then meshes in the order of the
            obstacles.
        of_obstacles: Names of the obstacles that have a file of their own, with it.
        is_whole: Whether `path` is a problem file, which asks all that is asked; else
            it is the URDF of a robot that was named by itself.
    """

    path: File
    sha256: str
    named: tuple[File, ...] = ()
    of_obstacles: tuple[tuple[str, File], ...] = ()
    is_whole: bool = True

    @property
    def files(self) -> tuple[File, ...]:
        """Everything that was read."""
        return (self.path, *self.named)


class AnyProblem(Summarised):
    """A problem of a snake arm or of any other robot: what its motions are held to.

    Its classes are dataclasses with these fields.

    Attributes:
        name: Name for reports.
        scene: The obstacles, in the base frame.
        required_clearance: Least clearance from obstacles; [m].
        required_self_clearance: Least clearance between bodies of the robot; [m].
        T_world_base: The base frame in the frame of the files, shape (4, 4); [m].
        errors: What every clearance is asked for under.
        source: The files it was read from; None where it was built in Python or changed
            since by more than its errors.
    """

    name: str
    scene: Scene
    required_clearance: float
    required_self_clearance: float
    T_world_base: FloatArray
    errors: ErrorBox
    source: ProblemSource | None

    def check_errors(self, errors: ErrorBox) -> None:
        """Refuse errors of joints or obstacles that do not exist.

        Raises:
            InvalidInput: If they are.
        """
        raise NotImplementedError

    def check_asked(self) -> None:
        """Freeze the pose and check it and the clearances.

        Raises:
            InvalidInput: If it is no rigid motion, or a clearance negative or no
                finite number.
        """
        freeze(self, "T_world_base")
        clearances = "required_clearance", "required_self_clearance"
        check_numbers(self, *clearances)
        if not is_rigid(self.T_world_base):
            message = "T_world_base is no rigid motion, shape (4, 4)"
            raise InvalidInput(message)
        for name in clearances:
            if not 0.0 <= (value := getattr(self, name)) < inf:
                message = f"{name} is {value} m, expected 0 or more"
                raise InvalidInput(message)

    @property
    def slides(self) -> bool:
        """Whether any joint slides, so that its values are lengths."""
        raise NotImplementedError

    @property
    def files(self) -> tuple[File, ...]:
        """The files it was read from, the problem or the robot first."""
        return () if self.source is None else self.source.files

    @property
    def sha256(self) -> str:
        """SHA-256 of the bytes of `files`, one after the other; empty without files."""
        return "" if self.source is None else self.source.sha256

    def under(self, errors: ErrorBox) -> Self:
        """A copy whose clearances are asked for under more errors.

        Args:
            errors: The copy has the least box that holds these and its own.

        Raises:
            InvalidInput: If they name what does not exist.
        """
        self.check_errors(errors)
        widened = self.errors.widened(errors)
        self.check_errors(widened)
        return replace(self, errors=widened).read_from(self.source)  # type: ignore[type-var]

    def read_from(self, source: ProblemSource | None) -> Self:
        """A copy with `source`, the files it was read from."""
        same = replace(self)  # type: ignore[type-var]
        object.__setattr__(same, "source", source)
        return same


class AnyMotion(Summarised, ByValue):
    """A motion of a snake arm or of any other robot: rows of joint values.

    Straight lines join them; cubic pieces where there are times and rates, and quintic
    ones where there are changes of the rates too, as trajectory controllers run them.
    Its classes are dataclasses with these fields.

    Attributes:
        times: Of the rows, rising, shape (n_samples,); [s]. None where not known.
        rates: Velocities of `joints`, of their shape; per [s]. None where not known.
        changes: Accelerations, likewise; per [s^2]. None where not known.
        OF_ROWS: The fields with an entry for every row.
    """

    times: FloatArray | None
    rates: FloatArray | None
    changes: FloatArray | None
    OF_ROWS: ClassVar[tuple[str, ...]]

    @property
    def joints(self) -> FloatArray:
        """All joint values, shape (n_samples, n_columns); [rad], [m]."""
        raise NotImplementedError

    def check_between(self, shape: tuple[int, ...]) -> None:
        """Check the shapes of what tells how rows of joint values are joined.

        Raises:
            InvalidInput: If one does not fit the shape of the rows.
        """
        for name, expected in zip(BETWEEN, (shape[:1], shape, shape), strict=True):
            values = getattr(self, name)
            if values is not None and values.shape != expected:
                message = f"{name} have shape {values.shape}, expected {expected}"
                raise InvalidInput(message)

    @property
    def n_samples(self) -> int:
        """Number of rows."""
        return len(self.joints)

    @property
    def is_smooth(self) -> bool:
        """Whether smooth pieces join the rows, not straight lines."""
        known = self.rates is not None and self.times is not None
        return known and self.n_samples > 1

    @property
    def interpolation(self) -> Joined:
        """What joins the rows: linear, cubic or quintic pieces."""
        return JOINED[self.path.degree]

    @cached_property
    def path(self) -> "Path":
        """How `joints` move: the rows and what joins them.

        Raises:
            ValueError: If times do not rise, or a value is not finite.
        """
        from vdsm_pin.proof.paths import Path  # compiled code, which few need

        return Path.through(self.joints, self.times, self.rates, self.changes)

    def times_at(self, moments: FloatArray) -> FloatArray | None:
        """Times of moments in waypoints, shape (m,); [s]. None where not known."""
        return self.path.times_at(moments)

    def only(self, rows: BoolArray | slice) -> Self:
        """Some of its rows."""
        known = {name: getattr(self, name) for name in self.OF_ROWS}
        kept = {name: all_[rows] for name, all_ in known.items() if all_ is not None}
        return replace(self, **kept)  # type: ignore[type-var]

    def between(
        self, row: IntArray, share: FloatArray
    ) -> tuple[FloatArray | None, FloatArray | None]:
        """Velocities and accelerations of smooth pieces, None where not known.

        Args:
            row: Before the places that are asked for, not the last one, shape (m,).
            share: Where each is between that row and the next, 0 to 1, shape (m,).
        """
        if self.rates is None or self.times is None:
            return None, None
        step, once = np.diff(self.times)[row, None], derivative(self.path.pieces(row))
        rates = value(once, share) / step
        if self.changes is None:
            return rates, None
        return rates, value(derivative(once), share) / step**2
