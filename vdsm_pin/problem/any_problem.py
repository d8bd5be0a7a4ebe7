"""What problems and motions of snake arms and of any other robot have in common."""

from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Protocol, Self

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, check_numbers, freeze, is_rigid
from vdsm_pin.notebook import Summarised
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene


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

    path: Path
    sha256: str
    named: tuple[Path, ...] = ()
    of_obstacles: tuple[tuple[str, Path], ...] = ()
    is_whole: bool = True

    @property
    def files(self) -> tuple[Path, ...]:
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
    def files(self) -> tuple[Path, ...]:
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


class AnyMotion(Protocol):
    """A motion of a snake arm or of any other robot: rows of joint values."""

    @property
    def n_samples(self) -> int:
        """Number of rows."""

    @property
    def times(self) -> FloatArray | None:
        """Times of the rows, shape (n_samples,); None where not known; [s]."""

    def times_at(self, moments: FloatArray) -> FloatArray | None:
        """Times of moments in waypoints, shape (m,); None where not known; [s]."""
