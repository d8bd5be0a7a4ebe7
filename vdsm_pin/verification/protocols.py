"""What problems and motions of snake arms and of other robots have in common."""

from typing import Protocol

from vdsm_pin.geometry.arrays import FloatArray


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
