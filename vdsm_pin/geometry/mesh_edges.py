"""Which triangles of a mesh close, by the numbers of their corners alone."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    distinct,
    first_equal,
)


class Covers(NamedTuple):
    """Triangles to count, shape (m,) each.

    All of them, in each sense once, once; and those given in one sense alone.
    """

    whole: BoolArray
    once: BoolArray
    single: BoolArray
    lone: BoolArray


def welded(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """For each vertex of triangles the first of theirs equal to it, shape (n,)."""
    used = distinct(triangles)
    first, index = first_equal(vertices[used])
    names = np.arange(len(vertices))
    names[used] = used[first[index]]
    return names


def counted(names: IntArray, kept: BoolArray) -> Covers:
    """What counts of the kept triangles, those with equal corners aside."""
    whole = kept & (names != np.roll(names, 1, axis=1)).all(axis=1)
    rows, mine = np.flatnonzero(whole), names[whole]
    order = np.argsort(mine, axis=1)
    face = np.take_along_axis(mine, order, axis=1)
    _, rank = np.unique(_key(face[:, 0], face[:, 1]), return_inverse=True)
    key = _key(rank, face[:, 2])
    if len(distinct(key)) == len(key):
        return Covers(whole, whole, whole, whole)
    backwards = (order[:, 0] - order[:, 1]) % 3 == 1
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    sense, in_sense = np.unique(2 * number + backwards, return_index=True)
    senses = np.bincount(sense // 2)
    once, single, lone = np.zeros((3, len(names)), np.bool_)
    once[rows[in_sense]] = single[rows[first]] = True
    lone[rows] = senses[number] == 1
    return Covers(whole, once, single, lone)


def _key(low: IntArray, high: IntArray) -> IntArray:
    """One number for two that are below 2^31."""
    return np.asarray(low << 31 | high)


def edge_keys(names: IntArray) -> tuple[IntArray, BoolArray]:
    """A number for each edge, whichever way it runs, and whether it runs upwards."""
    begin, end = names.reshape(-1), np.roll(names, -1, axis=1).reshape(-1)
    return _key(np.minimum(begin, end), np.maximum(begin, end)), begin < end


def closes(names: IntArray, *, signed: bool) -> bool:
    """Whether triangles without equal corners leave no edge open."""
    keys, up = edge_keys(names)
    if not signed:
        keys = np.sort(keys)
        return keys.size % 2 == 0 and bool((keys[0::2] == keys[1::2]).all())
    forwards, backwards = np.sort(keys[up]), np.sort(keys[~up])
    return forwards.size == backwards.size and bool((forwards == backwards).all())


def attached(names: IntArray, covers: Covers, seams: IntArray) -> bool:
    """Whether triangles given in both senses end on others, if they end.

    A wall between two bodies does. A sheet drawn from both sides cancels out with its
    senses, whatever hole it has, and must not pass for closed.
    """
    if (covers.lone == covers.whole).all():
        return True
    cover = np.concatenate([names[covers.single], seams])
    edges, _ = open_edges(cover, signed=False)
    walls, _ = edge_keys(np.concatenate([names[covers.lone], seams]))
    return bool(np.isin(_key(edges.min(axis=1), edges.max(axis=1)), walls).all())


def open_edges(names: IntArray, *, signed: bool) -> tuple[IntArray, IntArray]:
    """Edges that do not cancel, each as often as it is over and in that sense.

    Args:
        names: Triangles without equal corners, shape (m, 3).
        signed: Whether opposite senses cancel, or any two.

    Returns:
        First and last corner, shape (k, 2); and a place where each occurs, three times
        its row in `names` plus its column, shape (k,).
    """
    keys, up = edge_keys(names)
    _, first, edge = np.unique(keys, return_index=True, return_inverse=True)
    count = np.bincount(edge, np.where(up, 1.0, -1.0) if signed else None)
    over = np.asarray(count if signed else count % 2).astype(np.int64)
    at, over = first[over != 0], over[over != 0]
    begin, end = names.reshape(-1)[at], np.roll(names, -1, axis=1).reshape(-1)[at]
    swap = (over > 0) != up[at] if signed else np.zeros(len(at), np.bool_)
    edges = np.stack([np.where(swap, end, begin), np.where(swap, begin, end)], axis=1)
    return np.repeat(edges, abs(over), axis=0), np.repeat(at, abs(over))
