"""Solids as the checker sees them: support functions.

A solid is the union of convex pieces, and a piece the hull of a few points grown by a
ball or a disc. Of a half-space the point that its plane goes through is enough.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise, product
from typing import Any, Final

import numpy as np
from flint import arb

from vdsm_pin import scene
from vdsm_pin.certificate_checker.balls import Ball, Matrix, claim, column, dot, unit
from vdsm_pin.certificate_checker.inside import Surface

ROUNDING: Final = 2.0**-46
"""Error of a height in doubles over the extent of the points; [-].

A point is a sum of four terms and off by 28 units of 2^-53 at most, its product with a
rounded n by seven: 35 in all, and this is 128.
"""


class Solid:
    """An obstacle, or a link in its own frame.

    Args:
        name: Name in the certificate.
        points: Of each piece, shape (n_pieces, k, 3); [m].
        origin: What the points were computed from, shape (3,); [m].
        radius: Of the ball that grows the pieces; [m].
    """

    def __init__(
        self, name: str, points: Any, *, origin: Any = 0.0, radius: float = 0.0
    ) -> None:
        self.name, self.points, self.radius = name, np.array(points), arb(radius)
        self.whole = True  # whether every plane so far serves all pieces
        self.disc: tuple[Matrix, Ball] | None = None  # axis and radius of a cylinder
        self.normal: Matrix | None = None  # of a half-space
        self.ends: Any = None  # of a prism: its corners at both, shape (2, c, 3)
        self.extent = float(np.abs(self.points).max() + np.abs(origin).max())

    def support(self, n: Matrix, first: int, last: int) -> Ball:
        """Least n.x over the pieces first..last-1, for a unit n."""
        rounded = np.array([float(entry) for entry in n.entries()])
        least = (self.points[first:last].reshape(-1, 3) @ rounded).min()
        height = arb(float(least), self.extent * ROUNDING) - self.radius
        if self.disc is not None:
            axis, radius = self.disc
            height -= radius * (1 - dot(axis, n) ** 2).nonnegative_part().sqrt()
        return height

    def direction(self, n: Matrix) -> Matrix:
        """The exact direction that n stands for: a half-space has only one."""
        if self.normal is None:
            return n
        off = (n + self.normal).entries()
        claim(all(abs(x) <= 1e-9 for x in off), "n is not the half-space's -normal")
        return -self.normal

    def cut(self, pieces: list[Any]) -> None:
        """Take the certificate's pieces: parts of a prism, or the mesh's in its order.

        Args:
            pieces: Corner numbers of polygons that make up the prism's section, all
                of as many corners; or a permutation of the numbers of the triangles.
        """
        parts = f"pieces of {self.name} do not make up the whole"
        if self.ends is None:
            claim(sorted(pieces) == [*range(len(self.points))], parts)
            self.points = self.points[np.array(pieces, dtype=int)]
            return
        corners = range(self.ends.shape[1])
        claim(sum(map(len, pieces)) <= 3 * len(corners), parts)  # as many as triangles
        claim(boundary(pieces) == boundary([corners]), parts)
        self.points = np.concatenate(self.ends[:, np.array(pieces, dtype=int)], axis=1)


def boundary(loops: Iterable[Sequence[int]]) -> dict[tuple[int, int], int]:
    """How often loops run along each edge, forwards less backwards, where not equal.

    Loops of the same boundary wind round each point equally often in sum. A polygon
    winds round every point of its inside, so one of the loops does: its hull has it.
    """
    chain: Counter[tuple[int, int]] = Counter()
    for loop in loops:
        for i, j in pairwise([*loop, loop[0]]):
            chain[min(i, j), max(i, j)] += (i < j) - (j < i)
    return {edge: times for edge, times in chain.items() if times}


class Mesh(Solid):
    """Triangles; of a surface only the problem says that it has no inside."""

    def __init__(self, mesh: scene.Mesh) -> None:
        super().__init__(mesh.name, mesh.vertices[mesh.triangles])
        self.surface, self.surface_only = Surface(self.points), mesh.solid is False
        self.assumed_size = mesh.assumed_size

    def notes(self) -> list[str]:
        """What was assumed of it."""
        gap, size = 1e3 * self.surface.gap, self.assumed_size
        told = {
            f"{self.name} is a surface only": self.surface_only,
            f"{self.name} is taken to be {size}; no unit is stated": size != "",
            f"gaps of {self.name}, up to {gap:.2g} mm wide, are joined": gap > 0.0,
        }
        return [note for note, holds in told.items() if holds]


def solid(obstacle: scene.Obstacle) -> Solid:
    """The solid of an obstacle as it was read."""
    name = obstacle.name
    match obstacle:
        case scene.Sphere():
            found = Solid(name, [[obstacle.centre]], radius=obstacle.radius)
        case scene.Capsule() | scene.Cylinder():
            half, radius = obstacle.half_length * obstacle.axis, arb(obstacle.radius)
            found = Solid(name, [[obstacle.centre - half, obstacle.centre + half]])
            if isinstance(obstacle, scene.Capsule):
                found.radius = radius
            else:
                found.disc = unit(column(*obstacle.axis.tolist())), radius
        case scene.Box():
            corners = np.array([*product((-1, 1), repeat=3)]) * obstacle.half_size
            corners = obstacle.centre + corners @ obstacle.rotation.T
            found = Solid(name, [corners], origin=obstacle.centre)
        case scene.Prism():
            flat = [[[*uv, s] for uv in obstacle.polygon] for s in obstacle.span]
            both = obstacle.origin + np.array(flat) @ obstacle.rotation.T
            corners = both.reshape(1, -1, 3)
            found = Solid(name, corners, origin=obstacle.origin)
            found.ends = both
        case scene.HalfSpace():
            normal = unit(column(*obstacle.normal.tolist()))
            foot = normal * dot(normal, column(*obstacle.point.tolist()))
            found = Solid(name, [[[float(entry) for entry in foot.entries()]]])
            found.normal = normal
        case scene.PointCloud():
            found = Solid(name, obstacle.points[:, None], radius=obstacle.radius)
        case scene.Voxels():
            corners = np.array([*product((-1, 1), repeat=3)]) * obstacle.half_size
            corners = obstacle.centres[:, None] + corners @ obstacle.rotation.T
            found = Solid(name, corners, origin=obstacle.centres)
        case scene.Mesh():
            return Mesh(obstacle)
    return found
