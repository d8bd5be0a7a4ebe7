"""Solids as the checker sees them: support functions.

A solid is the union of convex pieces, and a piece the hull of a few points grown by a
ball or a disc. Of a half-space the point that its plane goes through is enough.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from flint import arb

from vdsm_pin.certificate_checker.balls import (
    ROUNDING,
    Ball,
    Matrix,
    claim,
    column,
    dot,
    norm,
    unit,
)
from vdsm_pin.certificate_checker.inside import Surface
from vdsm_pin.geometry import solids
from vdsm_pin.problem import scene


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
        self.disc_axis, self.disc_radius = column(0, 0, 1), arb(0)  # of a cylinder
        self.normal: Matrix | None = None  # of a half-space
        self.ends: Any = None  # of a prism: its corners at both, shape (2, c, 3)
        self.extent = float(np.abs(self.points).max() + np.abs(origin).max())

    @cache  # noqa: B019  (solids live as long as the check)
    def corner(self, i: int) -> tuple[Matrix, Ball]:
        """A corner of the first piece, and how far it is with a disc about it."""
        corner = column(*self.points[0][i].tolist())
        return corner, norm(corner) + self.disc_radius

    def support(self, n: Matrix, first: int, last: int) -> Ball:
        """Least n.x over the pieces first..last-1, for a unit n."""
        rounded = np.array([float(entry) for entry in n.entries()])
        least = (self.points[first:last].reshape(-1, 3) @ rounded).min()
        height = arb(float(least), self.extent * ROUNDING)
        return height - self.radius - self.across(n)

    def across(self, n: Matrix) -> Ball:
        """Support of a cylinder's disc about its centre, 0 of other solids."""
        if not self.disc_radius > 0:
            return arb(0)
        cosine = dot(self.disc_axis, n)
        return self.disc_radius * (1 - cosine * cosine).nonnegative_part().sqrt()

    def size(self) -> Ball:
        """Largest distance from the middle of the box around the corners, at most."""
        points = self.points.reshape(-1, 3)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        away = float(np.linalg.norm(points - middle, axis=1).max())
        return arb(away, self.extent * ROUNDING) + self.radius + self.disc_radius

    def parts(self, pieces: Any) -> "list[Solid]":
        """The solids of one piece that a body on a link is covered by.

        Args:
            pieces: As for `cut`; of a mesh the triangles under each hull. None where
                the whole is one piece.
        """
        if not isinstance(self, Mesh):
            if pieces is not None:
                self.cut(pieces)
            groups = list(self.points)
        else:
            count = len(self.points)
            groups = [[*range(count)]] if pieces is None else pieces
            missing = set(range(count)) - {k for group in groups for k in group}
            claim(not missing, f"pieces of {self.name} do not make up the whole")
            groups = [self.points[np.array(g)].reshape(-1, 3) for g in groups]
        found = [Solid(self.name, [group], origin=self.extent) for group in groups]
        for k, one in enumerate(found, start=1):
            one.name += f" part {k}" if len(found) > 1 else ""
            one.radius, one.disc_axis = self.radius, self.disc_axis
            one.disc_radius = self.disc_radius
        return found

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

    def __init__(self, mesh: solids.Mesh) -> None:
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


def solid(obstacle: Any) -> Solid:
    """The solid of an obstacle as it was read, in the frame that carries it."""
    if isinstance(obstacle, scene.Moving):
        obstacle = obstacle.solid
    name = obstacle.name
    match obstacle:
        case solids.Sphere():
            found = Solid(name, [[obstacle.centre]], radius=obstacle.radius)
        case solids.Capsule() | solids.Cylinder():
            half, radius = obstacle.half_length * obstacle.axis, arb(obstacle.radius)
            found = Solid(name, [[obstacle.centre - half, obstacle.centre + half]])
            if isinstance(obstacle, solids.Capsule):
                found.radius = radius
            else:
                found.disc_axis = unit(column(*obstacle.axis.tolist()))
                found.disc_radius = radius
        case solids.Box():
            corners = np.array([*product((-1, 1), repeat=3)]) * obstacle.half_size
            corners = obstacle.centre + corners @ obstacle.rotation.T
            found = Solid(name, [corners], origin=obstacle.centre)
        case solids.Prism():
            flat = [[[*uv, s] for uv in obstacle.polygon] for s in obstacle.span]
            both = obstacle.origin + np.array(flat) @ obstacle.rotation.T
            corners = both.reshape(1, -1, 3)
            found = Solid(name, corners, origin=obstacle.origin)
            found.ends = both
        case solids.HalfSpace():
            normal = unit(column(*obstacle.normal.tolist()))
            foot = normal * dot(normal, column(*obstacle.point.tolist()))
            found = Solid(name, [[[float(entry) for entry in foot.entries()]]])
            found.normal = normal
        case solids.PointCloud():
            found = Solid(name, obstacle.points[:, None], radius=obstacle.radius)
        case solids.Voxels():
            corners = np.array([*product((-1, 1), repeat=3)]) * obstacle.half_size
            corners = obstacle.centres[:, None] + corners @ obstacle.rotation.T
            found = Solid(name, corners, origin=obstacle.centres)
        case solids.Mesh():
            return Mesh(obstacle)
    return found


class Body(NamedTuple):
    """A convex solid that rides on a frame of the tree.

    Args:
        frame: The frame.
        solid: Of one piece, in its coordinates.
        own: Whether it is a link, the tool or the feed: a capsule about the arm's axis.
    """

    frame: int
    solid: Solid
    own: bool = True


class Pair(NamedTuple):
    """A body and a solid that rests in another frame.

    Args:
        body: What moves as seen from there.
        solid: Of any number of pieces.
        rest: The frame.
        required: Least clearance; [m].
        lost: Radius of the body and errors that do not turn; [m].
    """

    body: Body
    solid: Solid
    rest: int
    required: Ball
    lost: Ball

    @property
    def names(self) -> list[str]:
        """As the header has them."""
        return [self.body.solid.name, self.solid.name]
