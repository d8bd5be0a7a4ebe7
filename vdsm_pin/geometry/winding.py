"""On which side of a closed surface a point lies, in exact arithmetic.

The winding number counts how often the surface runs round the point: the crossings of
any ray from it, outwards less inwards. Signs of products are taken in floating point
where the rounding cannot matter and in rational numbers elsewhere.
"""

from enum import Enum
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.geometry.closed_meshes import ClosedMesh
from vdsm_pin.tolerances import TOLERANCES

DOUBT: Final = 2.0**-44
"""Error of a triple product over the lengths of its factors: 20 units of 2^-53 at most,
and this is 512."""

N_RAYS: Final = 24
"""Rays looked along."""


class Side(Enum):
    """Where a point lies."""

    OUTSIDE = "outside"
    INSIDE = "inside"
    UNKNOWN = "unknown"


class Location(NamedTuple):
    """Where the arm lies as seen from a mesh, and where that is unknown, why.

    Of a mesh without known inside the convex hull decides: whatever counts as inside
    lies in it, so that an arm that keeps clear of it is outside.

    Args:
        side: Where.
        reason: Why that is unknown.
        who: The arm, or what of a robot lies there.
    """

    side: Side
    reason: str = ""
    who: str = "the arm"

    def words(self, mesh: str) -> str:
        """The same of a mesh of that name as a sentence."""
        if self.side is not Side.UNKNOWN:
            return f"{self.who} is {self.side.value} {mesh!r}"
        return (
            f"whether {self.who} is inside {mesh!r} cannot be decided: {self.reason}, "
            f"and {self.who} is not proved clear of its convex hull; write `solid: "
            f"false` under {mesh!r} in the problem file if only its surface is meant"
        )


class _Hits(NamedTuple):
    """Crossings of a ray: triangles, 1 outwards and -1 inwards, places along it."""

    triangle: IntArray
    sense: IntArray
    place: FloatArray


def _rays() -> FloatArray:
    """Directions spread evenly without symmetry, shape (N_RAYS, 3); [-]."""
    k = np.arange(N_RAYS) + 0.5
    z = 1.0 - 2.0 * k / N_RAYS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k + 0.3
    across = np.sqrt(1.0 - z * z)
    return frozen(np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1))


RAYS: Final = _rays()


class _View:
    """A surface seen from a point: the planes through it and the edges."""

    def __init__(self, corners: FloatArray, point: FloatArray) -> None:
        self.corners, self.point = corners, point
        self.seen = corners - point
        self.normals = np.cross(self.seen, np.roll(self.seen, -1, axis=1))
        lengths = np.linalg.norm(self.seen, axis=2)
        self.doubt = DOUBT * lengths * np.roll(lengths, -1, axis=1)
        self.height = (self.normals[:, 0] * self.seen[:, 2]).sum(axis=1)
        self.high = DOUBT * lengths.prod(axis=1)

    def hits(self, ray: FloatArray) -> _Hits | None:
        """What a ray crosses; None where it meets an edge, or starts on the surface."""
        turns = self.normals @ ray
        signs = np.sign(turns) * (np.abs(turns) > self.doubt)
        missed = (signs.min(axis=1) < 0.0) & (signs.max(axis=1) > 0.0)
        sure = (np.abs(signs.sum(axis=1)) == 3.0) & (np.abs(self.height) > self.high)
        ahead = np.flatnonzero(sure & (np.sign(self.height) == signs[:, 0]))
        senses = signs[ahead, 0].astype(np.int64)
        places = self.height[ahead] / turns[ahead].sum(axis=1)
        doubtful = np.flatnonzero(~missed & ~sure).tolist()
        exact = [self._exact(k, ray) for k in doubtful]
        if None in exact:
            return None
        more = [(k, *one) for k, one in zip(doubtful, exact, strict=True) if one]
        triangles, turned, at = np.array(more, float).reshape(-1, 3).T
        crossed = turned != 0.0
        return _Hits(
            np.concatenate([ahead, triangles[crossed].astype(np.int64)]),
            np.concatenate([senses, turned[crossed].astype(np.int64)]),
            np.concatenate([places, at[crossed]]),
        )

    def _exact(self, k: int, ray: FloatArray) -> tuple[int, float] | None:
        """Sense and place of one crossing, sense 0 for none; None on an edge."""
        origin = [Fraction(float(x)) for x in self.point]
        d = [Fraction(float(x)) for x in ray]
        a, b, c = (
            [Fraction(float(x)) - o for x, o in zip(corner, origin, strict=True)]
            for corner in self.corners[k]
        )
        turns = [_triple(d, p, q) for p, q in ((a, b), (b, c), (c, a))]
        if min(turns) < 0 < max(turns):
            return 0, 0.0
        height, turn = _triple(a, b, c), sum(turns)
        if height * turn < 0:
            return 0, 0.0  # behind the point
        if 0 in turns or height == 0:
            return None
        return (1 if height > 0 else -1), float(height / turn)


def _triple(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> Fraction:
    """Product a . (b x c)."""
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def locate(mesh: ClosedMesh, point: FloatArray, radius: float) -> Location:
    """Where a point of the arm's axis lies, farther from the surface than its radius.

    Inside where the surface winds round the point, or a single cover of it does in the
    odd. Outside where it does not and either a ray meets nothing, or all that is seen
    from the point are fronts, or all are backs.

    Args:
        mesh: The surface.
        point: Shape (3,); [m].
        radius: Of the arm, which passes through no narrower gap; [m].
    """
    if not mesh.closed:
        return Location(Side.UNKNOWN, f"it {mesh.why_open}")
    if mesh.gap and not mesh.gap < radius:
        return Location(Side.UNKNOWN, "its gaps are as wide as the arm")
    corners = mesh.corners
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    if not ((low <= point) & (point <= high)).all():
        return Location(Side.OUTSIDE)
    thin = TOLERANCES.mesh_wall * mesh.size
    whole = (mesh.triangles != np.roll(mesh.triangles, 1, axis=1)).all(axis=1)
    signed, single = mesh.signed[whole], mesh.single[whole]
    view, seen = _View(corners[whole], point), set[int]()
    for hits in filter(None, map(view.hits, RAYS)):
        if not len(hits.triangle):
            return Location(Side.OUTSIDE)
        if hits.sense[signed[hits.triangle]].sum() or single[hits.triangle].sum() % 2:
            return Location(Side.INSIDE)
        first = hits.place <= hits.place.min() + thin
        seen |= set(hits.sense[first].tolist())
    return _enclosed(mesh, seen)


def _enclosed(mesh: ClosedMesh, seen: set[int]) -> Location:
    """Where a point lies that no ray leaves freely, though nothing winds round it."""
    if not seen:
        return Location(Side.UNKNOWN, "the arm's axis lies on its surface")
    if mesh.turned:
        return Location(Side.UNKNOWN, "it has faces that are given in both senses")
    if not mesh.signed.any():
        return Location(Side.UNKNOWN, "neighbouring faces are turned opposite ways")
    if len(seen) > 1:
        reason = "round the arm are fronts of its faces as well as backs"
        return Location(Side.UNKNOWN, reason)
    return Location(Side.OUTSIDE)
