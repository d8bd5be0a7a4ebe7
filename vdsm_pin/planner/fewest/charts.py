"""The two charts of configurations: how shapes are told, and lines in them run.

Offsets of the joints' projections hold arms whose links lean ahead, directions of the
links hold all.
"""

from dataclasses import dataclass, fields
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.direction_kernels import (
    lined_up_directions,
    mutated_directions,
    placed_between,
)
from vdsm_pin.planner.fewest.offset_kernels import (
    SCALES,
    Lines,
    centres_between,
    knees_between,
    lined_up,
    mutated_offsets,
)
from vdsm_pin.tolerances import TOLERANCES

TURNS: Final = (0.02, 0.08, 0.25)
"""Sizes of a turn of links; [rad]."""


class Offsets:
    """D_1..D_{N+1} of the joints' projections, shape (n, N + 1, 2); [m]."""

    keeps_rail: Final = False
    """Whether an arm has its base on the rail, or is none."""

    def coordinates(self, arm: Manipulator, centres: FloatArray) -> FloatArray:
        """Those of arms by their joint centres, shape (n, N + 1, 3); [m]."""
        offsets = centres[:, :, 1:] - arm.ratios[:, None] * centres[:, -1:, 1:]
        offsets[:, [0, -1]] = 0.0
        return np.asarray(offsets)

    def centres(
        self, arm: Manipulator, lines: Lines, interval: IntArray, share: FloatArray
    ) -> FloatArray:
        """Joint centres at places of lines; see `Intervals.centres`."""
        return centres_between(lines, interval, share, arm.ratios, arm.link_lengths)

    def knees(self, arm: Manipulator, lines: Lines) -> BoolArray:
        """Joints where arms may bend on lines; see `Intervals.knees`."""
        straight = TOLERANCES.straight_slope
        return knees_between(
            lines.offsets, lines.next_offsets, arm.link_lengths, straight
        )

    def unit(self, arm: Manipulator) -> float:
        """Way of the tip that one of the coordinates counts for; [m] over its unit."""
        return 1.0

    def mutated(
        self,
        arm: Manipulator,
        shapes: FloatArray,
        moved: FloatArray,
        rng: np.random.Generator,
    ) -> FloatArray:
        """Children of arms, one each; see `mutated_offsets`.

        Args:
            arm: The arm.
            shapes: Their shape coordinates.
            moved: How far the tip has moved across the rail since, shape (n, 2); [m].
            rng: Source of chance.
        """
        n = len(shapes)
        scale = rng.choice(np.array(SCALES), n) * arm.total_length
        shift = rng.normal(size=(n, 2)) * scale[:, None]
        joint, kind = rng.random((2, n))
        return mutated_offsets(shapes, arm.stations, moved, joint, kind, shift)

    def settled(
        self, arm: Manipulator, tips: FloatArray, shapes: FloatArray
    ) -> FloatArray:
        """The coordinates with the base brought onto its rail, if it can be."""
        return shapes

    def in_line(
        self,
        arm: Manipulator,
        tips: FloatArray,
        shapes: FloatArray,
        joint: int,
        way: int,
    ) -> FloatArray:
        """Arms with one joint straight.

        Args:
            arm: The arm.
            tips: Where they stay, shape (n, 3); [m].
            shapes: Their shape coordinates.
            joint: The joint, counted from 0.
            way: 0 puts it in line between the bent joints before and after it. With 1
                the piece before it goes on to the next bent joint, which moves; with -1
                the piece after it goes back to the one before. Where that is an end of
                the arm, or the joint is straight, nothing changes.
        """
        return lined_up(shapes, arm.stations, joint, way)


class Directions:
    """Directions of the links, which may lean any way, shape (n, N, 3); [-]."""

    keeps_rail: Final = True

    def coordinates(self, arm: Manipulator, centres: FloatArray) -> FloatArray:
        """See `Offsets`."""
        return np.asarray(np.diff(centres, axis=1) / arm.link_lengths[:, None])

    def centres(
        self, arm: Manipulator, lines: Lines, interval: IntArray, share: FloatArray
    ) -> FloatArray:
        """See `Offsets`."""
        return placed_between(lines, interval, share, arm.link_lengths, arm.base_range)

    def knees(self, arm: Manipulator, lines: Lines) -> BoolArray:
        """See `Offsets`."""
        return np.ones((len(lines.tips), arm.n_links + 1), dtype=np.bool_)

    def unit(self, arm: Manipulator) -> float:
        """See `Offsets`."""
        return arm.total_length / 3.0

    def mutated(
        self,
        arm: Manipulator,
        shapes: FloatArray,
        moved: FloatArray,
        rng: np.random.Generator,
    ) -> FloatArray:
        """See `Offsets`."""
        n = len(shapes)
        scale = rng.choice(np.array(TURNS), n)
        turn = rng.normal(size=(n, 3)) * scale[:, None]
        first, count, kind = rng.random((3, n))
        return mutated_directions(shapes, first, count, kind, turn)

    def settled(
        self, arm: Manipulator, tips: FloatArray, shapes: FloatArray
    ) -> FloatArray:
        """See `Offsets`."""
        centres = standing(arm, tips, shapes)
        found = np.asarray(np.isfinite(centres).all(axis=(1, 2)))[:, None, None]
        return np.where(found, self.coordinates(arm, centres), shapes)

    def in_line(
        self,
        arm: Manipulator,
        tips: FloatArray,
        shapes: FloatArray,
        joint: int,
        way: int,
    ) -> FloatArray:
        """See `Offsets`."""
        for one in (way, 0, 0):
            lined = lined_up_directions(shapes, arm.link_lengths, joint, one)
            shapes = self.settled(arm, tips, lined)
        return shapes


Chart: TypeAlias = Offsets | Directions
OFFSETS: Final = Offsets()
DIRECTIONS: Final = Directions()


def chart_of(shapes: FloatArray) -> Chart:
    """The chart that shape coordinates are of."""
    return DIRECTIONS if shapes.shape[2] == 3 else OFFSETS


@dataclass(frozen=True)
class Intervals:
    """Straight lines in the chart, each on its own.

    Args:
        tips: Where they begin, shape (n, 3); [m].
        next_tips: Where they end; [m].
        offsets: D_1..D_{N+1} where they begin, shape (n, N + 1, 2) [m], or the
            directions of the links, shape (n, N, 3) [-].
        next_offsets: The same where they end.
        aims: Where the last link shall look at both ends, NaN for anywhere, shape
            (n, 2, 3), see `Pointing.aims`; None for anywhere in all of them.
    """

    tips: FloatArray
    next_tips: FloatArray
    offsets: FloatArray
    next_offsets: FloatArray
    aims: FloatArray | None = None

    def __post_init__(self) -> None:
        """Lay the arrays out in one way, so that kernels are compiled for one."""
        for field in fields(self)[:4]:
            value = np.require(getattr(self, field.name), float, ["C", "W"])
            object.__setattr__(self, field.name, value)

    def part(self, rows: slice) -> "Intervals":
        """Some of them."""
        aims = None if self.aims is None else self.aims[rows]
        return Intervals(
            self.tips[rows],
            self.next_tips[rows],
            self.offsets[rows],
            self.next_offsets[rows],
            aims,
        )

    def knees(self, manipulator: Manipulator) -> BoolArray:
        """Joints where the arm may bend somewhere in each interval, and both ends.

        Returns:
            Shape (n, N + 1).
        """
        return self.chart.knees(manipulator, self._lines)

    @property
    def chart(self) -> Chart:
        """The chart of both ends."""
        return chart_of(self.offsets)

    @property
    def _lines(self) -> Lines:
        return Lines(self.tips, self.next_tips, self.offsets, self.next_offsets)

    def continued(self) -> BoolArray:
        """Whether each interval ends where the next begins, shape (n,)."""
        same = np.zeros(len(self.tips), dtype=np.bool_)
        same[:-1] = (self.next_tips[:-1] == self.tips[1:]).all(axis=1)
        same[:-1] &= (self.next_offsets[:-1] == self.offsets[1:]).all(axis=(1, 2))
        return same

    def centres(
        self, manipulator: Manipulator, interval: IntArray, share: FloatArray
    ) -> FloatArray:
        """Joint centres at places of the intervals (Eq. 7).

        Args:
            manipulator: The arm.
            interval: Interval of each place, shape (r,).
            share: Where in its interval, 0 to 1, shape (r,).

        Returns:
            Shape (r, N + 1, 3), NaN where a link is too short or the base is off its
            rail; [m].
        """
        return self.chart.centres(manipulator, self._lines, interval, share)


def standing(
    manipulator: Manipulator, tips: FloatArray, offsets: FloatArray
) -> FloatArray:
    """Joint centres of configurations, shape (n, N + 1, 3); see `Intervals.centres`."""
    number = np.arange(len(tips))
    still = Intervals(tips, tips, offsets, offsets)
    return still.centres(manipulator, number, np.zeros(len(tips)))


def turned_towards(
    shapes: FloatArray, aims: FloatArray, turned: BoolArray, rng: np.random.Generator
) -> FloatArray:
    """Directions of links with the last ones turned so that the last looks somewhere.

    Each of them turns a part of the way, the more the nearer it is to the tip.

    Args:
        shapes: Directions, shape (n, N, 3); [-].
        aims: Where to, of any length, shape (n, 3).
        turned: Which arms, shape (n,).
        rng: Source of chance.
    """
    n, count = shapes.shape[:2]
    sharing = rng.integers(1, count + 1, n)
    spread = rng.normal(size=(n, 3)) * rng.choice(np.array(TURNS), n)[:, None]
    goal = aims / np.linalg.norm(aims, axis=1, keepdims=True) + spread
    back = np.arange(count)[::-1]
    part = np.maximum(0.0, 1.0 - back / sharing[:, None]) * turned[:, None]
    mixed = (1.0 - part[..., None]) * shapes + part[..., None] * goal[:, None]
    return np.asarray(mixed / np.linalg.norm(mixed, axis=2, keepdims=True))
