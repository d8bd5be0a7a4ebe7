"""Ways of the tip shortened, pulled to the middle of openings, and refined there.

An elastic band (Quinlan 1994): what it is worth counts the room at its points, and that
of the chords which an arm lays on it. Nothing is proved here.
"""

from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.tip_room import LEAST, NARROW, TipRoom
from vdsm_pin.planner.spacing import spread
from vdsm_pin.problem.pointing import angles_between

PULLS: Final = 30
"""Rounds of pulling a way to the middle of its openings."""
SHIFTS: Final = 8
"""Places tried for each point in a round by chance."""
SIZES: Final = (0.5, 0.2, 0.1)
"""How far away they are, round after round, over the body's radius; [-]."""
FINER: Final = (0.05, 0.02, 0.01)
"""The same where it is narrow; [-]."""
CHORDS: Final = 2.0
"""What a way is worth more for chords with all the room that is worth having; [-]."""
STEEP: Final = 0.85
"""Part of the largest link angle that a way may bend by from chord to chord; [-]."""
STEEP_COST: Final = 4.0
"""What a way is worse for each part of that angle that it bends more; [-]."""
BOW: Final = 0.2
"""Part of the room of a narrow place that the way between two points may bow; [-]."""


def shortened(room: TipRoom, route: FloatArray) -> FloatArray:
    """A way with corners cut where that leaves as much room as is worth having.

    Args:
        room: What the tip has to spare.
        route: Shape (k, 3); [m].
    """
    worth, room = NARROW * room.arm.most_radius, room.near
    own = np.minimum(room.spare(route[:-1], route[1:]), worth)
    kept, last = [0], len(route) - 1
    while kept[-1] < last:
        at = kept[-1]
        begins = np.broadcast_to(route[at], (last - at, 3))
        spare = room.spare(begins, route[at + 1 :])
        good = spare >= np.maximum(np.minimum.accumulate(own[at:]), 0.0)
        kept.append(at + 1 + int(np.flatnonzero(good).max(initial=0)))
    return route[kept]


def refined(room: TipRoom, route: FloatArray) -> FloatArray:
    """A way with points so close, where it is narrow, that an arm can follow it.

    A way that bends as much as the arm can bows between two points at a distance h
    by h^2 / 8 R.

    Args:
        room: What the tip has to spare.
        route: Shape (k, 3); [m].
    """
    spare = np.maximum(room.spare(route), LEAST * room.arm.most_radius)
    radius = room.arm.link_lengths.max() / (2.0 * np.sin(room.arm.max_link_angle / 2.0))
    step = np.sqrt(8.0 * radius * BOW * np.minimum(spare[:-1], spare[1:]))
    sides = np.linalg.norm(np.diff(route, axis=0), axis=1)
    counts = np.maximum(1, np.ceil(sides / step).astype(np.int64))
    if (counts == 1).all():
        return route
    at, share = spread(counts)
    part = share[:, None]
    return pulled(room, (1.0 - part) * route[at] + part * route[at + 1], FINER)


def pulled(
    room: TipRoom, route: FloatArray, sizes: tuple[float, ...] = SIZES
) -> FloatArray:
    """A way straightened, and in the middle where it is narrow (elastic band).

    Args:
        room: What the tip has to spare.
        route: Shape (k, 3), its ends stay; [m].
        sizes: How far away places are tried, over the body's radius; [-].
    """
    rng, route, room = np.random.default_rng(len(route)), route.copy(), room.near
    for round_ in range(PULLS):
        size = room.arm.most_radius * sizes[round_ % len(sizes)]
        for parity in (1, 2):
            inner = np.arange(parity, len(route) - 1, 2)
            if len(inner):
                shifts = rng.normal(size=(len(inner), SHIFTS, 3)) * size
                route[inner] = _better(room, route, inner, shifts)
    return route


def _better(
    room: TipRoom, route: FloatArray, inner: IntArray, shifts: FloatArray
) -> FloatArray:
    """The best of some places for every other point of a way, shape (n, 3).

    An arm that follows a way lays its links as chords on it, which bow to the
    inside of a bend: a place is the better the more room the chords have that end
    there, and the less one turns against the other. Room is asked for only where it
    can make a place better than those before.
    """
    middle = (route[inner - 1] + route[inner + 1])[:, None] / 2.0
    own, radius = route[inner][:, None], room.arm.most_radius
    tried = np.concatenate([own, (own + middle) / 2.0, middle, own + shifts], 1)
    back, ahead = (ends[:, None] for ends in _chords(room.arm, route, inner))
    turn = angles_between(tried - back, ahead - tried)
    steep = np.maximum(0.0, turn / room.arm.max_link_angle - STEEP)
    cost = np.linalg.norm(tried - middle, axis=2) / radius + STEEP_COST * steep
    best, least = np.zeros(len(inner), np.int64), np.full(len(inner), -np.inf)
    for columns in (slice(0, 1), slice(1, 3), slice(3, None)):
        score = np.full(cost.shape, -np.inf)
        some = cost[:, columns] < (2.0 + CHORDS - least)[:, None]
        row, column = np.nonzero(some)
        column += columns.start
        score[row, column] = _room_worth(
            room, tried[row, column], back[row, 0], ahead[row, 0],
            least[row] + cost[row, column],
        ) - cost[row, column]  # fmt: skip
        first = score.argmax(axis=1)
        highest = score[np.arange(len(inner)), first]
        best = np.where(highest > least, first, best)
        least = np.maximum(highest, least)
    return np.asarray(tried[np.arange(len(inner)), best])


def _room_worth(
    room: TipRoom,
    places: FloatArray,
    back: FloatArray,
    ahead: FloatArray,
    least: FloatArray,
) -> FloatArray:
    """What the room at places and on their chords is worth, 2 + CHORDS at most; [-].

    Args:
        room: What the tip has to spare.
        places: Shape (n, 3); [m].
        back: Where the chord behind each begins; [m].
        ahead: Where the chord ahead of each ends; [m].
        least: A worth up to which -inf will do, shape (n,); [-].
    """
    wide = room.spare(places) / (NARROW * room.arm.most_radius)
    wide = np.minimum(wide, 1.0)
    worth = np.where(wide > 0.0, 2.0 * wide, 10.0 * (wide - 1.0))
    chords = np.ones(len(places))
    for ends in (back, ahead):
        asked = np.flatnonzero(worth + CHORDS * chords > least)
        spare = room.spare(places[asked], ends[asked])
        spare = np.clip(spare / (NARROW * room.arm.most_radius), -1.0, 1.0)
        chords[asked] = np.minimum(chords[asked], spare)
    worth = worth + CHORDS * chords
    return np.where(worth > least, worth, -np.inf)


def _chords(
    arm: Manipulator, route: FloatArray, inner: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Points of a way a link before and behind others, shape (n, 3) each; [m].

    The link is the longest that passes there on the way.
    """
    sides = np.linalg.norm(np.diff(route, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(sides))
    back = arm.link_lengths[::-1]
    behind = np.append(0.0, np.cumsum(back)[:-1])
    at = along[inner]
    passing = np.searchsorted(behind, along[-1] - at, side="right") - 1
    link = np.maximum.accumulate(back)[passing]
    first = np.minimum(np.searchsorted(along, at - link), inner - 1)
    last = np.clip(np.searchsorted(along, at + link), inner + 1, len(route) - 1)
    return route[first], route[last]


def resampled(route: FloatArray, spacing: float) -> FloatArray:
    """Points along a polyline, evenly at most `spacing` apart, ends kept; [m]."""
    route = route[np.append(True, np.linalg.norm(np.diff(route, axis=0), axis=1) > 0.0)]
    if len(route) < 2:
        return route
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(route, axis=0), axis=1)))
    marks = np.linspace(0.0, along[-1], 1 + max(1, int(np.ceil(along[-1] / spacing))))
    return np.stack([np.interp(marks, along, column) for column in route.T], axis=1)
