"""How fast frames move and turn between the rows of a block, along each way, compiled.

The bounds are those of `bends`, of all intervals of the block at once.
"""

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.proof.motions import Motion, bound_column
from vdsm_pin.proof.packed_tree import PRISMATIC, REVOLUTE, PackedTree
from vdsm_pin.proof.rows import BEND, DRIFT, SWING, TURN, Rows
from vdsm_pin.proof.ways import Ways


@compiled
def bound_joints(
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
    lever: float, turn: FloatArray, before: FloatArray, out: FloatArray
) -> None:
    """Out = before + lever turn^2, row by row."""
    for r in range(out.size):
        out[r] = before[r] + lever * turn[r] * turn[r]


@compiled(inline=False)
def bend_way(
    tree: PackedTree, ways: Ways, rows: Rows, way: int, count: int, straight: bool
) -> None:
    """M and W of a way, from those of the way before it."""
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


@compiled(inline=False)
def drift_way(
    tree: PackedTree, ways: Ways, erring: FloatArray, rows: Rows, way: int, count: int
) -> None:
    """D of a way, from that of the way before it and from W."""
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
