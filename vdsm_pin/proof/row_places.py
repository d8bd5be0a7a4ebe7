"""Fills a block of rows: frames, how they move, where corners are seen; compiled."""

from typing import Final

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.row_bends import bend_way, bound_joints, drift_way
from vdsm_pin.proof.row_frames import move_frame
from vdsm_pin.proof.rows import (
    BEGIN,
    BEND,
    COUNT,
    CURVED,
    DRIFT,
    NUMBER,
    PLACED,
    SWING,
    TURN,
    Rows,
    carry,
    to_frame,
)
from vdsm_pin.proof.terms import Mover, Places, Task, mover_of
from vdsm_pin.proof.ways import WayErrors, Ways

FEW_PLACES: Final = 1024
"""Of so many it is not asked which are wanted."""


@compiled(inline=False)
def _bend_places(
    places: Places, errors: WayErrors, rows: Rows, wanted: IntArray, count: int
) -> None:
    """How far some places leave their chords, and D where errors turn."""
    turning, straight = errors.any_turn, rows.block[CURVED] == 0
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


@compiled(inline=False)
def _set_places(
    places: Places, ways: Ways, rows: Rows, wanted: IntArray, n: int
) -> None:
    """Some places in the frames from which they are seen, those in the world first."""
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
    count = rows.block[COUNT]
    _set_places(places, ways, rows, wanted, count + 1)
    _bend_places(places, errors, rows, wanted, count)


@compiled(inline=False)
def _see_corners(task: Task, rows: Rows, corners: IntArray) -> None:
    """The same of a body's corners, and what they stem from, unless it is known."""
    places, known, size, new = task.places, rows.tracks.known, 0, False
    number = rows.block[NUMBER]
    for corner in corners:
        new |= known[corner] != number
    if not new:
        return
    missing = np.zeros(2 * corners.size, np.int64)
    for in_world in (True, False):
        for corner in corners:
            place = places.point[corner] if in_world else corner
            if known[place] != number:
                known[place], missing[size] = number, place
                size += 1
    _see_places(places, task.ways, task.errors, rows, missing[:size])


@compiled
def seen(task: Task, rows: Rows, pair: int) -> Mover:
    """The moving side of a pair or rough version, its corners known over the block."""
    mover = mover_of(task, pair)
    if rows.block[PLACED] == 0:
        _see_corners(task, rows, mover.slots)
    return mover


@compiled(inline=False)
def fill_rows(task: Task, motion: Motion, rows: Rows, first: int, count: int) -> None:
    """Configurations of rows first .. first + count; the last row may repeat.

    Where there are many places none is known yet: `seen` finds those it is asked for.
    """
    tree, ways, errors = task.tree, task.ways, task.errors
    straight = motion.inner.shape[1] == 0
    block = rows.block
    block[NUMBER] += 1
    block[BEGIN], block[COUNT] = first, count
    block[CURVED], block[PLACED] = 0 if straight else 1, 0
    for joint in range(tree.parent.size):
        move_frame(tree, motion, rows, first, count + 1, joint)
    bound_joints(tree, motion, rows, first, count)
    for way in range(ways.before.size):
        if ways.before[way] >= 0:
            bend_way(tree, ways, rows, way, count, straight)
            if errors.any_turn:
                drift_way(tree, ways, errors.erring, rows, way, count)
    if task.places.way.size <= FEW_PLACES:
        _see_places(task.places, ways, errors, rows, task.places.every)
        block[PLACED] = 1
