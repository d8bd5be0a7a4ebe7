"""Solids as the checker sees them: support functions.

A solid is the union of convex pieces, and a piece the hull of a few points grown by a
ball or a disc. Of a half-space the point that its plane goes through is enough.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, Final, NamedTuple

import numpy as np

from vdsm_pin.certificate_checker.balls import UP, claim, column, dot, doubles, unit
from vdsm_pin.certificate_checker.inside import Surface
from vdsm_pin.certificate_checker.tree import point_of
from vdsm_pin.geometry import solids
from vdsm_pin.problem import scene

MAX_PARTS: Final = 256  # hulls of a mesh at most
CUBE: Final = np.array([*product((-1.0, 1.0), repeat=3)])


@dataclass(eq=False)
class Solid:
    """An obstacle, or what rides on a frame, in its coordinates.

    Args:
        name: Name in the certificate.
        points: Of each piece, shape (n_pieces, k, 3); [m].
        origin: What the points were computed from, shape (3,); [m].
        radius: Of the ball that grows the pieces; [m].
        disc: Of a cylinder, axis and radius of the discs that do; [m].
        normal: Of a half-space.
        ends: Of a prism, its corners at both, shape (2, c, 3); [m].
        surface: Of a mesh.
    """

    name: str
    points: Any
    origin: Any = 0.0
    radius: float = 0.0
    disc: tuple[Any, float] = ((0.0, 0.0, 1.0), 0.0)
    normal: Any = None
    ends: Any = None
    surface: Any = None

    def __post_init__(self) -> None:
        """Work out what all of it has in common."""
        self.points, (axis, grown) = np.array(self.points, float), self.disc
        self.across = grown * np.cross(axis, np.eye(3))  # n to grown axis x n
        far = np.abs(self.points).max() + np.abs(self.origin).max()
        self.extent = float(far + self.radius + grown)
        self.levers = UP * (np.linalg.norm(self.points[0], axis=1) + grown)

    def support(self, n: Any, first: int, last: int) -> float:
        """Least n.x over the pieces first..last-1, for a unit n."""
        least = (self.points[first:last].reshape(-1, 3) @ n).min() - self.radius
        if self.disc[1] > 0.0:
            least -= np.linalg.norm(n @ self.across)
        return float(least)

    def size(self) -> float:
        """Largest distance from the middle of the box around the corners, at most."""
        if self.normal is not None:
            return np.inf
        return away(self.points.reshape(-1, 3), self.radius + self.disc[1])

    def convex(self, pieces: Any) -> "list[Solid]":
        """The solids of one piece that a body on a link is covered by.

        Args:
            pieces: As for `cut`; of a mesh the triangles under each hull. None where
                the whole is one piece.
        """
        if self.surface:
            parts = hulls(self.name, self.points, pieces, not self.surface.only)
        else:
            if pieces is not None:
                self.cut(pieces)
            parts = [*self.points]
        more = self.extent, self.radius, self.disc
        return named_parts([Solid(self.name, [part], *more) for part in parts])

    def cut(self, pieces: list[Any]) -> None:
        """Take the certificate's pieces: parts of a prism, or the mesh's in its order.

        Args:
            pieces: Corner numbers of polygons that make up the prism's section, all
                of as many corners; or a permutation of the numbers of the triangles,
                none for that by halves.
        """
        parts = f"pieces of {self.name} do not make up the whole"
        if self.ends is None:
            if pieces == []:
                pieces = halved(self.points.mean(axis=1)).tolist()
            claim(sorted(pieces) == [*range(len(self.points))], parts)
            self.points = self.points[np.array(pieces, dtype=int)]
            return
        corners = range(self.ends.shape[1])
        claim(sum(map(len, pieces)) <= 3 * len(corners), parts)  # as many as triangles
        claim(boundary(pieces) == boundary([corners]), parts)
        self.points = np.concatenate(self.ends[:, np.array(pieces, dtype=int)], axis=1)

    def check_outside(
        self, rest: Any, points: Iterable[tuple[Any, Any, float]]
    ) -> None:
        """Check that points are not inside of it, where it is a mesh.

        Args:
            rest: How its frame stands.
            points: Of each how its frame stands, the point there, and how far from the
                triangles it stays.
        """
        for frame, at, off in points if self.surface else ():
            seen = doubles(point_of(rest.inv() * frame, *at))
            why = self.surface.not_outside(seen, off)
            claim(not why, f"a body is not proved outside {self.name}: {why}")

    def notes(self) -> list[str]:
        """What was assumed of a mesh."""
        only, gap = (x.only, x.gap) if (x := self.surface) else (False, 0.0)
        told = [f"{self.name} is a surface only"] if only else []
        joined = f"gaps of {self.name}, up to {1e3 * gap:.2g} mm wide, are joined"
        return [*told, joined] if gap > 0.0 else told


def halved(points: Any) -> Any:
    """An order of points (n, 3): the lesser half along the longest axis first.

    So with each half, and halves of halves; what is equal there goes by number.
    """
    starts, order = np.zeros(1, int), np.arange(n := len(points))
    ranks = np.argsort(np.argsort(points, axis=0, kind="stable"), axis=0)
    while len(starts) < n:
        sizes, seen = np.diff(starts, append=n), points[order]
        low, high = (f.reduceat(seen, starts) for f in (np.minimum, np.maximum))
        axis = np.repeat(np.argmax(high - low, axis=1), sizes)
        part = np.repeat(np.arange(len(starts)), sizes)
        order = order[np.argsort(part * n + ranks[order, axis])]
        middles = (starts + sizes // 2)[sizes > 1]
        starts = np.sort(np.concatenate([starts, middles]))
    return order


def cover(things: Sequence[Any], header: Any, own: Iterable[str] = ()) -> None:
    """Take the pieces that obstacles are counted in, and the corners that close meshes.

    Args:
        things: The obstacles.
        header: Of the certificate.
        own: Links that it may tell of too.
    """
    named = {one.name: one for one in things}
    known = {*header["links"]} <= {*named, *own}
    claim(known, "links without solids are told of")
    for name, order in header["pieces"].items():
        named[name].cut(order)
    for name, (corners, seams) in header["joined"].items():
        mesh: Any = named.get(name)
        claim(mesh and mesh.surface, f"{name} is no mesh: nothing is joined")
        mesh.surface.join(corners, seams)


def away(points: Any, off: float) -> float:
    """How far it is from the middle of the box around points (n, 3) beyond them."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return float(np.linalg.norm(points - middle, axis=1).max() + off) * UP


def boundary(loops: Iterable[Sequence[int]]) -> dict[tuple[int, int], int]:
    """Net number of times that loops run along each directed edge.

    Loops of the same boundary wind round each point equally often in sum. A polygon
    winds round every point of its inside, so one of the loops does: its hull has it.
    """
    ahead = Counter(pair for loop in loops for pair in pairwise([*loop, loop[0]]))
    return ahead - Counter((j, i) for i, j in ahead.elements())


def hulls(name: str, corners: Any, groups: Any, inside: bool = True) -> list[Any]:
    """Corners of hulls of groups of triangles (n, 3, 3), which are all of them.

    To hold the inside too, those of one surface have a point in common: the tetrahedra
    over a closed surface that have their tip there wind round any point as often as the
    surface does. Each edge of a closed mesh has its partners where its corners are; of
    an open one they are near.
    """
    every = range(len(corners))
    groups = [every] if groups is None else groups[:MAX_PARTS]
    missing = {*every} - {k for group in groups for k in group}
    claim(not missing, f"pieces of {name} do not make up the whole")
    groups = [np.array(group, dtype=int) for group in groups]
    found = [corners[group].reshape(-1, 3) for group in groups]
    low, high = (np.array([f(one, axis=0) for one in found]) for f in (np.min, np.max))
    gap = np.linalg.norm(high.max(axis=0) - low.min(axis=0)) / 1000
    near = ((low[:, None] <= high + gap) & (low <= high[:, None] + gap)).all(axis=2)
    if inside and len(groups) > 1 and np.any((mesh := Surface(corners)).closed()[:2]):
        sets = [{*mesh.names.reshape(-1, 3)[group].flat} for group in groups]
        near = np.array([[not one.isdisjoint(x) for x in sets] for one in sets])
    near = np.linalg.matrix_power(near, MAX_PARTS)  # or of one with one that is
    tips = near @ np.array([[*one.sum(axis=0), len(one)] for one in found])
    tips = tips[:, :3] / tips[:, 3:] if inside else np.zeros((len(found), 0, 3))
    return [np.unique(np.vstack(x), axis=0) for x in zip(found, tips, strict=True)]


def named_parts(parts: "list[Solid]") -> "list[Solid]":
    """Solids of one piece that together are one, by its name if it is one alone."""
    for k, part in enumerate(parts if len(parts) > 1 else [], start=1):
        part.name += f" part {k}"
    return parts


class Compound(Solid):
    """Solids of one piece each, at rest on one frame, as planes count them.

    Args:
        name: Name in the certificate.
        parts: The solids, which are named by their numbers.
        told: By name the certificate's permutation of their numbers, as `order`; none
            or an empty one for 0, 1 and so on.
    """

    def __init__(self, name: str, parts: list[Solid], told: Any) -> None:
        order, every = told.get(name, {"order": ()})["order"], [*range(len(parts))]
        good = sorted(order or every) == every
        claim(good, f"pieces of {name} do not make up the whole")
        self.name, self.parts = name, named_parts(parts)
        self.points: list[Solid] = [parts[k] for k in [*order] or every]
        self.extent = max(one.extent for one in parts)

    def support(self, n: Any, first: int, last: int) -> float:
        """Least n.x over the pieces first..last-1, for a unit n."""
        return min(one.support(n, 0, 1) for one in self.points[first:last])

    def size(self) -> float:
        """As of a solid."""
        points = np.concatenate([one.points[0] for one in self.points])
        return away(points, max(one.radius + one.disc[1] for one in self.points))


def sizes(things: Iterable[Any]) -> list[str]:
    """Sizes that nobody states, of things as they were read: files or what has one."""
    files = [y for x in things for y in (x, getattr(x, "solid", x))]
    told = {y.name: y.assumed_size for y in files if isinstance(y, solids.FromFile)}
    return [f"{k} is taken to be {v}; no unit is stated" for k, v in told.items() if v]


def solid(obstacle: Any, told: Any = None) -> Any:
    """The solid of an obstacle as it was read, in the frame that carries it.

    Args:
        obstacle: As it was read.
        told: The certificate's links, of which those of other robots are made.
    """
    if callable(obstacle):
        return obstacle(told)
    name = obstacle.name
    match obstacle:
        case scene.Moving():
            return solid(obstacle.solid, told)
        case solids.Sphere():
            return Solid(name, [[obstacle.centre]], radius=obstacle.radius)
        case solids.Capsule() | solids.Cylinder():
            half, centre = obstacle.half_length * obstacle.axis, obstacle.centre
            ends, radius = [[centre - half, centre + half]], obstacle.radius
            if isinstance(obstacle, solids.Capsule):
                return Solid(name, ends, radius=radius)
            axis = doubles(unit(column(*obstacle.axis.tolist())))
            return Solid(name, ends, disc=(axis, radius))
        case solids.Box(centre=at) | solids.Voxels(centres=at):
            corners = CUBE * obstacle.half_size @ obstacle.rotation.T
            return Solid(name, np.atleast_2d(at)[:, None] + corners, at)
        case solids.Prism():
            flat = [[[*uv, s] for uv in obstacle.polygon] for s in obstacle.span]
            both = obstacle.origin + np.array(flat) @ obstacle.rotation.T
            return Solid(name, both.reshape(1, -1, 3), obstacle.origin, ends=both)
        case solids.PointCloud():
            return Solid(name, obstacle.points[:, None], radius=obstacle.radius)
        case solids.Mesh():
            corners = obstacle.vertices[obstacle.triangles]
            surface = Surface(corners, obstacle.solid is False)
            return Solid(name, corners, surface=surface)
    normal = unit(column(*obstacle.normal.tolist()))
    foot = normal * dot(normal, column(*obstacle.point.tolist()))
    return Solid(name, [[doubles(foot)]], normal=doubles(normal))


class Body(NamedTuple):
    """A solid that rides on a frame of the tree.

    Args:
        frame: The frame.
        solid: In its coordinates; what moves as seen from another is of one piece.
        lost: How far its surface may be off; [m].
    """

    frame: int
    solid: Any
    lost: float = 0.0


class Pair(NamedTuple):
    """A body and another one, in whose frame it is seen.

    Args:
        body: What moves.
        partner: What rests.
        required: Least clearance; [m].
    """

    body: Body
    partner: Body
    required: float

    @property
    def names(self) -> list[str]:
        """As the header has them."""
        return [self.body.solid.name, self.partner.solid.name]

    def inner(self, pose: Any) -> tuple[Any, Any, float]:
        """The body's frame, its middle there, and how far off the other it stays."""
        solid = self.body.solid
        middle = solid.points[0].mean(axis=0).tolist()
        return pose[self.body.frame], middle, solid.radius + self.required
