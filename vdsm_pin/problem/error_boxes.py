"""How far a real motion, its base and its obstacles may be off what was asked about."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import zip_longest
from numbers import Real
from types import MappingProxyType
from typing import Any, Final, TypeVar

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, called, check_numbers, frozen, number
from vdsm_pin.notebook import Summarised
from vdsm_pin.units import MM_PER_M, quantity

JointErrors = tuple[tuple[float, float], ...]

NOTHING: Final[Mapping[str, float]] = MappingProxyType({})
"""No error of a single obstacle or joint."""


@dataclass(frozen=True)
class ObstacleError:
    """How far one obstacle may be off.

    Args:
        name: The obstacle's.
        shift: In any direction; [m].
        turn: About any axis through its middle; [rad].
    """

    name: str
    shift: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True)
class JointError:
    """How far one joint of a robot may be off.

    Args:
        name: The joint's.
        turn: Error of a joint that turns; [rad].
        shift: Error of a joint that slides; [m].
    """

    name: str
    turn: float = 0.0
    shift: float = 0.0


_Named = TypeVar("_Named", ObstacleError, JointError)


@dataclass(frozen=True, eq=False, repr=False)
class ErrorBox(Summarised):
    """How far the real motion may stray from the nominal one.

    Args:
        joint: Error of every theta_i and alpha_i, or of every joint of a robot that
            turns, at most; [rad].
        base: Largest displacement of the base in any direction, and so of x0; [m].
        obstacle: Largest displacement of an obstacle surface; [m].
        base_turn: Largest rotation of the base about its origin; [rad].
        joints: Errors of alpha_i and theta_i by joint, of the first joints at least;
            where they are larger than `joint` they count; [rad].
        obstacles: Errors of single obstacles, each kept once, the larger ones; the
            larger shift of these and `obstacle` counts.
        slide: Error of every joint of a robot that slides; [m].
        named: Errors of single joints of a robot, each kept once; the larger counts.

    Raises:
        InvalidInput: If a value is negative or not finite.
    """

    joint: float = 0.0
    base: float = 0.0
    obstacle: float = 0.0
    base_turn: float = 0.0
    joints: JointErrors = ()
    obstacles: tuple[ObstacleError, ...] = ()
    slide: float = 0.0
    named: tuple[JointError, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what is no error."""
        for field in ("joints", "obstacles", "named"):
            object.__setattr__(self, field, tuple(getattr(self, field)))
        check_numbers(self, *PLAIN)
        values = [("joint", e, "rad") for pair in self.joints for e in pair]
        for o in self.obstacles:
            values += [("obstacle", o.shift, "m"), ("obstacle", o.turn, "rad")]
        for j in self.named:
            values += [(repr(j.name), j.shift, "m"), (repr(j.name), j.turn, "rad")]
        values += [(name, getattr(self, name), unit) for name, unit in PLAIN.items()]
        for name, value, unit in values:
            if not (isinstance(value, Real) and 0.0 <= value < np.inf):
                found = f"{value:.6g} {unit}" if isinstance(value, Real) else value
                what = f"{name.replace('_', ' ')} error is {found}"
                message = f"{what}, expected 0 or more"
                raise InvalidInput(message)
        for field in ("obstacles", "named"):
            object.__setattr__(self, field, _largest(getattr(self, field)))

    def __eq__(self, other: object) -> bool:
        """Whether the errors are the same, in whatever units they were stated."""
        return isinstance(other, ErrorBox) and self._values == other._values

    def __hash__(self) -> int:
        """Hash of the errors."""
        return hash(self._values)

    @property
    def _values(self) -> tuple[object, ...]:
        return tuple(getattr(self, one.name) for one in fields(ErrorBox))

    def summary(self) -> tuple[tuple[str, str], ...]:
        """What may be off, and how far."""
        plain = {
            "every joint angle": (self.joint, "rad"),
            "every slide": (self.slide, "m"),
            "base": (self.base, "m"),
            "turn of the base": (self.base_turn, "rad"),
            "every obstacle": (self.obstacle, "m"),
        }
        rows = {name: quantity(*one) for name, one in plain.items() if one[0]}
        for i, (alpha, theta) in enumerate(self.joints, 1):
            rows[f"joint {i}"] = quantity(max(alpha, theta), "rad")
        single: list[ObstacleError | JointError] = [*self.obstacles, *self.named]
        for one in single:
            both = [(one.shift, "m"), (one.turn, "rad")]
            rows[one.name] = " and ".join(quantity(*o) for o in both if o[0])
        return tuple(rows.items()) or (("errors", "none"),)

    def with_joint(self, joint: float) -> "ErrorBox":
        """A copy with one error of all joint angles; [rad]."""
        return replace(self.widened(ErrorBox()), joint=joint, joints=())

    def angles(self, n_links: int) -> FloatArray:
        """Largest errors of alpha_i and theta_i, shape (N, 2); [rad].

        Raises:
            InvalidInput: If the box has what only other robots have.
        """
        if self.slide or self.named:
            message = (
                "joints of a snake arm are numbered and slide by the base alone: "
                "expected one joint error, or one for each joint from the base"
            )
            raise InvalidInput(message)
        errors = np.full((n_links, 2), self.joint)
        given = np.array(self.joints[:n_links]).reshape(-1, 2)
        errors[: len(given)] = np.maximum(errors[: len(given)], given)
        return errors

    def turns(self, n_links: int) -> FloatArray:
        """Largest angle by which errors turn each link against the one before it.

        Errors a of alpha and b of theta turn it about axes at right angles: by t in
        all, with cos(t / 2) = cos(a / 2) cos(b / 2).

        Returns:
            Shape (N,); [rad].
        """
        halves = np.minimum(self.angles(n_links), np.pi) / 2.0
        a, b = np.sin(halves).T
        return np.asarray(
            2.0 * np.arcsin(np.minimum(np.hypot(a, b * np.sqrt(1.0 - a * a)), 1.0))
        )

    def of_obstacle(self, name: str) -> ObstacleError:
        """How far an obstacle may be off."""
        mine = {one.name: one for one in self.obstacles}
        own = mine.get(name, ObstacleError(name))
        return replace(own, shift=max(self.obstacle, own.shift))

    def widened(self, other: "ErrorBox") -> "ErrorBox":
        """The least box that holds this one and another."""
        nothing = (0.0, 0.0)
        both = zip_longest(self.joints, other.joints, fillvalue=nothing)
        plain = {name: max(getattr(self, name), getattr(other, name)) for name in PLAIN}
        return ErrorBox(
            **plain,
            joints=tuple((max(a[0], b[0]), max(a[1], b[1])) for a, b in both),
            obstacles=(*self.obstacles, *other.obstacles),
            named=(*self.named, *other.named),
        )


def _largest(errors: Sequence[_Named]) -> tuple[_Named, ...]:
    """Each name once, with the largest shift and turn that are stated of it."""
    largest: dict[str, _Named] = {}
    for one in errors:
        known = largest.get(one.name, one)
        shift, turn = max(known.shift, one.shift), max(known.turn, one.turn)
        largest[one.name] = replace(one, shift=shift, turn=turn)
    return tuple(largest.values())


PLAIN: Final[Mapping[str, str]] = MappingProxyType(
    {"joint": "rad", "base": "m", "obstacle": "m", "base_turn": "rad", "slide": "m"}
)
"""The errors that are one number, with their units."""

NO_ERRORS: Final = ErrorBox()
"""The motion itself."""


class TypedErrorBox(ErrorBox):
    """How far the real motion may stray from the nominal one, as people state it.

    Args:
        joint_deg: Largest error of every joint angle, or one for each joint from the
            base, or of a robot's joints by name; [deg].
        base_mm: Largest displacement of the base in any direction; [mm].
        base_deg: Largest turn of the base about its origin; [deg].
        obstacle_mm: Largest displacement of an obstacle's surface; [mm].
        obstacles_mm: That of single obstacles by their names; [mm].
        obstacles_deg: Their largest turns, about their middles; [deg].
        slide_mm: Of every joint of a robot that slides, or of some by name; [mm].

    Raises:
        InvalidInput: If a value is negative or not finite.

    Example:
        >>> from vdsm_pin import ErrorBox
        >>> ErrorBox(base_mm=2.0).base
        0.002
        >>> ErrorBox(obstacles_mm={"crate": 5.0}).of_obstacle("crate").shift
        0.005
    """

    def __init__(
        self,
        *,
        joint_deg: float | Sequence[float] | Mapping[str, float] = 0.0,
        base_mm: float = 0.0,
        base_deg: float = 0.0,
        obstacle_mm: float = 0.0,
        obstacles_mm: Mapping[str, float] = NOTHING,
        obstacles_deg: Mapping[str, float] = NOTHING,
        slide_mm: float | Mapping[str, float] = 0.0,
    ) -> None:
        """The box in radians and metres."""
        joint = _by_name if isinstance(joint_deg, Mapping) else _numbers
        slide = _by_name if isinstance(slide_mm, Mapping) else _plain
        away = _by_name("obstacles_mm", obstacles_mm)
        turned = _by_name("obstacles_deg", obstacles_deg)
        fields = in_si(
            MM_PER_M,
            joint_deg=joint("joint_deg", joint_deg),
            slide=slide("slide_mm", slide_mm),
            base=_plain("base_mm", base_mm),
            base_deg=_plain("base_deg", base_deg),
            obstacle=_plain("obstacle_mm", obstacle_mm),
            obstacles=[
                (name, away.get(name, 0.0), turned.get(name, 0.0))
                for name in dict.fromkeys((*away, *turned))
            ],
        )
        super().__init__(**fields)

    # What Python says of wrong arguments begins with this name.
    __init__.__qualname__ = "ErrorBox"


def in_si(
    per_metre: float,
    *,
    joint_deg: float | Sequence[float] | Mapping[str, float],
    slide: float | Mapping[str, float],
    base: float,
    base_deg: float,
    obstacle: float,
    obstacles: Sequence[tuple[str, float, float]],
) -> dict[str, Any]:
    """The fields of an error box from degrees and lengths in some unit.

    Args:
        per_metre: Of that unit.
        joint_deg: Of every joint angle, of each from the base, or of some by name.
        slide: Of every joint that slides, or of some by name.
        base: Displacement of the base.
        base_deg: Its turn.
        obstacle: Displacement of every obstacle's surface.
        obstacles: Names, shifts and turns of single ones; the turns in degrees.
    """
    turns = joint_deg if isinstance(joint_deg, Mapping) else NOTHING
    shifts = slide if isinstance(slide, Mapping) else NOTHING
    each = joint_deg if isinstance(joint_deg, Sequence) else ()
    plain = 0.0 if isinstance(joint_deg, Mapping | Sequence) else joint_deg
    return {
        "joint": float(np.deg2rad(plain)),
        "base": base / per_metre,
        "obstacle": obstacle / per_metre,
        "base_turn": float(np.deg2rad(base_deg)),
        "joints": tuple((error, error) for error in np.deg2rad(each).tolist()),
        "obstacles": tuple(
            ObstacleError(name, shift / per_metre, float(np.deg2rad(turn)))
            for name, shift, turn in obstacles
        ),
        "slide": 0.0 if isinstance(slide, Mapping) else slide / per_metre,
        "named": tuple(
            JointError(
                name,
                float(np.deg2rad(turns.get(name, 0.0))),
                shifts.get(name, 0.0) / per_metre,
            )
            for name in dict.fromkeys((*turns, *shifts))
        ),
    }


def _numbers(name: str, value: object) -> Any:
    """One number, or a list of them."""
    with called(f"ErrorBox: {name}"):
        return frozen(value).tolist()


def _plain(name: str, value: object) -> float:
    with called(f"ErrorBox: {name}"):
        return number(value)


def _by_name(name: str, values: object) -> dict[str, float]:
    if not isinstance(values, Mapping):
        message = f"ErrorBox: {name} is {values!r}, expected numbers by name"
        raise InvalidInput(message)
    return {key: _plain(f"{name}[{key!r}]", value) for key, value in values.items()}
