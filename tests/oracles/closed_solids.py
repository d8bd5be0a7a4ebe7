"""Random meshes whose inside is known from the solids they were made of.

Each mesh is a few shells, turned outwards or inwards, and then written badly: faces
twice, in both senses, turned round, without area, corners apart. How often the shells
wind round a point comes from solid angles of the shells as they were made, in floating
point, away from their surfaces.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final

import numpy as np
import trimesh

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.winding import RAYS

CLEAR: Final = 0.05
"""Points are no nearer to a surface; the shells are about 1 large; [m]."""


@dataclass
class Made:
    """A mesh and what it was made of.

    Args:
        corners: As written, shape (m, 3, 3); [m].
        shells: Corners of the shells, outwards, shape (k, 3, 3) each; [m].
        senses: 1 for a shell turned outwards, -1 for one turned inwards.
        faults: What was done to it.
    """

    corners: FloatArray
    shells: list[FloatArray]
    senses: list[int]
    faults: list[str] = field(default_factory=list)

    @property
    def size(self) -> float:
        """Diagonal of the box around it; [m]."""
        return float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))

    def indexed(self) -> tuple[FloatArray, IntArray]:
        """Vertices, one for each corner, and triangles."""
        vertices = self.corners.reshape(-1, 3)
        return vertices, np.arange(len(vertices)).reshape(-1, 3)

    def windings(self, point: FloatArray) -> list[int]:
        """How often each shell, turned as it is, winds round a point."""
        return [
            sense * round(winding(shell, point))
            for shell, sense in zip(self.shells, self.senses, strict=True)
        ]


def winding(corners: FloatArray, point: FloatArray) -> float:
    """Winding number from solid angles (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    above = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la
    below += (c * a).sum(1) * lb
    return float(np.arctan2(above, below).sum() / (2.0 * np.pi))


def solid(rng: np.random.Generator) -> FloatArray:
    """Corners of a random closed solid, outwards, about 1 large."""
    makers: list[Callable[[], trimesh.Trimesh]] = [
        lambda: trimesh.creation.box(rng.uniform(0.6, 1.6, 3)),
        lambda: trimesh.creation.icosphere(1, rng.uniform(0.5, 0.9)),
        lambda: trimesh.creation.cylinder(rng.uniform(0.3, 0.8), rng.uniform(0.5, 2)),
        lambda: trimesh.creation.cone(rng.uniform(0.5, 0.9), rng.uniform(0.8, 1.8), 8),
        lambda: trimesh.creation.annulus(0.4, rng.uniform(0.6, 0.9), 0.8, 10),
        lambda: trimesh.creation.torus(0.7, rng.uniform(0.2, 0.4), 10, 7),
    ]
    part = makers[rng.integers(len(makers))]()
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    if rng.random() < 0.3:
        turn = np.eye(3)  # edges in line with axes and rays
    return np.asarray(part.triangles) @ turn.T


def made(rng: np.random.Generator) -> Made:
    """One to three shells beside, within and across each other."""
    shells, senses = [], []
    for _ in range(rng.integers(1, 4)):
        shell = solid(rng) * rng.choice([0.4, 1.0, 2.0])
        kind = rng.integers(3)
        if kind == 1 and shells:
            shell = shells[-1] * rng.choice([0.5, 1.0, 1.7])
        shell = shell + rng.normal(0.0, [0.0, 0.3, 1.0][rng.integers(3)], 3)
        shells.append(shell)
        senses.append(1 if rng.random() < 0.7 else -1)
    if rng.random() < 0.2:
        senses = [-sense for sense in senses]
    corners = [s[:, ::t] for s, t in zip(shells, senses, strict=True)]
    return Made(np.concatenate(corners), shells, senses)


def sample_points(mesh: Made, rng: np.random.Generator, count: int) -> list[FloatArray]:
    """Points in and around a mesh, away from its surface."""
    low, high = mesh.corners.min(axis=(0, 1)), mesh.corners.max(axis=(0, 1))
    tried = rng.uniform(low - 0.1, high + 0.1, (8 * count, 3))
    surface = trimesh.Trimesh(*mesh.indexed(), process=False)
    nearest = trimesh.proximity.closest_point_naive(surface, tried)[1]
    return list(tried[nearest > CLEAR][:count])


# ---- tetrahedra that rays hardly meet ------------------------------------------------


def tetrahedron_at_a_ray(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Four corners near and far, and a point of which a ray passes by an edge.

    The ray meets the edge but for rounding, and the edge's ends are up to 1e12 times as
    far away as one another.
    """
    point, ray = rng.normal(size=3), RAYS[rng.integers(len(RAYS))]
    aside = np.cross(ray, rng.normal(size=3))
    far, off = 10.0 ** rng.uniform(-6.0, 6.0, (2, 2))
    ends = far[:, None] * ray + (off * [1.0, -1.0])[:, None] * aside
    others = 10.0 ** rng.uniform(-6.0, 6.0, (2, 1)) * rng.normal(size=(2, 3))
    if rng.random() < 0.5:  # behind the point, which may lie inside then
        others -= (1.0 + rng.random()) * np.abs(others @ ray)[:, None] * ray
    return point + rng.permutation(np.concatenate([ends, others])), point


def exactly(corners: FloatArray, point: FloatArray) -> tuple[bool, FloatArray]:
    """Whether a point lies in a tetrahedron, and its faces, turned outwards.

    By exact arithmetic; corners of shape (4, 3), faces (4, 3, 3).
    """
    exact = [[Fraction(float(x)) for x in corner] for corner in [*corners, point]]

    def sense(a: int, b: int, c: int, d: int) -> int:
        sides: Any = [[x - y for x, y in zip(exact[k], exact[d], strict=True)]
                      for k in (a, b, c)]  # fmt: skip
        (p, q, r), (s, t, u), (v, w, x) = sides
        value = p * (t * x - u * w) - q * (s * x - u * v) + r * (s * w - t * v)
        return int(value > 0) - int(value < 0)

    around = [(0, 1, 2, 3), (0, 3, 1, 2), (0, 2, 3, 1), (1, 3, 2, 0)]
    outwards = [(a, b, c) if sense(a, b, c, d) > 0 else (c, b, a)
                for a, b, c, d in around]  # fmt: skip
    inside = all(sense(*face, 4) > 0 for face in outwards)
    return inside, corners[np.array(outwards)]


# ---- ways of writing a mesh badly ----------------------------------------------------


def doubled(mesh: Made, rng: np.random.Generator) -> None:
    """Some faces twice, in the same sense."""
    again = mesh.corners[rng.random(len(mesh.corners)) < rng.choice([0.05, 0.5, 1.0])]
    turned = np.roll(again, int(rng.integers(3)), axis=1)
    mesh.corners = np.concatenate([mesh.corners, turned])


def double_sided(mesh: Made, rng: np.random.Generator) -> None:
    """Each face twice, once in each sense."""
    mesh.corners = np.concatenate([mesh.corners, mesh.corners[:, ::-1]])


def some_double_sided(mesh: Made, rng: np.random.Generator) -> None:
    """Some faces twice, once in each sense."""
    again = mesh.corners[rng.random(len(mesh.corners)) < 0.2]
    mesh.corners = np.concatenate([mesh.corners, again[:, ::-1]])


def turned_round(mesh: Made, rng: np.random.Generator) -> None:
    """Some faces turned round."""
    turn = rng.random(len(mesh.corners)) < rng.choice([0.05, 0.5])
    mesh.corners[turn] = mesh.corners[turn][:, ::-1]


def without_area(mesh: Made, rng: np.random.Generator) -> None:
    """More triangles, with two equal corners or all three in line."""
    picked = mesh.corners[rng.integers(len(mesh.corners), size=3)]
    equal = picked[:, [0, 0, 1]]
    ends = picked[:, :2]
    line = np.stack([ends[:, 0], ends.mean(axis=1), ends[:, 1]], axis=1)
    mesh.corners = np.concatenate([mesh.corners, equal, line, picked[:, [2, 2, 2]]])


def apart(mesh: Made, rng: np.random.Generator) -> None:
    """Corners of neighbours miss each other by little."""
    gap = rng.choice([1e-9, 1e-7, 1e-6, 1e-5, 5e-5]) * mesh.size
    off = rng.normal(size=mesh.corners.shape)
    off /= np.linalg.norm(off, axis=2, keepdims=True)
    some = rng.random(len(mesh.corners)) < rng.choice([0.1, 1.0])
    mesh.corners[some] += 0.5 * gap * off[some]


def moved_shell(mesh: Made, rng: np.random.Generator) -> None:
    """Half of the faces moved as one, so that a slit runs round the mesh."""
    gap = rng.choice([1e-7, 1e-5, 1e-4]) * mesh.size
    step = rng.normal(size=3)
    half = mesh.corners.mean(axis=1) @ step > np.median(
        mesh.corners.mean(axis=1) @ step
    )
    mesh.corners[half] += 0.5 * gap * step / np.linalg.norm(step)


def split(mesh: Made, rng: np.random.Generator) -> None:
    """Edges split in one of two neighbours, the new corner a little off the edge."""
    picked = rng.random(len(mesh.corners)) < rng.choice([0.05, 0.6])
    a, b, c = np.moveaxis(mesh.corners[picked], 1, 0)
    share = rng.uniform(0.2, 0.8, (len(a), 1))
    off = rng.choice([0.0, 1e-8, 1e-5]) * mesh.size * rng.uniform(-0.5, 0.5, a.shape)
    middle = a + share * (b - a) + off
    one, two = np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)
    mesh.corners = np.concatenate([mesh.corners[~picked], one, two])


def hole(mesh: Made, rng: np.random.Generator) -> None:
    """A face is missing."""
    mesh.corners = np.delete(mesh.corners, rng.integers(len(mesh.corners)), axis=0)


CLEAN: Final = (doubled, without_area)
"""They change nothing about the inside, and nothing about what is known of it."""

GAPS: Final = (apart, moved_shell, split)
"""Gaps that are joined."""

DOUBTFUL: Final = (double_sided, some_double_sided, turned_round, hole)
"""After these the inside may be unknown."""


def spoiled(
    mesh: Made, rng: np.random.Generator, faults: tuple[Callable[..., None], ...]
) -> Made:
    """The mesh with one or two faults, its triangles shuffled."""
    for fault in rng.choice(np.array(faults, dtype=object), rng.integers(1, 3)):
        fault(mesh, rng)
        mesh.faults.append(fault.__name__)
    rng.shuffle(mesh.corners)
    return mesh
