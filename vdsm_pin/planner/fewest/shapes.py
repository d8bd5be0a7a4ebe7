"""Sparse shapes: the arm as two or three straight pieces, and which shapes adjoin.

A shape fixes everything but the tip: the arm leaves the rail in direction w1 up to
joint i, goes on in direction w2 up to joint j and runs straight from there to the tip.
Only psi_1, psi_i and psi_j can differ from zero. A direction is given by its (y, z)
part, which is constant along a piece: the projection of joint i is s_i w1 with s_i the
arc length from O_1. Shape 0 is the straight arm (i = j = 1).
"""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.manipulator import Manipulator


@dataclass(frozen=True)
class Shapes:
    """A set of shapes and its neighbourhood graph in compressed rows.

    Args:
        knees: Rows (i, j) counted from 0, i <= j, shape (n, 2).
        slopes: Rows (w1_y, w1_z, w2_y, w2_z), shape (n, 4); [-].
        first: Where each shape's neighbours begin in `neighbours`, shape (n + 1,).
        neighbours: Shape numbers, shape (m,).
        change: How far the shape turns along each entry of `neighbours`, (m,); [rad].
        step: Lattice step of the slopes; [-].
    """

    knees: IntArray
    slopes: FloatArray
    first: IntArray
    neighbours: IntArray
    change: FloatArray
    step: float

    @property
    def size(self) -> int:
        """Number of shapes n."""
        return len(self.knees)


def knee_joints(manipulator: Manipulator, most: int) -> IntArray:
    """At most `most` joints from 2..N, evenly spread by arc length, counted from 0."""
    inner = manipulator.stations[1:-1]
    if len(inner) <= most:
        return np.arange(1, 1 + len(inner))
    wanted = np.linspace(inner[0], inner[-1], most)
    nearest = np.abs(inner[None, :] - wanted[:, None]).argmin(axis=1)
    return np.asarray(1 + np.unique(nearest))


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
    n_disc = len(disc)
    knees = np.repeat(joints, n_disc)
    slopes = np.tile(disc * step, (len(joints), 1))
    number = {(int(a), int(b)): i for i, (a, b) in enumerate(disc)}
    around = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if (a, b) != (0, 0)]
    rows: list[tuple[int, int, float]] = []
    for i, (a, b) in enumerate(disc):
        for da, db in around:
            other = number.get((int(a + da), int(b + db)))
            if other is not None:
                rows.append((i, other, step * float(np.hypot(da, db))))
    base = np.array(rows)
    links = []
    for m in range(len(joints)):
        links.append(base + np.array([1 + m * n_disc, 1 + m * n_disc, 0.0]))
        for other in (m - 1, m + 1):
            if 0 <= other < len(joints):
                own = np.arange(n_disc)
                cost = np.full(n_disc, 2.0 * step)
                links.append(
                    np.column_stack(
                        [1 + m * n_disc + own, 1 + other * n_disc + own, cost]
                    )
                )
    return _shapes(knees, slopes, np.vstack(links), step)


def _shapes(
    knees: IntArray, slopes: FloatArray, links: FloatArray, step: float
) -> Shapes:
    order = np.lexsort((links[:, 1], links[:, 0]))
    links = links[order]
    count = 1 + len(knees)
    first = np.searchsorted(links[:, 0], np.arange(count + 1))
    all_knees = np.zeros((count, 2), dtype=np.int64)
    all_knees[1:] = knees[:, None]
    all_slopes = np.zeros((count, 4))
    all_slopes[1:, :2] = slopes
    all_slopes[1:, 2:] = slopes
    return Shapes(
        all_knees,
        all_slopes,
        first.astype(np.int64),
        links[:, 1].astype(np.int64),
        links[:, 2].copy(),
        step,
    )
