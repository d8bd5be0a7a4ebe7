"""Why a pair of bodies cannot be pushed apart where a repair ends.

At the place where the last attempt is worst, the slope of the pair's clearance is
looked at: what of it the limits, the tip's path and the other pairs leave.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray

LITTLE: Final = 0.05
"""Part of a slope that is as good as none; [-]."""

FLAT: Final = 1e-6
"""Slope that is rounding; [m/rad], [-]."""

AT_LIMIT: Final = 1e-6
"""So near to its limit a joint is at it; [rad], [m]."""

AGAINST: Final = -0.2
"""Cosine of two slopes below which one pair's way apart leads another one nearer."""


class Limit(NamedTuple):
    """A limit that a row is at.

    Args:
        name: Of the joint or joints.
        outwards: Unit vector beyond the limit, shape (n_columns,); [-].
    """

    name: str
    outwards: FloatArray


class Place(NamedTuple):
    """The row at which pairs are too near.

    Args:
        names: Of the pairs.
        room: What they have beyond what they are to get, shape (n_pairs,); [m].
        slopes: How it grows with comparable joint values, (n_pairs, n_columns).
        limits: Those that the row is at.
        held: The part of a slope that keeps the tip where it draws; None where it may
            go anywhere.
    """

    names: Sequence[str]
    room: FloatArray
    slopes: FloatArray
    limits: Sequence[Limit]
    held: Callable[[FloatArray], FloatArray] | None = None


def end_limits(q: FloatArray, ends: FloatArray, names: Sequence[str]) -> list[Limit]:
    """The ends of ranges, shape (n_columns, 2), that a row is at."""
    found, axes = [], np.eye(len(q))
    for k, name in enumerate(names):
        for sign, end in ((-1.0, ends[k, 0]), (1.0, ends[k, 1])):
            if sign * (q[k] - end) >= -AT_LIMIT:
                found.append(Limit(name, sign * axes[k]))
    return found


def _left(place: Place, k: int) -> tuple[FloatArray, list[str]]:
    """What the limits leave of a pair's slope, and the names of those in its way."""
    slope, blocking = place.slopes[k], list[str]()
    size = float(np.linalg.norm(slope))
    for name, outwards in place.limits:
        beyond = float(outwards @ slope)
        if beyond > LITTLE * size:
            slope = slope - beyond * outwards
            blocking.append(name)
    return slope, [*dict.fromkeys(blocking)]


def cause(place: Place, k: int, beside: Sequence[Place] = ()) -> str:
    """What stops a pair from being pushed apart, in words.

    Args:
        place: Where it is too near.
        k: The pair.
        beside: The rows before and after, where it is between two.
    """
    size = float(np.linalg.norm(place.slopes[k]))
    if not size > FLAT:
        return "no joint moves them apart there"
    slope, blocking = _left(place, k)
    left, names = float(np.linalg.norm(slope)), ", ".join(blocking)
    if not left > LITTLE * size:
        return f"only beyond the limit of {names} would they come apart"
    limits = f"with {names} at the limit " if blocking else ""
    if place.held is not None:
        slope = place.held(slope)
        if not float(np.linalg.norm(slope)) > LITTLE * left:
            return f"{limits}the tip is held on its path there"
    for other in np.argsort(place.room, kind="stable").tolist():
        if other != k and place.room[other] < abs(float(place.room[k])):
            if _oppose(place.slopes[other], slope):
                against = place.names[other]
                return f"{limits}what moves them apart brings {against} together"
    if len(beside) == 2 and _oppose(*(_left(row, k)[0] for row in beside)):
        return f"{limits}the rows before and after are pushed to different sides"
    return f"{limits}small changes gain too little there"


def _oppose(one: FloatArray, other: FloatArray) -> bool:
    """Whether what goes up one slope goes down the other one."""
    both = float(np.linalg.norm(one) * np.linalg.norm(other))
    return both > 0.0 and float(one @ other) < AGAINST * both
