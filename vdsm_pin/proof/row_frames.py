"""Where the frames of a tree stand over a block of rows, compiled."""

from math import cos, sin

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.packed_tree import PRISMATIC, REVOLUTE, PackedTree
from vdsm_pin.proof.rows import Rows, blend, carry


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


@compiled(inline=False)
def move_frame(
    tree: PackedTree, motion: Motion, rows: Rows, first: int, n: int, joint: int
) -> None:
    """The frame of a joint in the rows of a block, from its parent's."""
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
