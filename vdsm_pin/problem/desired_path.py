"""What the tip shall draw: a polyline, and how much of it is asked for."""

from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import (
    ByValue,
    FloatArray,
    check_numbers,
    freeze,
    frozen,
    running_sums,
)
from vdsm_pin.notebook import Summarised
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import point_mm, quantity


class Approach(StrEnum):
    """How the tip comes onto the desired path (paper, 4.2.2)."""

    SHORTEST = "shortest"
    EQUIDISTANT = "equidistant"
    NEAREST_EQUIDISTANT = "nearest_equidistant"


class Blocked(StrEnum):
    """What to do where the desired path itself cannot be drawn.

    Draw the rest of it, or refuse to plan at all.
    """

    DETOUR = "detour"
    FAIL = "fail"


class Order(StrEnum):
    """In which order the desired path may be drawn."""

    AS_GIVEN = "as_given"
    FREE = "free"


@dataclass(frozen=True, eq=False, repr=False)
class DesiredPath(Summarised, ByValue):
    """What the tip shall draw, in the base frame.

    Args:
        start: Tip position at the start, shape (3,); [m].
        points: Corners of the polyline, shape (n, 3), n >= 1; [m].
        closed: Whether the last corner joins the first.
        spacing: Largest distance of the tip between two rows; [m].
        approach: The paper's three schemes.
        retreat: Largest step back along -X while off the path; [m].
        blocked: Detour or fail.
        required_coverage: Least part of the path that must be drawn, 0 to 1; [-].
        start_joints: Joint values q = (x0, alpha1, theta1, ..) at the start, shape
            (1 + 2N,), with `start` their tip; None where the arm starts straight;
            [m] in the first entry, [rad] in the others.
        order: Whether pieces of the path may be drawn in another order or direction.
        pointing: Where the last link shall look meanwhile; None for anywhere.
        home: Whether the arm shall go back to its start by the way it came.
        insertion: Places between start and path that `follow-the-leader` takes, in this
            order, and others try, shape (k, 3); [m].

    Raises:
        InvalidInput: If a value breaks its range, or directions do not fit the corners.

    Example:
        >>> corners = np.array([[3.1, 0.2, 0.0], [3.1, 0.2, 0.5]])
        >>> path = vp.DesiredPath(np.array([3.126, 0.0, 0.0]), corners)
        >>> float(path.length)
        0.5
    """

    start: FloatArray
    points: FloatArray
    closed: bool = False
    spacing: float = 0.010
    approach: Approach = Approach.SHORTEST
    retreat: float = 0.0
    blocked: Blocked = Blocked.DETOUR
    required_coverage: float = 1.0
    start_joints: FloatArray | None = None
    order: Order = Order.AS_GIVEN
    pointing: Pointing | None = None
    home: bool = False
    insertion: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        """Freeze the arrays and check the values."""
        freeze(self, "start", "points", "insertion", "start_joints")
        check_numbers(self, "spacing", "retreat", "required_coverage")
        shape = self.insertion.shape
        if len(shape) != 2 or shape[1] != 3 or not np.isfinite(self.insertion).all():
            message = f"tip_path.insertion has shape {shape}, expected (k, 3), finite"
            raise InvalidInput(message)
        if self.start.shape != (3,) or not np.isfinite(self.start).all():
            message = (
                f"tip_path.start is {self.start.tolist()}, expected 3 finite numbers"
            )
            raise InvalidInput(message)
        if (
            self.points.ndim != 2
            or self.points.shape[1:] != (3,)
            or not self.points.size
        ):
            message = f"tip_path.points has shape {self.points.shape}, expected (n, 3)"
            raise InvalidInput(message)
        if not np.isfinite(self.points).all():
            message = "tip_path.points has a value that is not finite"
            raise InvalidInput(message)
        if not 0.0 < self.spacing < np.inf:
            message = f"tip_path.spacing is {self.spacing} m, expected above 0"
            raise InvalidInput(message)
        if not 0.0 <= self.retreat < np.inf:
            message = f"tip_path.retreat is {self.retreat} m, expected 0 or more"
            raise InvalidInput(message)
        if not 0.0 <= self.required_coverage <= 1.0:
            value = self.required_coverage
            message = f"tip_path.required_coverage is {value}, expected 0 to 1"
            raise InvalidInput(message)
        self._check_pointing()

    def _check_pointing(self) -> None:
        directions = None if self.pointing is None else self.pointing.directions
        if directions is None or len(directions) in (1, len(self.corners)):
            ends = np.zeros((2, 3)) if directions is None else directions[[0, -1]]
            if self.closed and (ends[0] != ends[1]).any():
                message = (
                    "pointing has another direction at the last corner of a closed "
                    "path than at the first, which it is"
                )
                raise InvalidInput(message)
            return
        message = (
            f"pointing has {len(directions)} directions for a path of "
            f"{len(self.corners)} corners, expected one, or one for each"
        )
        raise InvalidInput(message)

    def aims(self, tips: FloatArray, stations: FloatArray) -> FloatArray:
        """Where the last link shall look on the path; see `Pointing.aims`.

        Args:
            tips: Shape (n, 3); [m].
            stations: Arc length along the path, past its length on laps, (n,); [m].

        Returns:
            Shape (n, 3), NaN where it may look anywhere.
        """
        if self.pointing is None:
            return np.full(tips.shape, np.nan)
        return self.pointing.aims(self.corner_stations, tips, self.wrapped(stations))

    def wrapped(self, stations: FloatArray) -> FloatArray:
        """Stations within the path, shape (k,) to (k,); [m].

        A closed path that is begun anywhere counts on past its length, up to twice it.
        """
        if not self.closed:
            return stations
        return np.where(stations > self.length, stations - self.length, stations)

    def within(self, station: float) -> float:
        """One of such stations; [m]."""
        return float(self.wrapped(np.array(station)))

    @cached_property
    def corners(self) -> FloatArray:
        """The polyline drawn, closing corner repeated, shape (m, 3); [m]."""
        if self.closed and len(self.points) > 1:
            return frozen(np.vstack([self.points, self.points[:1]]))
        return self.points

    @cached_property
    def corner_stations(self) -> FloatArray:
        """Arc length at each corner, shape (m,); [m]."""
        sides = np.linalg.norm(np.diff(self.corners, axis=0), axis=1)
        return frozen(np.concatenate([[0.0], running_sums(sides)]))

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Its start, corners and length, and where the last link looks."""
        corners = f"{len(self.points)}, {'closed' if self.closed else 'open'}"
        looks = "-" if self.pointing is None else quantity(self.pointing.cone, "rad")
        return (
            ("start", f"{point_mm(self.start)} mm"),
            ("corners", corners),
            ("length", quantity(self.length, "m")),
            ("spacing", quantity(self.spacing, "m")),
            ("order", self.order.value),
            ("aim within", looks),
        )

    @property
    def length(self) -> float:
        """Arc length of the whole path; [m]."""
        return float(self.corner_stations[-1])

    @cached_property
    def entry(self) -> float:
        """Arc length where the drawing begins by the "shortest distance" scheme; [m].

        On a closed path that is the point nearest to the start, of equals the first;
        an open one is drawn from its first corner.
        """
        if not self.closed or self.length == 0.0:
            return 0.0
        begins, sides = self.corners[:-1], np.diff(self.corners, axis=0)
        squared = np.einsum("ij,ij->i", sides, sides)
        towards = np.einsum("ij,ij->i", self.start - begins, sides)
        part = np.clip(towards / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
        gaps = np.linalg.norm(begins + part[:, None] * sides - self.start, axis=1)
        k = int(np.argmax(gaps <= gaps.min() + TOLERANCES.on_path_length))
        return float(self.corner_stations[k] + part[k] * np.sqrt(squared[k]))

    def at(self, stations: FloatArray) -> FloatArray:
        """Points of the path at arc lengths, shape (k,) to (k, 3); [m].

        Stations outside [0, length] are clamped to the ends; for a closed path callers
        wrap them first.
        """
        known = self.corner_stations
        columns = [np.interp(stations, known, column) for column in self.corners.T]
        return np.stack(columns, axis=-1)
