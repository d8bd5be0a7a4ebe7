"""Obstacles as the certificate checker sees them: support functions and an inside."""

from collections import Counter
from collections.abc import Sequence
from functools import reduce
from itertools import pairwise
from typing import Any, Final

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker import files
from vdsm_pin.certificate_checker.balls import (
    SLACK,
    Ball,
    Matrix,
    claim,
    column,
    cross,
    dot,
    is_index,
    norm,
    require,
    sign,
)

RAYS: Final = ((0.531, 0.627, 0.571), (-0.283, 0.919, 0.277), (0.711, -0.129, -0.69))
"""Directions without symmetry, of length below 1.01, to cross a mesh along; [-]."""


class Solid:
    """An obstacle as convex pieces in the order of the certificate.

    Args:
        name: Name in the problem file.
        shape: What it is.
    """

    def __init__(self, name: str, shape: Any) -> None:
        self.name, self.shape, self.pieces = name, shape, [shape]
        if isinstance(shape, files.SweptPolygon):
            self.pieces = [self._swept(range(len(shape.section)))]

    @property
    def count(self) -> int:
        """Number of pieces."""
        return len(self.pieces)

    def reorder(self, order: list[int]) -> None:
        """Take the pieces in this order."""
        self.pieces = [self.pieces[k] for k in order]

    def support(self, n: Matrix, first: int, last: int) -> Ball:
        """Least n.x over the pieces first..last-1, for a unit n."""
        return reduce(arb.min, (_support(p, n) for p in self.pieces[first:last]))

    def direction(self, n: Matrix) -> Matrix:
        """The exact direction that n stands for: a half-space has only one."""
        if not isinstance(self.shape, files.HalfSpace):
            return n
        off = (n + self.shape.normal).entries()
        claim(all(abs(x) <= SLACK for x in off), "n is not the half-space's -normal")
        return -self.shape.normal

    def cut(self, loops: list[list[int]]) -> None:
        """Take triangles of a prism as pieces, once their edges cancel to its own."""
        claim(isinstance(self.shape, files.SweptPolygon), f"{self.name} is no prism")
        corners = range(len(self.shape.section))
        good = all(len(x) == 3 and all(is_index(k, corners) for k in x) for x in loops)
        require(good and loops, f"sections of {self.name} are not triangles")
        rest = self._boundary(corners)
        for loop in loops:
            rest.subtract(self._boundary(loop))
        claim(not any(rest.values()), f"sections do not cover {self.name}")
        self.pieces = [self._swept(loop) for loop in loops]

    def _swept(self, loop: Sequence[int]) -> files.Hull:
        return files.Hull([end[k] for end in self.shape.ends for k in loop], arb(0))

    def _boundary(self, loop: Sequence[int]) -> Counter[tuple[int, int]]:
        """The loop's edges as a chain, run so that its area is positive."""
        chain: Counter[tuple[int, int]] = Counter()
        edges, corners = list(pairwise([*loop, loop[0]])), self.shape.section
        ends = [(corners[i], corners[j]) for i, j in edges]
        area = sum(a[0] * b[1] - a[1] * b[0] for a, b in ends)
        for i, j in edges:
            chain[min(i, j), max(i, j)] += 1 if (i < j) == (area > 0) else -1
        return chain


def _support(piece: files.Shape, n: Matrix) -> Ball:
    """Least n.x over a convex piece, for a unit n (a half-space's own)."""
    match piece:
        case files.Hull():
            heights = (arb_mat(piece.points) * n).entries()
            return reduce(arb.min, heights) - piece.radius
        case files.FlatCylinder():
            along = dot(piece.axis, n)
            across = (1 - along * along).nonnegative_part().sqrt()
            reach = piece.half_length * abs(along) + piece.radius * across
            return dot(piece.centre, n) - reach
        case files.HalfSpace():
            return -piece.offset
    raise AssertionError(piece)


class Mesh(Solid):
    """Triangles as the file has them, with an inside where they enclose one."""

    def __init__(self, name: str, shape: Any) -> None:
        super().__init__(name, shape)
        self.corners, self.extent = shape.corners, float(np.abs(shape.corners).max())
        points = self.corners.reshape(-1, 3) + 0.0  # makes -0 and 0 equal
        start = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1, 3)
        ends = np.stack([start, np.roll(start, -1, axis=1)], axis=-1).reshape(-1, 2)
        ends = ends[ends[:, 0] != ends[:, 1]]
        edge = np.unique(np.sort(ends), axis=0, return_inverse=True)[1].ravel()
        self.has_inside = not (np.bincount(edge) % 2).any()
        self.oriented = not np.bincount(edge, np.sign(ends[:, 1] - ends[:, 0])).any()

    @property
    def count(self) -> int:
        """Number of triangles."""
        return len(self.corners)

    def reorder(self, order: list[int]) -> None:
        """Take the triangles in this order."""
        self.corners = self.corners[order]

    def support(self, n: Matrix, first: int, last: int) -> Ball:
        """As for any solid, with the dot products in doubles.

        Three products, two sums and a rounded n cost at most 9 units of 2^-53 |x| |n|;
        the ball is 16 units wide either way.
        """
        turned = self.shape.linear.transpose() * n
        rounded = np.array([float(entry) for entry in turned.entries()])
        least = float((self.corners[first:last].reshape(-1, 3) @ rounded).min())
        width = self.extent * float(norm(turned)) * 2.0**-49
        return dot(self.shape.shift, n) + arb(least, width)

    def excludes(self, point: Matrix) -> bool:
        """Whether a point of the base frame is proved not to lie inside."""
        local = self.shape.linear.solve(point - self.shape.shift)
        for ray in RAYS if self.has_inside else ():
            signs = self._crossings(local, ray)
            if signs is not None:
                return len(signs) % 2 == 0 and (sum(signs) == 0 or not self.oriented)
        return not self.has_inside

    def _crossings(self, point: Matrix, ray: tuple[float, ...]) -> list[int] | None:
        """The sense in which a ray crosses each triangle it meets; None if unsure."""
        corners = self.corners - np.array([float(x) for x in point.entries()])
        areas = np.cross(corners, np.roll(corners, -1, axis=1)) @ np.array(ray)
        # Corners are shorter than the bracket; rounding is below 2^-46 of its square.
        doubt = (4.0 * (self.extent + float(norm(point)))) ** 2 * 2.0**-46
        missed = (areas.max(axis=1) > doubt) & (areas.min(axis=1) < -doubt)
        missed |= (self.corners == self.corners[:, :1]).all(axis=(1, 2))
        signs: list[int] = []
        for triangle in self.corners[~missed]:
            a, b, c = (column(*map(float, corner)) - point for corner in triangle)
            normals = cross(a, b), cross(b, c), cross(c, a)
            across = {sign(dot(column(*ray), normal)) for normal in normals}
            ahead = sign(dot(c, normals[0]))
            if {1, -1} <= across:
                continue
            if 0 in across or ahead == 0:
                return None
            signs += across if {ahead} == across else ()
        return signs


def solid(name: str, shape: files.Shape) -> Solid:
    """The obstacle of a shape, not yet cut or reordered."""
    return (Mesh if isinstance(shape, files.Triangles) else Solid)(name, shape)
