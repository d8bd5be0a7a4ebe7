"""The configurations of a block of rows, coordinates apart so that loops run over rows.

Every array has the rows last: the loops below are what a compiler turns into vector
instructions, and each writes one array only, so that it sees that nothing overlaps.
"""

from math import cos, sin
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import apart, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.proof.packed_tree import (
    PRISMATIC,
    REVOLUTE,
    Motion,
    PackedTree,
    bound_column,
)
from vdsm_pin.proof.terms import WORLD, Mover, Places, Task, mover_of
from vdsm_pin.proof.ways import WayErrors, Ways

BLOCK: Final = 64
"""Intervals whose configurations are computed at once: they fit the cache."""


FEW_PLACES: Final = 1024
"""Of so many it is not asked which are wanted."""


class Tracks(NamedTuple):
    """Where the task's places go in a block of rows.

    Args:
        places: In their frames at rest, shape (n_places, 3, BLOCK + 1); [m].
        sags: M/8, how far places may leave their chords, (n_places, BLOCK); [m].
        drifts: D of places, only where errors turn, the same shape; [m].
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
        block: Number of the block, from 1, its intervals, 1 where pieces are not
            straight, and 1 where all places are known, shape (4,).
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
        np.zeros((n_places, 3, block + 1)),
        np.zeros((n_places, block)),
        np.zeros((n_places, block)),
        np.zeros(n_places, np.int64),
    )


BEND: Final = 0
TURN: Final = 1
DRIFT: Final = 2
SWING: Final = 3
"""Layout of what is bounded along a way."""


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
        np.zeros(4, np.int64),
    )


@compiled
def blend(
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    at: FloatArray,
    out: FloatArray,
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
def _turn_pair(
    p: FloatArray, q: FloatArray, co: FloatArray, si: FloatArray, out: FloatArray
) -> None:
    """Out = co p + si q, row by row."""
    for r in range(out.size):
        out[r] = co[r] * p[r] + si[r] * q[r]


@compiled
def _turn_back_pair(
    p: FloatArray, q: FloatArray, co: FloatArray, si: FloatArray, out: FloatArray
) -> None:
    """Out = co q - si p, row by row."""
    for r in range(out.size):
        out[r] = co[r] * q[r] - si[r] * p[r]


@compiled
def _turn_askew(
    old: FloatArray, axis: FloatArray, co: FloatArray, si: FloatArray, new: FloatArray
) -> None:
    """Turn one row of the frames, shape (3, n), about an axis of the frame."""
    u, v, w = axis[0], axis[1], axis[2]
    for r in range(co.size):
        x, y, z = old[0, r], old[1, r], old[2, r]
        rest = (1.0 - co[r]) * (x * u + y * v + z * w)
        new[0, r] = co[r] * x + si[r] * (y * w - z * v) + rest * u
        new[1, r] = co[r] * y + si[r] * (z * u - x * w) + rest * v
        new[2, r] = co[r] * z + si[r] * (x * v - y * u) + rest * w


@compiled
def _place_rotation(tree: PackedTree, rows: Rows, joint: int, n: int) -> None:
    """One frame's rotations as the joint's placement leaves them, to its own array."""
    placed, new = tree.rotation[joint], rows.frames[joint + 1]
    old = rows.frames[tree.parent[joint]]
    for c in range(3):
        x, y, z = old[c, 0], old[c, 1], old[c, 2]
        for d in range(3):
            blend(x, y, z, placed[:, d], new[c, d, :n])


@compiled
def _turn_frame(tree: PackedTree, rows: Rows, joint: int, n: int) -> None:
    """Turn a frame by the joint's angles, whose cosines and sines are in `work`."""
    co, si = rows.work[0, :n], rows.work[1, :n]
    along, new = tree.along[joint], rows.frames[joint + 1]
    old, turned = rows.frames[tree.parent[joint]], tree.turned[joint]
    for c in range(3):
        given = rows.work[2:5]
        if turned:
            given[:, :n] = new[c, :, :n]
        else:
            given = old[c]
        if along > 2:
            _turn_askew(given, tree.axis[joint], co, si, new[c])
            continue
        # About z: x' = co x + si y, y' = co y - si x; the others by going round.
        first, second = (along + 1) % 3, (along + 2) % 3
        p, q = given[first, :n], given[second, :n]
        _turn_pair(p, q, co, si, new[c, first, :n])
        _turn_back_pair(p, q, co, si, new[c, second, :n])
        if not turned:
            new[c, along, :n] = old[c, along, :n]


@compiled
def _move_frame(
    tree: PackedTree, motion: Motion, rows: Rows, first: int, n: int, joint: int
) -> None:
    """The frame of a joint in the rows of a block, from its parent's."""
    apart()
    parent, column, kind = tree.parent[joint], tree.column[joint], tree.kind[joint]
    values, last = rows.work[5, :n], motion.knots.shape[0] - 1
    ratio, offset = tree.ratio[joint], tree.offset[joint]
    values[:] = offset
    if column >= 0:
        for r in range(n):
            values[r] = ratio * motion.knots[min(first + r, last), column] + offset
    origin, new = rows.origins[joint + 1], rows.frames[joint + 1]
    carry(rows.origins[parent], rows.frames[parent], tree.shift[joint], n, origin)
    if tree.turned[joint]:
        _place_rotation(tree, rows, joint, n)
    elif kind != REVOLUTE:
        new[:, :, :n] = rows.frames[parent, :, :, :n]
    if kind == REVOLUTE:
        co, si = rows.work[0, :n], rows.work[1, :n]
        for r in range(n):
            co[r], si[r] = cos(values[r]), sin(values[r])
        _turn_frame(tree, rows, joint, n)
    elif kind == PRISMATIC:
        for c in range(3):
            moved, f = rows.work[0, :n], new[c]
            blend(f[0, :n], f[1, :n], f[2, :n], tree.axis[joint], moved)
            for r in range(n):
                origin[c, r] += values[r] * moved[r]


@compiled
def _bound_joints(
    tree: PackedTree, motion: Motion, rows: Rows, first: int, count: int
) -> None:
    """How far and how fast each joint moves in the intervals of a block."""
    last = motion.knots.shape[0] - 1
    straight = motion.inner.shape[1] == 0
    bound = np.zeros(3)
    for joint in range(tree.parent.size):
        column, ratio = tree.column[joint], abs(tree.ratio[joint])
        offset, own = abs(tree.offset[joint]), rows.joints[joint]
        if column < 0:
            own[0, :count], own[1:, :count] = offset, 0.0
            continue
        for r in range(count):
            k, after = min(first + r, last), min(first + r + 1, last)
            if straight or after == k:
                here, there = motion.knots[k, column], motion.knots[after, column]
                own[0, r] = ratio * max(abs(here), abs(there)) + offset
                own[1, r] = ratio * abs(there - here)
                own[2, r] = 0.0
                continue
            bound_column(motion, k, column, 0.0, 1.0, bound)
            own[0, r] = ratio * bound[0] + offset
            own[1, r], own[2, r] = ratio * bound[1], ratio * bound[2]


@compiled
def _add_shift(
    lever: float,
    turn: FloatArray,
    before: FloatArray,
    out: FloatArray,
) -> None:
    """Out = before + lever turn^2, row by row."""
    for r in range(out.size):
        out[r] = before[r] + lever * turn[r] * turn[r]


@compiled
def _bend_way(
    tree: PackedTree,
    ways: Ways,
    rows: Rows,
    way: int,
    count: int,
    straight: bool,
) -> None:
    """M and W of a way, from those of the way before it."""
    apart()
    before, joint = rows.ways[ways.before[way]], ways.joint[way]
    own, kind = rows.ways[way], tree.kind[joint]
    turn, turn_before = own[TURN, :count], before[TURN, :count]
    swing, swing_before = own[SWING, :count], before[SWING, :count]
    turn[:] = turn_before
    rate = rows.joints[joint, 1, :count]
    if kind == REVOLUTE:
        for r in range(count):
            turn[r] += rate[r]
    if not straight:
        swing[:] = swing_before
        if kind == REVOLUTE:
            for r in range(count):
                swing[r] += rows.joints[joint, 2, r]
    # The shift rides on the frame that the joint hangs on.
    shifting, shift_swing = turn_before, swing_before
    if ways.up[way]:
        shifting, shift_swing = turn, swing
    bend, lever = own[BEND, :count], tree.lever[joint]
    _add_shift(lever, shifting, before[BEND, :count], bend)
    if not straight:
        for r in range(count):
            bend[r] += lever * shift_swing[r]
    if kind == PRISMATIC:
        reach, change = rows.joints[joint, 0], rows.joints[joint, 2]
        for r in range(count):
            bend[r] += turn[r] * (reach[r] * turn[r] + 2.0 * rate[r]) + change[r]
        if not straight:
            for r in range(count):
                bend[r] += reach[r] * swing[r]


@compiled
def _drift_way(
    tree: PackedTree,
    ways: Ways,
    erring: FloatArray,
    rows: Rows,
    way: int,
    count: int,
) -> None:
    """D of a way, from that of the way before it and from W."""
    apart()
    number, joint = ways.before[way], ways.joint[way]
    before, own = rows.ways[number], rows.ways[way]
    turn, share, stroke = before[TURN], erring[number], erring[way]
    if ways.up[way]:
        turn, share = own[TURN], stroke
    share, drift = tree.lever[joint] * share, own[DRIFT]
    for r in range(count):
        drift[r] = before[DRIFT, r] + share * turn[r]
    if tree.kind[joint] == PRISMATIC:
        reach, rate, turn = rows.joints[joint, 0], rows.joints[joint, 1], own[TURN]
        for r in range(count):
            drift[r] += stroke * (reach[r] * turn[r] + rate[r])


@compiled
def _bend_places(
    places: Places, errors: WayErrors, rows: Rows, wanted: IntArray, count: int
) -> None:
    """How far some places leave their chords, and D where errors turn."""
    apart()
    turning, straight = errors.any_turn, rows.block[2] == 0
    for place in wanted:
        way, lever = places.way[place], places.lever[place]
        own, sag = rows.ways[way], rows.tracks.sags[place, :count]
        bend, turn = own[BEND, :count], own[TURN, :count]
        for r in range(sag.size):
            sag[r] = 0.125 * (bend[r] + lever * turn[r] * turn[r])
        if not straight:
            for r in range(sag.size):
                sag[r] += 0.125 * lever * own[SWING, r]
        if turning:
            share, drift = lever * errors.erring[way], rows.tracks.drifts[place]
            for r in range(count):
                drift[r] = own[DRIFT, r] + share * turn[r]


@compiled
def _set_places(
    places: Places, ways: Ways, rows: Rows, wanted: IntArray, n: int
) -> None:
    """Some places in the frames from which they are seen, those in the world first."""
    apart()
    for place in wanted:
        way, out = places.way[place], rows.tracks.places[place]
        if place < places.n_points:
            frame = ways.frame[way]
            at = places.at[place]
            carry(rows.origins[frame], rows.frames[frame], at, n, out)
        elif ways.before[way] < 0:
            for c in range(3):
                out[c, :n] = places.at[place, c]
        else:
            based = rows.tracks.places[places.point[place]]
            to_frame(rows, ways.rest[way], n, based, out)


@compiled
def _see_places(
    places: Places, ways: Ways, errors: WayErrors, rows: Rows, wanted: IntArray
) -> None:
    """Find where some places go over the block."""
    count = rows.block[1]
    _set_places(places, ways, rows, wanted, count + 1)
    _bend_places(places, errors, rows, wanted, count)


@compiled
def _see_corners(task: Task, rows: Rows, corners: IntArray) -> None:
    """The same of a body's corners, and what they stem from, unless it is known."""
    apart()
    places, known, size = task.places, rows.tracks.known, 0
    missing = np.zeros(2 * corners.size, np.int64)
    for in_world in (True, False):
        for corner in corners:
            place = places.point[corner] if in_world else corner
            if known[place] != rows.block[0]:
                known[place], missing[size] = rows.block[0], place
                size += 1
    _see_places(places, task.ways, task.errors, rows, missing[:size])


@compiled
def seen(task: Task, rows: Rows, pair: int) -> Mover:
    """The moving side of a pair or rough version, its corners known over the block."""
    mover = mover_of(task, pair)
    if rows.block[3] == 0:
        _see_corners(task, rows, mover.slots)
    return mover


@compiled
def fill_rows(task: Task, motion: Motion, rows: Rows, first: int, count: int) -> None:
    """Configurations of rows first .. first + count; the last row may repeat.

    Where there are many places none is known yet: `seen` finds those it is asked for.
    """
    apart()
    tree, ways, errors = task.tree, task.ways, task.errors
    straight = motion.inner.shape[1] == 0
    rows.block[0] += 1
    rows.block[1], rows.block[2], rows.block[3] = count, 0 if straight else 1, 0
    for joint in range(tree.parent.size):
        _move_frame(tree, motion, rows, first, count + 1, joint)
    _bound_joints(tree, motion, rows, first, count)
    for way in range(ways.before.size):
        if ways.before[way] >= 0:
            _bend_way(tree, ways, rows, way, count, straight)
            if errors.any_turn:
                _drift_way(tree, ways, errors.erring, rows, way, count)
    if task.places.way.size <= FEW_PLACES:
        _see_places(task.places, ways, errors, rows, task.places.every)
        rows.block[3] = 1


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
