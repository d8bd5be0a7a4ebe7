"""Ways of the tip shortened, pulled to the middle of openings, and refined there.

An elastic band (Quinlan 1994): what it is worth counts the room between its points and
on the chords that an arm lays on it, and by how much more than the arm it bends. Moves
are tried by chance. Nothing is proved here.
"""

import itertools
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.tip_cells import LEAST, NARROW, TipRoom
from vdsm_pin.planner.spacing import spread
from vdsm_pin.problem.pointing import angles_between

SHORT_PULL: Final = (1, 3)
"""Times that a way is pulled from its beginning until an arm can follow it, and times
that stretches of all widths are moved."""
LONG_PULL: Final = (3, 16)
"""The same for ways that an arm has not followed."""
LITTLE: Final = 0.25
"""What a way must become worth more for another time; [-]."""
LITTLE_FOLLOWED: Final = 4.0
"""The same where an arm can follow it; [-]."""
LEAST_GAIN: Final = 1e-4
"""What a move must be worth; [-]."""
SHIFTS: Final = 8
"""Moves tried for each stretch in a round by chance."""
SIZES: Final = (0.5, 0.2, 0.1)
"""How far they go, round after round, over the body's radius or over what bends the arm
by `SWAY`; [-]."""
NARROW_SIZES: Final = (0.05, 0.02, 0.01)
"""The same where it is narrow; [-]."""
SWAY: Final = 0.4
"""Part of the largest link angle by which a move bends a way at most; [-]."""
ROOM: Final = 2.0
"""What a way is worth for all the room worth having at a point, and for that of the
chords there; [-]."""
DEEPEST: Final = -10.0
"""The least room, over what is worth having, that is told from less; [-]."""
STEEP: Final = 0.8
"""Part of the largest link angle that a way may bend by from chord to chord; [-]."""
STEEP_COST: Final = 10.0
"""What a way is worse for the square of the part of that angle it bends more; [-]."""
STEEPEST: Final = 0.95
"""The part that an arm surely follows; [-]."""
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


def refined(
    room: TipRoom,
    route: FloatArray,
    behind: FloatArray,
    effort: tuple[int, int] = SHORT_PULL,
) -> FloatArray:
    """A way with points so close, where it is narrow, that an arm can follow it.

    A way that bends as much as the arm can bows between two points at a distance h
    by h^2 / 8 R.

    Args:
        room: What the tip has to spare.
        route: Shape (k, 3); [m].
        behind: As `pulled` has it.
        effort: As `pulled` has it.
    """
    spare = np.maximum(room.spare(route), LEAST * room.arm.most_radius)
    radius = room.arm.link_lengths.max() / (2.0 * np.sin(room.arm.max_link_angle / 2.0))
    step = np.sqrt(8.0 * radius * BOW * np.minimum(spare[:-1], spare[1:]))
    sides = np.linalg.norm(np.diff(route, axis=0), axis=1)
    counts = np.maximum(1, np.ceil(sides / step).astype(np.int64))
    at, share = spread(counts)
    part = share[:, None]
    route = (1.0 - part) * route[at] + part * route[at + 1]
    return pulled(room, route, behind, NARROW_SIZES, effort)


def pulled(
    room: TipRoom,
    route: FloatArray,
    behind: FloatArray,
    sizes: tuple[float, ...] = SIZES,
    effort: tuple[int, int] = SHORT_PULL,
) -> FloatArray:
    """A way straightened, and in the middle where it is narrow (elastic band).

    Long stretches are moved first, then shorter and shorter ones. What is clear between
    two of its points stays so.

    Args:
        room: What the tip has to spare.
        route: Shape (k, 3), its ends stay; [m].
        behind: What the arm lies on behind the way, from its end on, shape (b, 3); [m].
        sizes: How far stretches are moved, see `SIZES`; [-].
        effort: `SHORT_PULL` or `LONG_PULL`.
    """
    if len(route) < 3:
        return route
    rng, band = np.random.default_rng(len(route)), _Band(room, behind)
    widest = len(route) // 2 if sizes is SIZES else 2
    widths = [widest >> k for k in range(widest.bit_length() + 1)]
    own = best = band.way(route)
    tries, passes = effort
    for _ in range(0 if sizes is NARROW_SIZES and own.sound else tries):
        way, before = own, -np.inf
        for _ in range(passes):
            for width, size in itertools.product(widths, sizes):
                way = band.moved(way, width, size, rng)
            if way.total < before + (LITTLE_FOLLOWED if way.sound else LITTLE):
                break
            before = way.total
        best = way if way.total > best.total else best
        if best.sound:
            break
    return best.points


def is_followed(room: TipRoom, route: FloatArray, behind: FloatArray) -> bool:
    """Whether an arm can follow a way, see `pulled`."""
    return _Band(room, behind).way(route).sound


class _Lines(NamedTuple):
    """Lines measured, one for each place of a way or of each of several ways.

    Args:
        begins: Shape (..., k, 3); [m].
        ends: Shape (..., k, 3); [m].
        spare: Room over what is worth having, from `DEEPEST` to 1, shape (..., k); [-].
    """

    begins: FloatArray
    ends: FloatArray
    spare: FloatArray


class _Way(NamedTuple):
    """A way and what it is worth.

    Args:
        points: Shape (n, 3); [m].
        worth: At each point, shape (1, n); [-].
        blocked: Whether it is blocked between its points, shape (1, n - 1).
        kept: Whether an arm can lie on it at each point, shape (1, n).
        measured: Its lines, the chords to its points and from them, shape (1, k) each.
    """

    points: FloatArray
    worth: FloatArray
    blocked: BoolArray
    kept: BoolArray
    measured: tuple[_Lines, ...]

    @property
    def total(self) -> float:
        """What it is worth; [-]."""
        return float(self.worth.sum())

    @property
    def sound(self) -> bool:
        """Whether an arm can follow it."""
        return bool(self.kept.all() and not self.blocked.any())


class _Band:
    """Ways pulled at.

    Args:
        room: What the tip has to spare.
        behind: What the arm lies on behind them; [m].
    """

    def __init__(self, room: TipRoom, behind: FloatArray) -> None:
        self.room, self.arm = room.near, room.arm
        link = float(self.arm.link_lengths.max())
        self.behind = behind[::-1]
        self.wanted, self.link = NARROW * self.arm.most_radius, link

    def moved(
        self, way: _Way, width: int, size: float, rng: np.random.Generator
    ) -> _Way:
        """A way with stretches moved to the best of some places.

        Args:
            way: The way.
            width: Half the stretches' width, in points.
            size: How far they go, see `SIZES`.
            rng: Source of chance.
        """
        route, n = way.points, len(way.points)
        sides = np.linalg.norm(np.diff(route, axis=0), axis=1)
        # Beside a stretch nothing moves as far as chords reach.
        reach = int(np.ceil(self.link / float(sides.mean())))
        period = 2 * (width + reach) + 2
        offset = np.arange(n) - 1 - int(rng.integers(period))
        owner, place = offset // period + 1, offset % period - width - reach
        bump = np.cos(np.pi * place / (2 * width + 2)) ** 2
        bump[np.abs(place) > width] = 0.0
        bump[[0, -1]] = 0.0
        far = self._far(float(sides.mean()) * (width + 1.0))
        shifts = rng.normal(size=(SHIFTS, owner[-1] + 1, 3)) * far
        tried = route + (size * bump)[:, None] * shifts[:, owner]
        before = route[np.maximum(np.arange(n) - width - 1, 0)]
        ahead = route[np.minimum(np.arange(n) + width + 1, n - 1)]
        towards = bump[:, None] * ((before + ahead) / 2.0 - route)
        others = [route + 0.5 * towards, route + towards, route]
        tried = np.concatenate([tried, others])
        worth, blocked, *_ = self._worth(tried, way.measured)
        better, shut = worth - worth[-1], blocked & ~way.blocked
        better[:, 1:] = np.where(shut, -np.inf, better[:, 1:])
        better[:, :-1] = np.where(shut, -np.inf, better[:, :-1])
        begins = np.flatnonzero(np.append(True, owner[1:] != owner[:-1]))
        gain = np.add.reduceat(better, begins, axis=1)
        best, number = gain.argmax(axis=0), owner - owner[0]
        good = (gain.max(axis=0) > LEAST_GAIN)[number]
        for chosen in (good, good & (owner % 2 == 0), good & (owner % 2 == 1)):
            new = np.where(chosen[:, None], tried[best[number], np.arange(n)], route)
            now = self.way(new, way)
            if not (now.blocked & ~way.blocked).any() and now.total > way.total:
                return now
        return way

    def _far(self, half: float) -> float:
        """How far stretches so wide may go to bend a way by `SWAY` at most; [m]."""
        bent = SWAY * self.arm.max_link_angle * half**2 / self.link
        return max(self.arm.most_radius, min(bent, half))

    def way(self, points: FloatArray, before: _Way | None = None) -> _Way:
        """A way, shape (n, 3), and what it is worth; before it is one much like it."""
        known = (None,) * 3 if before is None else before.measured
        return _Way(points, *self._worth(points[None], known))

    def _worth(
        self, routes: FloatArray, known: Sequence[_Lines | None]
    ) -> tuple[FloatArray, BoolArray, BoolArray, tuple[_Lines, ...]]:
        """What `_Way` has of ways, shape (c, n, 3), the last one much like a known one.

        An arm that follows a way lays its links as chords on it, which bow to the
        inside of a bend: a place is the better the more room the chords have that end
        there, and the less one turns against the other.
        """
        count, n = routes.shape[:2]
        along = self._measured(routes[:, :-1], routes[:, 1:], known[0])
        lines = along.spare
        wide = np.ones((count, n))
        wide[:, 1:] = np.minimum(wide[:, 1:], lines)
        wide[:, :-1] = np.minimum(wide[:, :-1], lines)
        head = np.broadcast_to(self.behind, (count, *self.behind.shape))
        every, k = np.concatenate([head, routes], axis=1), len(self.behind)
        back, ahead = _chords(self.arm, every[-1], np.arange(k, k + n))
        own, first, last = routes, every[:, back], every[:, ahead]
        before = self._measured(first, own, known[1])
        after = self._measured(own, last, known[2])
        chords = np.minimum(before.spare, after.spare)
        turn = angles_between(own - first, last - own) / self.arm.max_link_angle
        # At the end nothing is ahead.
        steep = np.where(turn > STEEP, turn - STEEP, 0.0)
        middle = (every[:, k - 1 : k + n - 2] + routes[:, 1:]) / 2.0
        off = np.linalg.norm(own[:, :-1] - middle, axis=2) / self.arm.most_radius
        worth = np.where(wide > 0.0, wide, 5.0 * (wide - 1.0))
        # The first bit of room counts most.
        some, none = 1.0 - (1.0 - chords) ** 4, 10.0 * np.maximum(chords, -1.0)
        worth += np.where(chords > 0.0, some, none)
        worth = ROOM * worth - STEEP_COST * steep**2
        worth[:, :-1] -= off
        kept = ~(turn > STEEPEST) & (chords >= 0.0)
        return worth, lines < 0.0, kept, (along, before, after)

    def _measured(
        self, begins: FloatArray, ends: FloatArray, known: _Lines | None
    ) -> _Lines:
        """Lines of ways, shape (c, k, 3) each; those that are known not once more."""
        spare = np.zeros(begins.shape[:2])
        fresh = np.ones(spare.shape, dtype=np.bool_)
        if known is not None:
            spare[:] = known.spare
            fresh = (begins != known.begins).any(axis=2)
            fresh |= (ends != known.ends).any(axis=2)
        if fresh.any():
            room = self.room.spare(begins[fresh], ends[fresh])
            spare[fresh] = np.clip(room / self.wanted, DEEPEST, 1.0)
        return _Lines(begins, ends, spare)


def _chords(
    arm: Manipulator, route: FloatArray, inner: IntArray
) -> tuple[IntArray, IntArray]:
    """Points of a way a link before and behind others, shape (n,) each.

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
    return first, last


def resampled(route: FloatArray, spacing: float) -> FloatArray:
    """Points along a polyline, evenly at most `spacing` apart, ends kept; [m]."""
    route = route[np.append(True, np.linalg.norm(np.diff(route, axis=0), axis=1) > 0.0)]
    if len(route) < 2:
        return route
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(route, axis=0), axis=1)))
    marks = np.linspace(0.0, along[-1], 1 + max(1, int(np.ceil(along[-1] / spacing))))
    return np.stack([np.interp(marks, along, column) for column in route.T], axis=1)
