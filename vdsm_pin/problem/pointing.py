"""Where the last link shall look while the tip draws."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import (
    BoolArray,
    ByValue,
    FloatArray,
    check_numbers,
    freeze,
    frozen,
)
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.tolerances import TOLERANCES

WIDEST: Final = np.pi / 2.0
"""Cones are narrower than this; [rad]."""


@dataclass(frozen=True, eq=False)
class Pointing(ByValue):
    """A cone in which the axis of the last link lies wherever the tip draws.

    The cone's axis runs from the tip to a target, or has a given direction, or one that
    changes along each side of the path from the direction of one corner to that of the
    next one, along the chord between their unit vectors.

    Args:
        cone: Largest angle between the link's axis and the cone's; [rad].
        target: Shape (3,); None where directions are given; [m].
        directions: Of the cone's axis, unit vectors, one for the whole path or one for
            each corner of it, shape (1 or m, 3); None where a target is given; [-].

    Raises:
        InvalidInput: If a value breaks its range, or not one of the two is given.
    """

    cone: float
    target: FloatArray | None = None
    directions: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays and check the values."""
        freeze(self, "target", "directions")
        check_numbers(self, "cone")
        if not 0.0 < self.cone < WIDEST:
            message = f"pointing cone is {self.cone} rad, expected above 0, below pi/2"
            raise InvalidInput(message)
        if (self.target is None) == (self.directions is None):
            message = "pointing needs a target or directions, one of the two"
            raise InvalidInput(message)
        target = self.target
        if target is not None and not (
            target.shape == (3,) and np.isfinite(target).all()
        ):
            message = "pointing target is not three finite numbers"
            raise InvalidInput(message)
        if self.directions is not None:
            sizes = np.linalg.norm(self.directions, axis=-1, keepdims=True)
            if not (np.isfinite(sizes).all() and (sizes > 0.0).all()):
                message = "a pointing direction has no length, or is not finite"
                raise InvalidInput(message)
            object.__setattr__(self, "directions", frozen(self.directions / sizes))

    def aims(
        self, corner_stations: FloatArray, tips: FloatArray, stations: FloatArray
    ) -> FloatArray:
        """Vectors along the cone's axis, linear along each side of the path.

        Args:
            corner_stations: Arc length at each corner of the path, shape (m,); [m].
            tips: Where the tip is on the path, shape (n, 3); [m].
            stations: Arc length along the path there, within it, shape (n,); [m].

        Returns:
            Shape (n, 3), of any length: to the target [m], or of unit vectors [-].
        """
        if self.target is not None:
            return np.asarray(self.target - tips)
        directions = self.directions
        assert directions is not None
        if len(directions) == 1:
            return np.broadcast_to(directions[0], tips.shape).copy()
        columns = [np.interp(stations, corner_stations, one) for one in directions.T]
        return np.stack(columns, axis=-1)

    def check_aims(self, corners: FloatArray) -> None:
        """Refuse aims that have no direction somewhere on a path.

        Args:
            corners: Of the path, the closing one included, shape (m, 3); [m].

        Raises:
            InvalidInput: If the target lies on the path, to the tolerance of the tip,
                or the directions at the ends of a side are opposite.
        """
        directions = self.directions
        if directions is not None and len(directions) == 1:
            return
        aims = directions if self.target is None else self.target - corners
        assert aims is not None
        shortest = _shortest(aims)
        side = int(np.argmin(shortest))
        if shortest[side] > TOLERANCES.tip_on_path:
            return
        message = (
            f"pointing has opposite directions at points {side + 1} and {side + 2}: "
            "between them none is meant"
            if self.target is None
            else "pointing has its target on the path: the tip there looks nowhere"
        )
        raise InvalidInput(message)


def _shortest(aims: FloatArray) -> FloatArray:
    """The least length of aims between each one and the next, (m, 3) to (m,)."""
    sides = np.diff(aims, axis=0, append=aims[-1:])
    squares = np.maximum((sides**2).sum(axis=1), np.finfo(float).tiny)
    part = np.clip(-(aims * sides).sum(axis=1) / squares, 0.0, 1.0)
    lengths = np.linalg.norm(aims + part[:, None] * sides, axis=1)
    return np.asarray(lengths)


@dataclass(frozen=True)
class AimError:
    """How much errors widen the angle between the last link and where it shall look.

    They turn the link by at most the sum of what they turn joints and base by. They
    move the tip by at most s, and that turns an aim of length d towards a target by at
    most s / (d - s).

    Args:
        axis: What the last link is turned by; [rad].
        tip: What joints and a displaced base move the tip by; [m].
        base_turn: What the base is turned by; [rad].
        length: Of the arm; [m].
        target: Whether aims are ways to a target, and not directions.
    """

    axis: float
    tip: float
    base_turn: float
    length: float
    target: bool

    @classmethod
    def of(cls, pointing: Pointing, arm: Manipulator, errors: ErrorBox) -> "AimError":
        """What an error box comes to."""
        turns = errors.turns(arm.n_links)
        levers = arm.total_length - arm.stations[:-1]
        return cls(
            float(turns.sum()) + errors.base_turn,
            errors.base + float(turns @ levers),
            errors.base_turn,
            arm.total_length,
            pointing.target is not None,
        )

    def widening(self, sizes: FloatArray, base: FloatArray) -> FloatArray:
        """The largest widening, at most pi, shape (n,); [rad].

        Args:
            sizes: Lengths of aims, shape (n,); [m].
            base: How far from its origin the base is on its rail, shape (n,); [m].
        """
        turned = np.zeros(len(sizes))
        if self.target:
            moved = self.tip + self.base_turn * (np.abs(base) + self.length)
            left = sizes - moved
            turned = np.where(
                left > 0.0, moved / np.where(left > 0.0, left, 1.0), np.pi
            )
        return np.asarray(np.minimum(self.axis + turned, np.pi))


@dataclass(frozen=True)
class LastLinkCone:
    """Where last links may look, errors included.

    Args:
        half_angle: Largest angle to the aim; [rad].
        error: How much errors widen it; None for no pointing at all.
    """

    half_angle: float = np.inf
    error: AimError | None = None

    def holds(self, base: FloatArray, axes: FloatArray, aims: FloatArray) -> BoolArray:
        """Whether arms look where they shall, shape (n,).

        Args:
            base: Of x0, shape (n,); [m].
            axes: Last links, shape (n, 3), of any length.
            aims: See `Pointing.aims`, NaN for anywhere, shape (n, 3).
        """
        off = angles_between(axes, aims)
        if self.error is not None:
            off = off + self.error.widening(np.linalg.norm(aims, axis=1), base)
        return np.asarray((off <= self.half_angle) | np.isnan(aims).any(axis=1))


ANYWHERE: Final = LastLinkCone()
"""No cone at all."""


def angles_between(one: FloatArray, other: FloatArray) -> FloatArray:
    """Angles between vectors of any length, shape (n, 3) each, to (n,); [rad].

    NaN where a vector has no length.
    """
    dots = (one * other).sum(axis=-1)
    crosses = np.linalg.norm(np.cross(one, other), axis=-1)
    angles = np.arctan2(crosses, dots)
    return np.asarray(np.where((crosses > 0.0) | (dots != 0.0), angles, np.nan))
