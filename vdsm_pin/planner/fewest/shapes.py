"""Sparse shapes: the arm as one or two straight pieces, and which shapes adjoin.

A shape fixes everything but the tip: the arm leaves the rail in direction w up to joint
m and runs straight from there to the tip. Only psi_1 and psi_m can differ from zero. A
direction is given by its (y, z) part, which is constant along a piece: the projection
of joint m is s_m w with s_m the arc length from O_1. Shape 0 is the straight arm
(m = 1).
"""

from dataclasses import dataclass, replace

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct


@dataclass(frozen=True)
class Shapes:
    """A set of shapes and its neighbourhood graph in compressed rows.

    Args:
        knees: Joint m of each, counted from 0, shape (n,).
        slopes: Rows (w_y, w_z), shape (n, 2); [-].
        first: Where each shape's neighbours begin in `neighbours`, shape (n + 1,).
        neighbours: Shape numbers, shape (m,).
        change: How far the shape turns along each entry of `neighbours`, (m,); [rad].
        step: Lattice step of the slopes; [-].
        grown: Offsets of shapes that exist at one tip only and are numbered after the
            sparse ones, shape (g, N + 1, 2); [m].
    """

    knees: IntArray
    slopes: FloatArray
    first: IntArray
    neighbours: IntArray
    change: FloatArray
    step: float
    grown: FloatArray

    @property
    def size(self) -> int:
        """Number of shapes n, the grown ones included."""
        return len(self.first) - 1

    @property
    def n_lattice(self) -> int:
        """Number of sparse shapes."""
        return len(self.knees)

    def offsets(
        self, manipulator: Manipulator, tips: FloatArray, shape: IntArray
    ) -> FloatArray:
        """Offsets D_1..D_{N+1} of shapes at tips; see `motion`.

        Args:
            manipulator: The arm.
            tips: Shape (n, 3); [m].
            shape: Shape numbers, (n,).

        Returns:
            Shape (n, N + 1, 2); [m].
        """
        sparse = np.minimum(shape, self.n_lattice - 1)
        offsets = _offsets(manipulator, tips, self.knees[sparse], self.slopes[sparse])
        more = shape >= self.n_lattice
        if more.any():
            offsets[more] = self.grown[shape[more] - self.n_lattice]
        return offsets

    def with_grown(self, grown: FloatArray, links: FloatArray) -> "Shapes":
        """The same with more shapes, each of which exists at one tip.

        Args:
            grown: Their offsets, shape (g, N + 1, 2); [m].
            links: Rows (shape, shape, change), one for both ways, shape (l, 3).
        """
        before = len(self.grown)
        every = np.concatenate([self.grown, grown]) if before else grown
        own = np.repeat(np.arange(self.size), np.diff(self.first))
        old = np.column_stack([own, self.neighbours, self.change])
        both = np.vstack([old, links, links[:, [1, 0, 2]]])
        first, neighbours, change = _compressed(both, self.n_lattice + len(every))
        return replace(
            self, first=first, neighbours=neighbours, change=change, grown=every
        )


def knee_joints(manipulator: Manipulator, most: int) -> IntArray:
    """At most `most` joints from 2..N, evenly spread by arc length, counted from 0."""
    inner = manipulator.stations[1:-1]
    if len(inner) <= most:
        return np.arange(1, 1 + len(inner))
    wanted = np.linspace(inner[0], inner[-1], most)
    nearest = np.abs(inner[None, :] - wanted[:, None]).argmin(axis=1)
    return np.asarray(1 + distinct(nearest))


def slope_disc(limit: float, step: float) -> IntArray:
    """Lattice points (a, b) with step |(a, b)| <= sin(limit), shape (n, 2)."""
    reach = int(np.sin(limit) / step)
    side = np.arange(-reach, reach + 1)
    grid = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(grid[np.hypot(*grid.T) * step <= np.sin(limit)])


def one_knee_shapes(
    manipulator: Manipulator, limit: float, step: float, most: int
) -> Shapes:
    """The straight arm, and one knee at each joint with a lattice of base directions.

    Neighbours: the next base directions at the same joint (the eight around), and the
    same base direction with the knee at the next joint (the knee slides).

    Args:
        manipulator: The arm.
        limit: Largest link angle; [rad].
        step: Lattice step of the base direction; [-].
        most: Largest number of knee joints.
    """
    joints, disc = knee_joints(manipulator, most), slope_disc(limit, step)
    first = 1 + len(disc) * np.arange(len(joints))
    slides = [np.stack([first[:-1], first[1:]]), np.stack([first[1:], first[:-1]])]
    sliding = np.concatenate(slides, axis=1)[..., None] + np.arange(len(disc))
    turning = _beside(disc)
    gaps = step * np.hypot(*(disc[turning[0]] - disc[turning[1]]).T)
    turns = turning[:, None] + first[None, :, None]
    here, there = np.concatenate([turns.reshape(2, -1), sliding.reshape(2, -1)], axis=1)
    change = np.full(len(here), 2.0 * step)
    change[: turns[0].size] = np.tile(gaps, len(joints))
    links = np.column_stack([here, there, change])
    knees = np.append(0, np.repeat(joints, len(disc)))
    slopes = np.vstack([np.zeros(2), np.tile(disc * step, (len(joints), 1))])
    rows = _compressed(links, len(knees))
    return Shapes(knees, slopes, *rows, step, np.zeros((0, 0, 2)))


def _beside(points: IntArray) -> IntArray:
    """Pairs of lattice points that are among each other's eight, shape (2, m)."""
    reach = int(np.abs(points).max(initial=0)) + 1
    number = np.full((2 * reach + 1, 2 * reach + 1), -1)
    column, row = points.T + reach
    number[column, row] = np.arange(len(points))
    around = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if (a, b) != (0, 0)]
    others = np.stack([number[column + a, row + b] for a, b in around])
    own = np.broadcast_to(np.arange(len(points)), others.shape)
    there = others >= 0
    return np.stack([own[there], others[there]])


def _compressed(links: FloatArray, count: int) -> tuple[IntArray, IntArray, FloatArray]:
    order = np.lexsort((links[:, 1], links[:, 0]))
    links = links[order]
    first = np.searchsorted(links[:, 0], np.arange(count + 1))
    return first.astype(np.int64), links[:, 1].astype(np.int64), links[:, 2].copy()


def _offsets(
    manipulator: Manipulator, tips: FloatArray, knees: IntArray, slopes: FloatArray
) -> FloatArray:
    """Offsets of sparse shapes at tips, shape (n, N + 1, 2); [m].

    Args:
        manipulator: The arm.
        tips: Shape (n, 3); [m].
        knees: Of `Shapes`, shape (n,).
        slopes: Of `Shapes`, shape (n, 2); [-].
    """
    ratios, at, bent = manipulator.ratios, manipulator.ratios[knees], knees > 0
    corner = manipulator.stations[knees][:, None] * slopes - at[:, None] * tips[:, 1:]
    # The knee's offset falls in proportion towards the base and towards the tip.
    rising = ratios / np.where(bent, at, 1.0)[:, None]
    falling = (1.0 - ratios) / (1.0 - at)[:, None]
    hat = np.where(bent[:, None], np.minimum(rising, falling), 0.0)
    return np.asarray(hat[..., None] * corner[:, None])
