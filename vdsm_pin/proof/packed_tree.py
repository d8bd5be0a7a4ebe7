"""A tree of joints as compiled code reads it, and where its frames stand."""

from functools import lru_cache
from math import cos, sin
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.proof.tree import Joint, Kind, Tree

FIXED: Final = 0
REVOLUTE: Final = 1
PRISMATIC: Final = 2
"""`Kind` as numbers."""

ASKEW: Final = 3
"""An axis that is none of the joint's own x (0), y (1) and z (2)."""

KEPT: Final = 8
"""Trees that are kept packed, for the next question about the same robot."""


class PackedTree(NamedTuple):
    """The joints of a tree; joint j carries frame j + 1.

    Args:
        parent: Frame that each hangs on, shape (n_joints,).
        kind: FIXED, REVOLUTE or PRISMATIC, shape (n_joints,).
        axis: Unit axes in the joints' own frames, shape (n_joints, 3); [-].
        along: Which coordinate axis that is, or ASKEW, shape (n_joints,).
        shift: Origin of a joint in its parent's frame, shape (n_joints, 3); [m].
        lever: Length of the shift, shape (n_joints,); [m].
        turned: Whether a placement rotates, shape (n_joints,).
        rotation: R_parent_joint, shape (n_joints, 3, 3); [-].
        column: Column of q, -1 for none, shape (n_joints,).
        ratio: Value per unit of q, shape (n_joints,).
        offset: Value at q = 0, shape (n_joints,); [rad] or [m].
        stroke: How large the values of prismatic joints get, inf where that is not
            known, shape (n_joints,); [m].
    """

    parent: IntArray
    kind: IntArray
    axis: FloatArray
    along: IntArray
    shift: FloatArray
    lever: FloatArray
    turned: BoolArray
    rotation: FloatArray
    column: IntArray
    ratio: FloatArray
    offset: FloatArray
    stroke: FloatArray


class Pose(NamedTuple):
    """Where all frames stand in one configuration.

    Args:
        origins: Shape (n_frames, 3); [m].
        frames: R_world_frame, shape (n_frames, 3, 3); [-].
    """

    origins: FloatArray
    frames: FloatArray


def _along(joint: Joint) -> tuple[int, float]:
    """The coordinate axis that a joint moves along or about, and in which sense."""
    axis = np.asarray(joint.axis)
    k = int(np.argmax(np.abs(axis)))
    whole = abs(axis[k]) == 1.0 and np.count_nonzero(axis) == 1
    return (k, float(axis[k])) if whole else (ASKEW, 1.0)


def _stroke(joint: Joint, reach: FloatArray | None) -> float:
    """How large the value of a prismatic joint gets; 0 for the others; [m]."""
    if joint.kind is not Kind.PRISMATIC:
        return 0.0
    if joint.column is None:
        return abs(joint.offset)
    most = np.inf if reach is None else float(reach[joint.column])
    return abs(joint.ratio) * most + abs(joint.offset)


def strokes(tree: Tree, reach: FloatArray | None) -> FloatArray:
    """The same of every joint, shape (n_joints,); [m]."""
    return np.array([_stroke(joint, reach) for joint in tree.joints])


def pack_tree(tree: Tree, reach: FloatArray | None = None) -> PackedTree:
    """The joints as compiled code reads them; axes along -x are taken along x.

    Args:
        tree: The joints.
        reach: How large each column of q gets, where that is known, (n_columns,).
    """
    return _packed(tree)._replace(stroke=strokes(tree, reach))


@lru_cache(maxsize=KEPT)
def _packed(tree: Tree) -> PackedTree:
    """The same without strokes."""
    joints = tree.joints
    n, along = len(joints), [_along(joint) for joint in joints]
    sense = np.array([sign for _, sign in along])
    placements = np.array([joint.placement for joint in joints]).reshape(n, 4, 4)
    rotation = np.ascontiguousarray(placements[:, :3, :3])
    shift = np.ascontiguousarray(placements[:, :3, 3])
    columns = [-1 if joint.column is None else joint.column for joint in joints]
    ratio = [0.0 if joint.column is None else joint.ratio for joint in joints]
    axis = np.array([joint.axis for joint in joints]).reshape(n, 3)
    return PackedTree(
        parent=np.array([joint.parent for joint in joints], dtype=np.int64),
        kind=np.array([joint.kind for joint in joints], dtype=np.int64),
        axis=axis * sense.reshape(n, 1),
        along=np.array([k for k, _ in along], dtype=np.int64),
        shift=shift,
        lever=np.sqrt((shift * shift).sum(axis=1)),
        turned=(rotation != np.eye(3)).any(axis=(1, 2)),
        rotation=rotation,
        column=np.array(columns, dtype=np.int64),
        ratio=np.array(ratio) * sense,
        offset=np.array([joint.offset for joint in joints]) * sense,
        stroke=np.zeros(0),
    )


@compiled
def new_pose(n_frames: int) -> Pose:
    """The world's frame; the others are to be written."""
    frames = np.zeros((n_frames, 3, 3))
    for c in range(3):
        frames[0, c, c] = 1.0
    return Pose(np.zeros((n_frames, 3)), frames)


@compiled
def _move_frame(
    tree: PackedTree, joint: int, value: float, origins: FloatArray, frames: FloatArray
) -> None:
    """The frame of a joint from that of its parent."""
    parent, kind, along = tree.parent[joint], tree.kind[joint], tree.along[joint]
    shift, axis, placed = tree.shift[joint], tree.axis[joint], tree.rotation[joint]
    turned, old, new = tree.turned[joint], frames[parent], frames[joint + 1]
    co, si = 1.0, 0.0
    if kind == REVOLUTE:
        co, si = cos(value), sin(value)
    for c in range(3):
        x, y, z = old[c, 0], old[c, 1], old[c, 2]
        at = origins[parent, c] + (x * shift[0] + y * shift[1] + z * shift[2])
        if turned:
            x, y, z = (
                x * placed[0, 0] + y * placed[1, 0] + z * placed[2, 0],
                x * placed[0, 1] + y * placed[1, 1] + z * placed[2, 1],
                x * placed[0, 2] + y * placed[1, 2] + z * placed[2, 2],
            )
        if kind == REVOLUTE:
            if along == 2:
                x, y = co * x + si * y, co * y - si * x
            elif along == 1:
                x, z = co * x - si * z, si * x + co * z
            elif along == 0:
                y, z = co * y + si * z, co * z - si * y
            else:
                u, v, w = axis[0], axis[1], axis[2]
                rest = (1.0 - co) * (x * u + y * v + z * w)
                x, y, z = (
                    co * x + si * (y * w - z * v) + rest * u,
                    co * y + si * (z * u - x * w) + rest * v,
                    co * z + si * (x * v - y * u) + rest * w,
                )
        elif kind == PRISMATIC:
            at += value * (x * axis[0] + y * axis[1] + z * axis[2])
        new[c, 0], new[c, 1], new[c, 2] = x, y, z
        origins[joint + 1, c] = at


@compiled(inline=False)
def place_tree(tree: PackedTree, q: FloatArray, pose: Pose) -> None:
    """All frames of one configuration q, shape (n_columns,)."""
    for joint in range(tree.parent.size):
        _move_joint(tree, q, joint, pose)


@compiled(inline=False)
def place_two(
    tree: PackedTree,
    q: FloatArray,
    frames: tuple[int, int],
    steps: IntArray,
    pose: Pose,
) -> None:
    """Two frames of one configuration and those that they hang on.

    Args:
        tree: The joints.
        q: Shape (n_columns,).
        frames: The two.
        steps: Working space, shape (n_frames,).
        pose: Written; other frames are as they were.
    """
    (one, other), size = frames, 0
    while one > 0 or other > 0:
        # The later one hangs on one that comes before it: they go down to the world.
        later = max(one, other)
        steps[size], size = later - 1, size + 1
        before = tree.parent[later - 1]
        one, other = (
            before if one == later else one,
            before if other == later else other,
        )
    for step in range(size - 1, -1, -1):
        _move_joint(tree, q, steps[step], pose)


@compiled
def _move_joint(tree: PackedTree, q: FloatArray, joint: int, pose: Pose) -> None:
    """The frame of a joint in a configuration q, from that of its parent."""
    column, value = tree.column[joint], tree.offset[joint]
    if column >= 0:
        value += tree.ratio[joint] * q[column]
    _move_frame(tree, joint, value, pose.origins, pose.frames)


class TreePoses:
    """Where the frames of a tree stand, as the proof has it.

    Args:
        tree: The joints.
    """

    def __init__(self, tree: Tree) -> None:
        self._packed = pack_tree(tree)

    def __call__(self, q: FloatArray) -> FloatArray:
        """T_world_frame at rows of q (n, n_columns), shape (n, n_frames, 4, 4); [m]."""
        rows = np.ascontiguousarray(q, dtype=np.float64)
        return np.asarray(place_rows(self._packed, rows))


@compiled
def place_rows(tree: PackedTree, q: FloatArray) -> FloatArray:
    """All frames at rows of q (n_rows, n_columns), (n_rows, n_frames, 4, 4)."""
    tree = borrowed(tree)
    n = tree.parent.size + 1
    pose, out = new_pose(n), np.zeros((q.shape[0], n, 4, 4))
    for row in range(q.shape[0]):
        place_tree(tree, q[row], pose)
        for frame in range(n):
            placed = out[row, frame]
            for c in range(3):
                for d in range(3):
                    placed[c, d] = pose.frames[frame, c, d]
                placed[c, 3] = pose.origins[frame, c]
            placed[3, 3] = 1.0
    return out
