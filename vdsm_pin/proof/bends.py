"""How frames move over a slice of an interval, seen along one way, compiled."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.proof.motions import Motion, bound_column
from vdsm_pin.proof.packed_tree import PRISMATIC, REVOLUTE
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.ways import Ways


class Bends(NamedTuple):
    """How frames move over a slice, seen along each way.

    Args:
        bends: Bound M of the second derivative of a frame's origin, (n_ways,); [m].
        turns: Bound W of how fast a frame turns, shape (n_ways,); [rad].
        swings: Bound A of how fast that changes, shape (n_ways,); [rad].
        drifts: Bound D of how fast that changes what errors do to the origin,
            shape (n_ways,); [m].
        steps: Working space: the ways to pass, shape (n_frames,).
        bound: Working space, shape (3,).
    """

    bends: FloatArray
    turns: FloatArray
    swings: FloatArray
    drifts: FloatArray
    steps: IntArray
    bound: FloatArray


@compiled
def new_bends(n_ways: int, n_frames: int) -> Bends:
    """Of frames at rest."""
    return Bends(
        np.zeros(n_ways),
        np.zeros(n_ways),
        np.zeros(n_ways),
        np.zeros(n_ways),
        np.zeros(n_frames + 1, np.int64),
        np.zeros(3),
    )


@compiled
def stay(ways: Ways, bends: Bends, way: int) -> None:
    """No frame along a way moves."""
    while way >= 0:
        bends.bends[way] = bends.turns[way] = 0.0
        bends.swings[way] = bends.drifts[way] = 0.0
        way = ways.before[way]


@compiled(inline=False)
def bend_between(
    task: Task, motion: Motion, bends: Bends, way: int, k: int, start: float, end: float
) -> None:
    """Bound how the frames along one way move over a slice of interval k.

    Times run from 0 to 1 over the whole interval; all along the way is written.
    """
    tree, ways, errors = task.tree, task.ways, task.errors
    if k + 1 >= motion.knots.shape[0] or not end > start:
        stay(ways, bends, way)
        return
    steps, size, at = bends.steps, 0, way
    while ways.before[at] >= 0:
        steps[size] = at
        size, at = size + 1, ways.before[at]
    bends.bends[at] = bends.turns[at] = bends.swings[at] = bends.drifts[at] = 0.0
    bound = bends.bound
    for step in range(size - 1, -1, -1):
        at = steps[step]
        before, joint = ways.before[at], ways.joint[at]
        column, kind = tree.column[joint], tree.kind[joint]
        turn, swing = bends.turns[before], bends.swings[before]
        bend, drift = bends.bends[before], bends.drifts[before]
        # The shift rides on the frame that the joint hangs on.
        shift_turn, shift_swing = turn, swing
        far = rate = change = 0.0
        if column >= 0:
            bound_column(motion, k, column, start, end, bound)
            ratio = abs(tree.ratio[joint])
            far = ratio * bound[0] + abs(tree.offset[joint])
            rate, change = ratio * bound[1], ratio * bound[2]
        else:
            far = abs(tree.offset[joint])
        if kind == REVOLUTE:
            turn, swing = turn + rate, swing + change
        if ways.up[at]:
            shift_turn, shift_swing = turn, swing
        lever = tree.lever[joint]
        bend += lever * (shift_turn * shift_turn + shift_swing)
        erring = errors.erring[at if ways.up[at] else before]
        drift += lever * erring * shift_turn
        if kind == PRISMATIC:
            bend += far * (turn * turn + swing) + 2.0 * turn * rate + change
            drift += errors.erring[at] * (far * turn + rate)
        bends.bends[at], bends.turns[at] = bend, turn
        bends.swings[at], bends.drifts[at] = swing, drift
