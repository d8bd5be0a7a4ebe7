"""Triangles made a closed surface, where they are one or nearly so.

A closed surface has an inside (`geometry/winding.py`). Triangles close where every edge
runs as often forwards as backwards; where they are turned both ways, at least an even
number of them must meet at every edge. Where neighbours miss each other by little,
corners are joined, and a corner on the edge of a neighbour is joined to it by a seam: a
triangle as thin as the gap. Only the inside is asked of the joined surface; distances
are those of the triangles as they are.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray, distinct, frozen
from vdsm_pin.geometry.mesh_edges import (
    NO_SEAMS,
    Covers,
    Seams,
    attached,
    closes,
    clusters,
    counted,
    off_segment,
    open_edges,
    seams_along,
    welded,
)
from vdsm_pin.tolerances import TOLERANCES

FINER: Final = (5e-4, 5e-2, 1.0)
"""Gaps tried, over the largest that is joined, until one suffices; [-]."""

SOLID: Final = 1
"""A triangle of a mesh with an inside."""

SIGNED: Final = 2
"""It counts with its sense where the inside is asked for."""

SINGLE: Final = 4
"""It counts in the single cover."""


@dataclass(frozen=True)
class ClosedMesh:
    """How m triangles make a closed surface, if they do.

    Args:
        vertices: Shape (n, 3); [m].
        triangles: Vertex numbers: the triangles with their corners joined, then the
            seams, shape (m + s, 3).
        beside: The edge each seam lies along: three times the number of a triangle plus
            that of the corner where the edge begins, shape (s,).
        signed: Which of them close with their senses, shape (m + s,); none may.
        single: Which close as a single cover whatever their senses, likewise; asked
            for only where senses do not decide.
        turned: Whether a triangle is given in both senses.
        gap: How far a corner was moved or a seam reaches from its edge; [m].
        n_open: Edges without a partner; 0 where the surface is closed.
        size: Diagonal of the box around it; [m].
    """

    vertices: FloatArray
    triangles: IntArray
    beside: IntArray
    signed: BoolArray
    single: BoolArray
    turned: bool
    gap: float
    n_open: int
    size: float

    @property
    def closed(self) -> bool:
        """Whether there is an inside."""
        return self.n_open == 0

    @property
    def covers(self) -> IntArray:
        """SOLID, SIGNED and SINGLE, added, for each of the m triangles."""
        count = len(self.triangles) - len(self.beside)
        signed, single = self.signed[:count], self.single[:count]
        return np.asarray(SOLID + SIGNED * signed + SINGLE * single)

    @property
    def why_open(self) -> str:
        """Why there is no inside, in words."""
        edges = f"{self.n_open} edges have" if self.n_open > 1 else "an edge has"
        return f"is not closed: {edges} no partner"

    @property
    def corners(self) -> FloatArray:
        """Corners of the closed surface, shape (m + s, 3, 3); [m]."""
        return self.vertices[self.triangles]


def close_mesh(vertices: FloatArray, triangles: IntArray) -> ClosedMesh:
    """Find the closed surface of some triangles.

    Args:
        vertices: Shape (n, 3); [m].
        triangles: Vertex numbers, shape (m, 3), m >= 1.
    """
    search = _Search(vertices, vertices[triangles])
    names, flat = welded(vertices, triangles)[triangles], search.flat
    found = search.closed_as_given(names)
    for share in FINER if found is None else ():
        found = search.joined(names, ~flat, share * search.most)
        if found is not None:
            return found
    return search.open_mesh(names, ~flat) if found is None else found


def closed_parts(corners: FloatArray) -> IntArray | None:
    """Which closed surface each triangle is of, where there is nothing to join.

    Triangles that share a corner are of the same one, and so on: each edge of a closed
    mesh has its partners within one of them, which therefore closes by itself.

    Args:
        corners: Of the triangles, shape (m, 3, 3); [m].

    Returns:
        Numbers from 0, shape (m,); None where the mesh is open as it is given.
    """
    points = corners.reshape(-1, 3)
    rows = np.arange(len(points)).reshape(-1, 3)
    names = welded(points, rows)[rows]
    if _Search(points, corners).closed_as_given(names) is None:
        return None
    label = np.arange(len(points))
    while True:
        least = label[names].min(axis=1)
        np.minimum.at(label, names, least[:, None])
        label = label[label]
        if (label[names] == least[:, None]).all():
            return np.asarray(np.unique(least, return_inverse=True)[1])


@dataclass(frozen=True)
class _Search:
    """Ways to take some triangles as a closed surface.

    Args:
        vertices: Shape (n, 3); [m].
        corners: As given, shape (m, 3, 3); [m].
    """

    vertices: FloatArray
    corners: FloatArray

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around all triangles; [m]."""
        return float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))

    @property
    def most(self) -> float:
        """The largest gap that is joined; [m]."""
        return TOLERANCES.mesh_gap * self.size

    @cached_property
    def flat(self) -> BoolArray:
        """Which triangles have no area, shape (m,)."""
        return _heights(self.corners) <= TOLERANCES.mesh_flat * self.size

    def closed_as_given(self, names: IntArray) -> ClosedMesh | None:
        """The surface of all triangles, or of those that have an area, as they are."""
        every = np.ones(len(names), np.bool_)
        found = self._covered(names, counted(names, every), 0.0)
        if found is None and self.flat.any():
            found = self._covered(names, counted(names, ~self.flat), 0.0)
        return found

    def joined(self, names: IntArray, kept: BoolArray, gap: float) -> ClosedMesh | None:
        """The same with corners joined that are no farther apart than a gap."""
        edges, _ = open_edges(names[counted(names, kept).single], signed=False)
        moved = clusters(self.vertices, names, distinct(edges), gap)[names]
        covers = counted(moved, kept)
        found = self._covered(moved, covers, 0.0) or self._covered(moved, covers, gap)
        return found if found is not None and found.gap <= self.most else None

    def open_mesh(self, names: IntArray, kept: BoolArray) -> ClosedMesh:
        """What there is to say where nothing closes."""
        edges, _ = open_edges(names[counted(names, kept).single], signed=False)
        none = np.zeros(len(names), np.bool_)
        found = self._result(names, NO_SEAMS, none, none, turned=False)
        return replace(found, n_open=max(1, len(edges)))

    def _covered(
        self, names: IntArray, covers: Covers, gap: float
    ) -> ClosedMesh | None:
        """The surface of triangles and, where a gap is given, of seams as wide."""
        none = np.zeros(len(names), np.bool_)
        signed, single = none, none
        turned = bool((covers.whole & ~covers.lone).any())
        for mask in (covers.whole, covers.once):
            seams = self._seams(names, mask, gap, signed=True)
            with_seams = np.concatenate([names[mask], seams.triangles])
            if closes(with_seams, signed=True) and attached(
                names, covers, seams.triangles
            ):
                signed = mask
                break
        if not signed.any():
            seams = self._seams(names, covers.single, gap, signed=False)
        if turned or not signed.any():
            with_seams = np.concatenate([names[covers.single], seams.triangles])
            single = covers.single if closes(with_seams, signed=False) else none
        if not signed.any() and not single.any():
            return None
        return self._result(names, seams, signed, single, turned=turned)

    def _seams(
        self, names: IntArray, mask: BoolArray, gap: float, *, signed: bool
    ) -> Seams:
        """Seams along the open edges of some triangles."""
        if not gap > 0.0:
            return NO_SEAMS
        edges, where = open_edges(names[mask], signed=signed)
        at = 3 * np.flatnonzero(mask)[where // 3] + where % 3
        return seams_along(self.vertices, edges, at, gap)

    def _result(
        self,
        names: IntArray,
        seams: Seams,
        signed: BoolArray,
        single: BoolArray,
        *,
        turned: bool,
    ) -> ClosedMesh:
        off = float(np.linalg.norm(self.vertices[names] - self.corners, axis=2).max())
        begin = self.corners.reshape(-1, 3)[seams.beside]
        end = np.roll(self.corners, -1, axis=1).reshape(-1, 3)[seams.beside]
        for corner in self.vertices[seams.triangles].swapaxes(0, 1):
            off = max(off, off_segment(corner, begin, end)[1].max(initial=0.0))
        extra = np.ones(len(seams.beside), np.bool_)
        return ClosedMesh(
            vertices=self.vertices,
            triangles=frozen(np.concatenate([names, seams.triangles]), np.int64),
            beside=frozen(seams.beside, np.int64),
            signed=frozen(np.concatenate([signed, extra & signed.any()]), np.bool_),
            single=frozen(np.concatenate([single, extra & single.any()]), np.bool_),
            turned=turned,
            gap=off,
            n_open=0,
            size=self.size,
        )


def _heights(corners: FloatArray) -> FloatArray:
    """Smallest height of triangles, corners of shape (m, 3, 3); [m]."""
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.asarray(
        np.divide(area, longest, out=np.zeros(len(area)), where=longest > 0.0)
    )
