"""Gaps between triangles: corners to join, and seams between an edge and corners."""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct

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
