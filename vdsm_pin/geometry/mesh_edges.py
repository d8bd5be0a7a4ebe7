"""Which triangles of a mesh close, by the numbers of their corners, and their gaps."""

from typing import Final, NamedTuple

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


MANY: Final = 10_000_000
"""Most pairs of open edges and corners looked at for seams."""

SLANT: Final = np.array([0.642, 0.377, 0.667])
"""A direction along which few corners of a mesh lie side by side, not longer than 1, so
that no two are farther apart along it than they are; [-]."""


class Seams(NamedTuple):
    """Thin triangles, shape (s, 3), and the edges they lie along, as `ClosedMesh`."""

    triangles: IntArray
    beside: IntArray


NO_SEAMS: Final = Seams(np.zeros((0, 3), np.int64), np.zeros(0, np.int64))


def off_segment(
    points: FloatArray, begin: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where points lie along segments, 0 to 1, and how far off, shape (n,) each."""
    along = end - begin
    square = (along * along).sum(axis=1)
    share = ((points - begin) * along).sum(axis=1)
    share = np.divide(share, square, out=np.zeros(len(share)), where=square > 0.0)
    nearest: FloatArray = begin + np.clip(share, 0.0, 1.0)[:, None] * along
    return share, np.asarray(np.linalg.norm(points - nearest, axis=1))


def clusters(
    vertices: FloatArray, names: IntArray, loose: IntArray, gap: float
) -> IntArray:
    """For each vertex the one that it is joined with, shape (n,).

    Args:
        vertices: Shape (n, 3); [m].
        names: Vertices of the triangles.
        loose: Vertices on open edges; only these are joined, to any vertex.
        gap: Largest distance of two that are joined; [m].
    """
    used = distinct(names)
    order = used[np.argsort(vertices[used] @ SLANT)]
    place, is_loose = vertices[order], np.isin(order, loose)
    height = place @ SLANT
    found = [np.zeros((0, 2), np.int64)]
    for step in range(1, len(order)):
        near = height[step:] - height[:-step] <= gap
        if not near.any():
            break
        near &= is_loose[step:] | is_loose[:-step]
        a = np.flatnonzero(near)
        close = np.linalg.norm(place[a + step] - place[a], axis=1) <= gap
        found.append(np.stack([order[a], order[a + step]], axis=1)[close])
    pairs, joined = np.concatenate(found), np.arange(len(vertices))
    while len(pairs):
        least = joined.copy()
        np.minimum.at(least, pairs[:, 0], joined[pairs[:, 1]])
        np.minimum.at(least, pairs[:, 1], joined[pairs[:, 0]])
        least = least[least]
        if (least == joined).all():
            break
        joined = least
    return joined


def seams_along(
    vertices: FloatArray, edges: IntArray, at: IntArray, gap: float
) -> Seams:
    """Thin triangles between open edges and the corners of others that lie on them.

    Args:
        vertices: Shape (n, 3); [m].
        edges: First and last corner of open edges, shape (k, 2).
        at: What `ClosedMesh.beside` says of a seam along each, shape (k,).
        gap: How far off an edge a corner may lie; [m].
    """
    loose = distinct(edges)
    loose = loose[np.argsort(vertices[loose] @ SLANT)]
    height, ends = vertices[loose] @ SLANT, vertices[edges] @ SLANT
    first = np.searchsorted(height, ends.min(axis=1) - gap, side="left")
    last = np.searchsorted(height, ends.max(axis=1) + gap, side="right")
    count = last - first
    if count.sum() > MANY:
        return NO_SEAMS
    edge = np.repeat(np.arange(len(edges)), count)
    corner = loose[np.arange(len(edge)) - np.repeat(np.cumsum(count) - last, count)]
    share, off = off_segment(
        vertices[corner], vertices[edges[edge, 0]], vertices[edges[edge, 1]]
    )
    on = (share > 0.0) & (share < 1.0) & (off <= gap)  # its own ends lie at 0 and 1
    edge, corner, share = edge[on], corner[on], share[on]
    order = np.lexsort((share, edge))
    edge, corner = edge[order], corner[order]
    is_last = np.append(edge[1:] != edge[:-1], True)[: len(edge)]
    after = np.where(is_last, edges[edge, 1], np.roll(corner, -1))
    return Seams(np.stack([edges[edge, 0], corner, after], axis=1), at[edge])
