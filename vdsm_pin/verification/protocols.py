"""What problems and motions of snake arms and of other robots have in common."""

from typing import Protocol

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import ProblemSource
from vdsm_pin.problem.scene import Scene


class AnyProblem(Protocol):
    """A problem of a snake arm or of any other robot: what its motions are held to."""

    @property
    def name(self) -> str:
        """Name for reports."""

    @property
    def scene(self) -> Scene:
        """The obstacles, in the base frame."""

    @property
    def required_clearance(self) -> float:
        """Least clearance from obstacles; [m]."""

    @property
    def required_self_clearance(self) -> float:
        """Least clearance between bodies of the robot; [m]."""

    @property
    def T_world_base(self) -> FloatArray:  # noqa: N802  field notation
        """The base frame in the frame of the problem file, shape (4, 4); [m]."""

    @property
    def source(self) -> ProblemSource | None:
        """The files that it was read from; None where it was built in Python."""


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
