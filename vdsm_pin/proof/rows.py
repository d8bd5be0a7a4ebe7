"""A block of rows: arrays of its configurations, and points from frame to frame.

Every array has the rows last: the loops below are what a compiler turns into vector
instructions, and each writes one array only, so that it sees that nothing overlaps.
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray, paged_zeros, uncleared
from vdsm_pin.proof.terms import WORLD

BLOCK: Final = 64
"""Intervals whose configurations are computed at once: they fit the cache."""


class Tracks(NamedTuple):
    """Where the task's places go in a block of rows.

    Args:
        places: In their frames at rest, shape (n_places, 3, BLOCK + 1); [m].
        sags: M/8, how far places may leave their chords, (n_places, BLOCK); [m].
        drifts: D of places, 0 where no errors turn, the same shape; [m].
        known: Number of the block over which each place is known, shape (n_places,);
            the others hold anything.
    """

    places: FloatArray
    sags: FloatArray
    drifts: FloatArray
    known: IntArray


class Rows(NamedTuple):
    """Configurations of a block of rows and what lies between them.

    Args:
        frames: R_world_frame, shape (n_frames, 3, 3, BLOCK + 1); [-].
        origins: Shape (n_frames, 3, BLOCK + 1); [m].
        tracks: The task's places.
        ways: M, W and D of the frames along each way, and how fast W changes where
            pieces are not straight, shape (n_ways, 4, BLOCK); [m], [rad].
        joints: Bounds of each joint's value, its rate and how fast that changes, shape
            (n_joints, 3, BLOCK).
        work: Working space, shape (8, BLOCK + 1).
        block: What the rows are of, laid out as below, shape (BLOCK_STATE,).
    """

    frames: FloatArray
    origins: FloatArray
    tracks: Tracks
    ways: FloatArray
    joints: FloatArray
    work: FloatArray
    block: IntArray


def new_tracks(n_places: int, block: int) -> Tracks:
    """Of places of which none is known: memory is taken where one is written to."""
    return Tracks(
        uncleared(n_places, 3, block + 1),
        uncleared(n_places, block),
        paged_zeros(n_places, block),
        np.zeros(n_places, np.int64),
    )


BEND: Final = 0
TURN: Final = 1
DRIFT: Final = 2
SWING: Final = 3
"""Layout of what is bounded along a way."""

NUMBER: Final = 0
COUNT: Final = 1
CURVED: Final = 2
PLACED: Final = 3
TURNED: Final = 4
BEGIN: Final = 5
BLOCK_STATE: Final = 6
"""Layout of what a block of rows is of: its number, from 1; how many intervals it has;
1 where pieces are not straight, where all places are known, and where errors turned in
what was judged last; its first interval."""


@compiled
def new_rows(n_frames: int, n_ways: int, tracks: Tracks, block: int) -> Rows:
    """Fresh working space of so many intervals; the world's frame is set."""
    frames = np.zeros((n_frames, 3, 3, block + 1))
    for c in range(3):
        frames[0, c, c] = 1.0
    return Rows(
        frames,
        np.zeros((n_frames, 3, block + 1)),
        tracks,
        np.zeros((n_ways, 4, block)),
        np.zeros((n_frames - 1, 3, block)),
        np.zeros((8, block + 1)),
        np.zeros(BLOCK_STATE, np.int64),
    )


@compiled
def blend(
    x: FloatArray, y: FloatArray, z: FloatArray, at: FloatArray, out: FloatArray
) -> None:
    """Out = at[0] x + at[1] y + at[2] z, row by row."""
    a, b, c = at[0], at[1], at[2]
    for r in range(out.size):
        out[r] = a * x[r] + b * y[r] + c * z[r]


@compiled
def carry(
    origins: FloatArray, frames: FloatArray, at: FloatArray, n: int, out: FloatArray
) -> None:
    """Points of one frame in the world's, of n rows.

    Args:
        origins: The frame's, shape (3, >= n); [m].
        frames: Its rotations, shape (3, 3, >= n); [-].
        at: The point in it, shape (3,); [m].
        n: Number of rows.
        out: Written, shape (3, >= n); [m].
    """
    x, y, z = at[0], at[1], at[2]
    on_axis = y == 0.0 and z == 0.0
    for c in range(3):
        o, place = origins[c], out[c]
        fx, fy, fz = frames[c, 0], frames[c, 1], frames[c, 2]
        if on_axis and x == 0.0:
            for r in range(n):
                place[r] = o[r]
        elif on_axis:
            for r in range(n):
                place[r] = o[r] + x * fx[r]
        else:
            for r in range(n):
                place[r] = o[r] + (x * fx[r] + y * fy[r] + z * fz[r])


@compiled
def turn_axis(
    rows: Rows, rest: int, frame: int, axis: FloatArray, count: int, out: FloatArray
) -> None:
    """A direction of one frame in another, shape (3, >= count)."""
    for c in range(3):
        f = rows.frames[frame, c]
        blend(f[0, :count], f[1, :count], f[2, :count], axis, out[c, :count])
    if rest != WORLD:
        _turn_back(rows, rest, count, out)


@compiled
def _turn_back(rows: Rows, rest: int, count: int, out: FloatArray) -> None:
    """Directions of the world's frame in another, shape (3, >= count)."""
    work = rows.work
    for c in range(3):
        for r in range(count):
            work[c, r] = out[c, r]
    _across(work, rows.frames[rest], count, out)


@compiled
def _across(given: FloatArray, frames: FloatArray, count: int, out: FloatArray) -> None:
    """Out = frames^T given, row by row; shapes (3, 3, >= count), (3, >= count)."""
    x, y, z = given[0], given[1], given[2]
    for c in range(3):
        a, b, d, turned = frames[0, c], frames[1, c], frames[2, c], out[c]
        for r in range(count):
            turned[r] = a[r] * x[r] + b[r] * y[r] + d[r] * z[r]


@compiled
def to_frame(
    rows: Rows, rest: int, count: int, based: FloatArray, out: FloatArray
) -> None:
    """Points of the world's frame in another, shape (3, >= count); [m]."""
    if rest == WORLD:
        for c in range(3):
            out[c, :count] = based[c, :count]
        return
    for c in range(3):
        o, arm, given = rows.origins[rest, c], rows.work[c], based[c]
        for r in range(count):
            arm[r] = given[r] - o[r]
    _across(rows.work, rows.frames[rest], count, out)
