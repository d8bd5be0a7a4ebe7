"""That a point lies outside a mesh (docs/certificate.md, Meshes)."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import claim

DOUBT: Final = 2.0**-44
"""Error of a triple product over the lengths of its factors: 20 units of 2^-53, and
this is 512."""

GAP: Final = 2e-4  # over the mesh's diagonal: corners are joined and seams reach so far
WALL: Final = 1e-6  # over the diagonal: no thicker than a face that is given twice
FLAT: Final = 1e-12  # over the diagonal: the height of a triangle without area
N_RAYS: Final = 24


class Surface:
    """Triangles of a mesh, corners joined where the certificate says so, and seams.

    Args:
        corners: Of the file's triangles, shape (m, 3, 3); [m].
        only: Whether the problem says that it has no inside.
    """

    def __init__(self, corners: Any, only: bool = False) -> None:
        self.only = only
        self.given = np.array(corners).reshape(-1, 3) + 0.0  # makes -0 and 0 equal
        self.names = np.unique(self.given, axis=0, return_inverse=True)[1].reshape(-1)
        self.size = float(np.linalg.norm(np.ptp(self.given, axis=0)))
        self.at = np.arange(len(self.given))  # which corner each corner is joined with
        self.gap = 0.0

    def join(self, corners: Any, seams: Any) -> None:
        """Join corners and add thin triangles.

        Args:
            corners: Pairs of a corner and the one that it is joined with.
            seams: The corners of each, and the one where the edge beside it begins.
        """
        moved, thin = (np.array(part, dtype=int) for part in (corners, seams))
        moved, thin = moved.reshape(-1, 2), thin.reshape(-1, 4)
        self.at[moved[:, 0]] = moved[:, 1]
        off = self.given[self.at] - self.given
        self.gap = float(np.linalg.norm(off, axis=1).max())
        start, after = thin[:, 3], thin[:, 3] // 3 * 3 + (thin[:, 3] + 1) % 3
        along = self.given[after] - self.given[start]
        for corner in thin[:, :3].T:
            away = self.given[corner] - self.given[start]
            share = (away * along).sum(axis=1) / (along**2).sum(axis=1)
            off = np.linalg.norm(away - share.clip(0, 1)[:, None] * along, axis=1)
            self.gap = max(self.gap, float(off.max(initial=0.0)))
        claim(self.gap <= 1.001 * GAP * self.size, "corners far apart are joined")
        self.at = np.concatenate([self.at, thin[:, :3].reshape(-1)])

    def closed(self) -> tuple[Any, ...]:
        """What `covers` says of the triangles, which have three corners, and those."""
        rows = self.names[self.at].reshape(-1, 3)
        corners = self.given[self.at].reshape(-1, 3, 3)
        whole = (rows != np.roll(rows, 1, axis=1)).all(axis=1)
        count, solid = len(self.given) // 3, heights(corners) > FLAT * self.size
        solid[count:] = True  # seams are thin
        for kept in (whole, whole & solid):
            signed, single, turned = covers(rows, kept, count)
            if signed.any() or single.any():
                break
        return signed, single, turned, whole, corners[whole]

    def not_outside(self, point: Any, radius: float) -> str:
        """Why a point of the arm's axis is not proved outside; empty where it is."""
        if self.only:
            return ""
        signed, single, turned, whole, corners = self.closed()
        if not (signed | single).any():
            return "the mesh is not closed"
        if self.gap and not self.gap < 0.999 * radius:
            return "its gaps are as wide as the arm"
        seen: set[float] = set()
        for triangle, sense, place in crossings(corners, point):
            if not triangle.size:
                return ""
            here = np.flatnonzero(whole)[triangle]
            if sense[signed[here]].sum() or single[here].sum() % 2:
                return "it is inside"
            seen |= {*sense[place <= place.min() + WALL * self.size]}
        sure = len(seen) == 1 and signed.any() and not turned
        return "" if sure else "its faces are turned both ways"


def heights(corners: Any) -> Any:
    """Smallest heights of triangles, shape (m, 3, 3) to (m,); [m]."""
    sides = np.roll(corners, -1, axis=1) - corners
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    return area / np.where(longest > 0.0, longest, 1.0)


def edges_of(rows: Any) -> Any:
    """Edges of triangles in their senses, shape (m, 3) to (3 m, 2)."""
    return np.stack([rows, np.roll(rows, -1, axis=1)], axis=2).reshape(-1, 2)


def numbered(rows: Any) -> tuple[Any, Any]:
    """Where different rows occur first, and which of those each row is."""
    _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, number.reshape(-1)


def border(rows: Any, signed: bool) -> set[tuple[int, ...]]:
    """Edges of triangles that do not cancel, senses observed or not."""
    edges = edges_of(rows)
    first, edge = numbered(np.sort(edges, axis=1))
    senses = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    times = np.bincount(edge, senses) if signed else np.bincount(edge) % 2
    return {*map(tuple, np.sort(edges[first[times != 0]], axis=1).tolist())}


def covers(rows: Any, kept: Any, count: int) -> tuple[Any, Any, bool]:
    """Which of the kept triangles close, and whether some are given in both senses.

    Args:
        rows: Names of the corners of the file's triangles, then of the seams.
        kept: Which of them count, shape (m + s,).
        count: How many are the file's: m.

    Returns:
        Those that close with their senses, and those that do as a single cover; none
        where none do.
    """
    own, none = np.flatnonzero(kept[:count]), np.zeros(len(rows), bool)
    turns = (rows[own].argmin(axis=1)[:, None] + np.arange(3)) % 3
    in_sense, _ = numbered(np.take_along_axis(rows[own], turns, axis=1))
    first, face = numbered(np.sort(rows[own], axis=1))
    both = (np.bincount(face[in_sense]) == 2)[face]
    once, single, lone = (np.arange(len(rows)) >= count for _ in range(3))
    once[own[in_sense]] = single[own[first]] = lone[own[~both]] = True
    loose = border(rows[single], signed=False)
    walls = np.sort(edges_of(rows[lone]), axis=1).tolist()
    whole = (mask for mask in (kept, once) if not border(rows[mask], signed=True))
    signed = next(whole, none) if loose <= {*map(tuple, walls)} else none
    return signed, none if loose else single, bool(both.any())


def crossings(corners: Any, point: Any) -> Iterator[tuple[Any, Any, Any]]:
    """What rays from a point cross of triangles; rays that meet edges are left out.

    Args:
        corners: Shape (m, 3, 3); [m].
        point: Not on a triangle, shape (3,); [m].

    Yields:
        For each ray the triangles, 1 where it passes outwards and -1 inwards, and how
        far away.
    """
    view, origin = corners - point, arb_mat([[*map(float, point)]])
    normals = np.cross(view, np.roll(view, -1, axis=1))
    lengths = np.linalg.norm(view, axis=2)
    doubts = DOUBT * lengths * np.roll(lengths, -1, axis=1)
    heights = (normals[:, 0] * view[:, 2]).sum(axis=1)
    ahead = np.sign(heights) * (abs(heights) > DOUBT * lengths.prod(axis=1))
    for k in range(N_RAYS):
        z, angle = 1 - (2 * k + 1) / N_RAYS, np.pi * (1 + 5**0.5) * (k + 0.5) + 0.3
        across = (1 - z * z) ** 0.5
        ray = np.array([across * np.cos(angle), across * np.sin(angle), z])
        turns, before = normals @ ray, ahead.copy()
        signs = np.sign(turns) * (abs(turns) > doubts)
        settled = (signs.min(axis=1) < 0) & (signs.max(axis=1) > 0)
        met = (abs(signs.sum(axis=1)) == 3) & (before != 0)
        for i in np.flatnonzero(~settled & ~met):
            a, b, c = (arb_mat([[*map(arb, x.tolist())]]) - origin for x in corners[i])
            d, before[i] = arb_mat([ray.tolist()]), sign(a, b, c)
            signs[i] = sign(d, a, b), sign(d, b, c), sign(d, c, a)
        settled = (signs.min(axis=1) < 0) & (signs.max(axis=1) > 0)
        settled |= before * signs.sum(axis=1) < 0
        met = (abs(signs.sum(axis=1)) == 3) & (before == signs[:, 0]) & ~settled
        if (settled | met).all():
            found = np.flatnonzero(met)
            yield found, signs[found, 0], heights[found] / turns[found].sum(axis=1)


def sign(*rows: Any) -> int:
    """Sign of the determinant of three rows, 0 where it is in doubt."""
    value = arb_mat([row.entries() for row in rows]).det()
    return int(value > 0) - int(value < 0)
