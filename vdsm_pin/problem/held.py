"""Which parts of an arm are held apart from which obstacles: all that are not ignored.

An axis is that of a link or of the tool, links first; what a link carries counts as if
it were round about it, and where it reaches beyond an end, the axis goes on. Obstacles
that the same axes are held from, by the same radii, are one group; without
`ignore_pairs` there is one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from vdsm_pin.arm.bodies import ArmBody

TIP: Final = -1
"""Number of the axis at whose end the tip is."""

Axes: TypeAlias = IntArray | int | None
"""Which axis each straight piece is of, from 0, of a shape that goes with theirs. The
last link means all of it, the tool included; None: every link in turn, or, of pieces
that are not as many, whatever is held apart from anything."""


def held_pairs(
    arm: Manipulator, bodies: Sequence["ArmBody"], obstacles: Sequence[str]
) -> BoolArray:
    """Which bodies are held apart from which obstacles, (n_bodies, n_obstacles)."""
    held = np.ones((len(bodies), len(obstacles)), dtype=np.bool_)
    for b, body in enumerate(bodies if arm.ignore_pairs else ()):
        held[b] = [not arm.ignores(body.name, name) for name in obstacles]
    return held


def drawn_out(ends: FloatArray, more: FloatArray) -> FloatArray:
    """Straight pieces that go on beyond their ends; those that are points stay so.

    Args:
        ends: Shape (n, 2, 3); [m].
        more: How far before the first and past the second, shape (n, 2); [m].
    """
    if not more.any():
        return ends
    way = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    unit = np.divide(way, length, out=np.zeros_like(way), where=length > 0.0)
    first, last = more[:, :1] * unit, more[:, 1:] * unit
    return np.stack([ends[:, 0] - first, ends[:, 1] + last], axis=1)


@dataclass(frozen=True)
class HeldGroup:
    """Obstacles that the same axes are held apart from, by the same radii.

    Args:
        obstacles: Their numbers in the scene, ascending, shape (k,).
        radii: How far from each axis the matter reaches that is held apart, -inf where
            none is, shape (n_axes,); [m].
        beyond: How far each axis goes on before it begins and after it ends, shape
            (n_axes, 2); [m].
        n_links: Number of links.
        shaft: Part of the last link that is before the tool; [-].
    """

    obstacles: IntArray
    radii: FloatArray
    beyond: FloatArray
    n_links: int
    shaft: float

    @property
    def radius(self) -> float:
        """The largest of the radii; [m]."""
        return float(self.radii.max())

    @property
    def parted(self) -> bool:
        """Whether the last link and its tool are not held apart by the same radius."""
        last = self.radii[self.n_links - 1 :]
        return bool((last != last[0]).any())

    def held(
        self, ends: FloatArray, axes: IntArray | None
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Numbers of the pieces that are held apart, what of them is, how thick it is.

        Args:
            ends: Of straight pieces, shape (n, 2, 3); [m].
            axes: Which axis each is of, shape (n,); None: all are held, and as thick as
                the thickest.

        Returns:
            Shape (m,), (m, 2, 3) and (m,); where the last link and its tool differ, a
            piece that is both is there twice; [m].
        """
        which = np.arange(len(ends))
        if axes is None:
            every = np.broadcast_to(self.beyond.max(axis=0), (len(ends), 2))
            return which, drawn_out(ends, every), np.full(len(ends), self.radius)
        if self.parted:
            last = np.flatnonzero(axes == self.n_links - 1)
            tool = ends[last]
            tool[:, 0] += self.shaft * (tool[:, 1] - tool[:, 0])
            ends = np.concatenate([ends, tool])
            ends[last, 1] = tool[:, 0]
            which = np.append(which, last)
            axes = np.append(axes, np.full(len(last), self.n_links))
        held = np.isfinite(self.radii[axes])
        which, ends, axes = which[held], ends[held], axes[held]
        # A point at the tip, or a way of it, is no axis.
        more = np.where((axes != TIP)[:, None], self.beyond[axes], 0.0)
        return which, drawn_out(ends, more), self.radii[axes]


@dataclass(frozen=True)
class HeldApart:
    """What of an arm is held apart from each obstacle.

    Args:
        arm: The arm.
        axes: Whether a link, or the tool, itself is, shape (n_axes, n_obstacles).
        radii: How far from each axis the matter reaches that is, the bodies that ride
            on the link included, -inf where none is, of the same shape; [m].
        beyond: How far such bodies reach beyond begin and end of each axis, shape
            (2, n_axes, n_obstacles); [m].
        whole: Whether links, tool and bodies are held apart from every obstacle.
    """

    arm: Manipulator
    axes: BoolArray
    radii: FloatArray
    beyond: FloatArray
    whole: bool

    @classmethod
    def of(cls, arm: Manipulator, obstacles: Sequence[str]) -> "HeldApart":
        """By the `ignore_pairs` of an arm and the names of the obstacles."""
        bodies = arm.convex_bodies if arm.ignore_pairs else ()
        pairs, n_axes = held_pairs(arm, bodies, obstacles), arm.axis_radii.size
        axes = np.ones((n_axes, len(obstacles)), dtype=np.bool_)
        axes[: len(pairs)] = pairs[:n_axes]
        radii = np.where(axes, arm.axis_radii[:, None], -np.inf)
        beyond = np.zeros((2, *radii.shape))
        for body in arm.bodies:
            own = [k for k, one in enumerate(bodies) if one.owner == body.name]
            held = pairs[own].any(axis=0) if own else np.ones(len(obstacles), np.bool_)
            last = n_axes if body.link == arm.n_links else body.link
            radius, *ends = arm.round_cover(body)
            on = slice(body.link - 1, last)
            radii[on] = np.maximum(radii[on], np.where(held, radius, -np.inf))
            for side, more in zip(beyond, ends, strict=True):
                side[on] = np.maximum(side[on], np.where(held, more, 0.0))
        counted = [one.link > 0 for one in bodies]
        return cls(arm, axes, radii, beyond, bool(pairs[counted].all()))

    def keeping(self, margins: FloatArray) -> "HeldApart":
        """The links and obstacles that have a margin, the links thicker by it.

        Args:
            margins: Shape (N, n_obstacles); [m].
        """
        link = np.minimum(np.arange(len(self.radii)), self.arm.n_links - 1)
        radii = np.where(margins[link] > 0.0, self.radii + margins[link], -np.inf)
        return replace(self, radii=radii, whole=False)

    def numbers(self, axes: Axes, shape: tuple[int, int]) -> IntArray | None:
        """The axis of each piece, row after row, shape (n * m,); None for any."""
        if axes is None and shape[1] == self.arm.n_links:
            axes = np.arange(shape[1])
        if axes is None:
            return None
        return np.broadcast_to(np.asarray(axes, dtype=np.int64), shape).reshape(-1)

    @cached_property
    def alike(self) -> bool:
        """Whether all of the arm is equally thick, and held from every obstacle."""
        reaches = self.arm.reaches
        thick = bool((reaches == self.arm.least_radius).all())
        return self.whole and thick

    @cached_property
    def groups(self) -> tuple[HeldGroup, ...]:
        """The groups of obstacles that anything of the axes is held apart from."""
        arm = self.arm
        shaft = float(arm.axis_spans[arm.n_links - 1, 1] / arm.link_lengths[-1])
        every = np.vstack([self.radii, *self.beyond])
        columns, group = np.unique(every, axis=1, return_inverse=True)
        found = []
        for k, column in enumerate(columns.T):
            radii, *beyond = np.split(column, 3)
            if np.isfinite(radii).any():
                obstacles = np.flatnonzero(group.ravel() == k)
                sides = np.stack(beyond, axis=1)
                found.append(HeldGroup(obstacles, radii, sides, arm.n_links, shaft))
        return tuple(found)

    @cached_property
    def cuts(self) -> BoolArray:
        """Joints at which pieces end: links there differ, or are held differently.

        Shape (N + 1,).
        """
        cuts = np.zeros(self.arm.n_links + 1, dtype=np.bool_)
        for one in self.groups:
            links = one.radii[: one.n_links]
            longer = one.beyond[: one.n_links].max(axis=1) > 0.0
            cuts[1:-1] |= (links[1:] != links[:-1]) | longer[1:] | longer[:-1]
            cuts[-2] |= one.parted
        return cuts
