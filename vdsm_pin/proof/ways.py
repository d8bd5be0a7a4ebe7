"""Frames as seen from frames at rest: what lies between them bounds how they move.

Seen from frame a, a point of frame b is a sum of segments, each constant in a frame of
its own: the shift of every joint between them in the frame that the joint hangs on, the
stroke of a prismatic joint along its axis. A segment of length d in a frame that turns
at a rate of at most W, seen from a, has a second derivative of at most d (W^2 + A), A
the bound of the rate's change; a stroke s adds 2 W |s'| + |s''|. `docs/certificate.md`
has the bound that follows (Schwarzer, Saha and Latombe 2005 bound the way instead).
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.proof.packed_tree import PRISMATIC, REVOLUTE, PackedTree


class Ways(NamedTuple):
    """Frames as seen from others; each way but the shortest ones goes on from another.

    Args:
        rest: The frame from which is seen, shape (n_ways,).
        frame: The frame that is seen, shape (n_ways,).
        before: The way to the frame one joint nearer, -1 where there is none.
        joint: The joint between the two, -1 where there is none.
        up: Whether that joint carries the nearer frame, not this one.
    """

    rest: IntArray
    frame: IntArray
    before: IntArray
    joint: IntArray
    up: BoolArray


class WayErrors(NamedTuple):
    """What errors of joints and placements come to, by joint and by way.

    Args:
        turn: Largest errors of revolute joints, shape (n_joints,); [rad].
        tilt: Largest turns of placements about their origins, shape (n_joints,); [rad].
        erring: Sum of the former along a way, shape (n_ways,); [rad].
        turned: Sum of both along a way, shape (n_ways,); [rad].
        shifted: Sum of shifts and of errors of prismatic joints, shape (n_ways,); [m].
        second: Second order of the turns in the frame's origin, (n_ways,); [m].
        crude: First order there, in whatever direction, shape (n_ways,); [m].
        swing: The same of a point, by its distance from the origin, (n_ways,); [rad].
        any_turn: Whether anything may be turned.
    """

    turn: FloatArray
    tilt: FloatArray
    erring: FloatArray
    turned: FloatArray
    shifted: FloatArray
    second: FloatArray
    crude: FloatArray
    swing: FloatArray
    any_turn: bool


class WayTable:
    """Collects ways, each once.

    Args:
        parents: The frame that each joint hangs on, shape (n_joints,).
    """

    def __init__(self, parents: IntArray) -> None:
        self._parents = parents.tolist()
        self._numbers: dict[tuple[int, int], int] = {}
        self._rows: list[tuple[int, int, int, int, bool]] = []

    def number(self, rest: int, frame: int) -> int:
        """The way to a frame as seen from another; those on the way come before."""
        known = self._numbers.get((rest, frame))
        if known is not None:
            return known
        if rest == frame:
            row = (rest, frame, -1, -1, False)
        elif self.goes_down(rest, frame):
            parent = self._parents[frame - 1]
            row = (rest, frame, self.number(rest, parent), frame - 1, False)
        else:
            child = self._child_towards(frame, rest)
            row = (rest, frame, self.number(rest, child), child - 1, True)
        self._numbers[rest, frame] = len(self._rows)
        self._rows.append(row)
        return len(self._rows) - 1

    def goes_down(self, rest: int, frame: int) -> bool:
        """Whether the last joint on the way to a frame carries it."""
        return not self._carries(frame, rest)

    def _carries(self, frame: int, other: int) -> bool:
        """Whether one frame carries another, or is the same."""
        while other > frame:
            other = self._parents[other - 1]
        return other == frame

    def _child_towards(self, frame: int, other: int) -> int:
        """The frame that hangs on `frame` and carries `other`."""
        while self._parents[other - 1] != frame:
            other = self._parents[other - 1]
        return other

    def packed(self) -> Ways:
        """All ways asked for and those that they go on from."""
        rows = np.array(self._rows, dtype=np.int64).reshape(-1, 5)
        rest, frame, before, joint, up = np.ascontiguousarray(rows.T)
        return Ways(rest, frame, before, joint, up != 0)


@compiled
def way_errors(
    tree: PackedTree,
    ways: Ways,
    joints: FloatArray,
    shifts: FloatArray,
    tilts: FloatArray,
) -> WayErrors:
    """What an error box comes to along each way.

    Args:
        tree: The joints.
        ways: The ways.
        joints: Largest error of each joint's value, shape (n_joints,); [rad] or [m].
        shifts: How far each placement may be shifted, shape (n_joints,); [m].
        tilts: How far it may be turned about its origin, shape (n_joints,); [rad].
    """
    n = ways.rest.size
    turns, any_turn = np.zeros(joints.size), False
    for joint in range(joints.size):
        if tree.kind[joint] == REVOLUTE:
            turns[joint] = joints[joint]
        any_turn |= turns[joint] > 0.0 or tilts[joint] > 0.0
    erring, turned, shifted = np.zeros(n), np.zeros(n), np.zeros(n)
    second, crude, swing = np.zeros(n), np.zeros(n), np.zeros(n)
    met = np.zeros(n, np.bool_)
    for way in range(n):
        before, joint = ways.before[way], ways.joint[way]
        if before < 0:
            continue
        tilt, lever = tilts[joint], tree.lever[joint]
        erring[way] = erring[before] + turns[joint]
        turned[way] = turned[before] + turns[joint] + tilt
        swing[way] = swing[before] + turns[joint] + tilt
        cosine = _cosine(tree, ways, way)
        if cosine < 1.0 and not met[before]:
            # Errors of two axes that meet turn a point about one: a sum of vectors.
            met[way] = True
            one, other = turns[ways.joint[before]], turns[joint]
            both = one * one + other * other + 2.0 * cosine * one * other
            swing[way] += sqrt(both) - one - other
        at = way if ways.up[way] else before
        second[way] = second[before] + 0.5 * lever * turned[at] ** 2
        crude[way] = crude[before] + lever * swing[at]
        shifted[way] = shifted[before] + shifts[joint]
        if tree.kind[joint] == PRISMATIC:
            shifted[way] += joints[joint]
            if turned[way] > 0.0:
                second[way] += 0.5 * tree.stroke[joint] * turned[way] ** 2
                crude[way] += tree.stroke[joint] * swing[way]
    return WayErrors(
        turns, tilts.copy(), erring, turned, shifted, second, crude, swing, any_turn
    )


@compiled
def _cosine(tree: PackedTree, ways: Ways, way: int) -> float:
    """Of the angle of the axes of a way's last two joints where they meet, or 1."""
    before, joint = ways.before[way], ways.joint[way]
    last = ways.joint[before]
    if ways.before[before] < 0 or ways.up[way] or ways.up[before]:
        return 1.0
    if tree.kind[joint] != REVOLUTE or tree.kind[last] != REVOLUTE:
        return 1.0
    if tree.lever[joint] > 0.0:
        return 1.0
    along, turn = 0.0, tree.rotation[joint]
    for c in range(3):
        for d in range(3):
            along += tree.axis[last, c] * turn[c, d] * tree.axis[joint, d]
    return min(1.0, abs(along))
