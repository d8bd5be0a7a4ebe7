"""The convex bodies that ride on an arm's links, and which of them are held apart.

A body of several convex pieces becomes several bodies, `camera part 1` and so on. A
mesh is covered by the hulls of groups of its own triangles, which hold its inside too.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import FEED, PART, Manipulator
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.geometry.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    distinct,
    distinct_rows,
)
from vdsm_pin.geometry.closed_meshes import closed_parts
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Piece, ends_of
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.proof.bodies import LeftOut
from vdsm_pin.tolerances import TOLERANCES

NEAR: Final = 5.0 * TOLERANCES.mesh_gap
"""Boxes of triangles that near, over the mesh's size, may be of one surface; [-]."""

MEET: Final = "meet at joint"
"""How the reason begins why links next to each other are not held apart."""

DIRECTIONS: Final = 256
"""Directions in which the corners of a hull are sought first."""


@dataclass(frozen=True)
class ArmBody:
    """A convex solid in the frame of its link: origin at O_i, x along the link.

    Args:
        name: `link 3`, `tool`, `feed`, or as in the problem file.
        link: The link that it rides on, 1 to N; 0 for the feed, which moves with O_1
            and never turns.
        piece: The solid.
        carried: Whether it is none of the arm's own: links, tool and feed.
        of: The body that it is a part of; empty where it is no part.
    """

    name: str
    link: int
    piece: Hull | FlatCylinder
    carried: bool = False
    of: str = ""

    @property
    def owner(self) -> str:
        """The name of the whole."""
        return self.of or self.name

    @property
    def corners(self) -> FloatArray:
        """Corners of a hull, or the centres of a cylinder's ends, shape (n, 3); [m]."""
        return ends_of(self.piece)

    @property
    def disc(self) -> float:
        """Radius of the disc that grows the corners, 0 for a hull; [m]."""
        return 0.0 if isinstance(self.piece, Hull) else self.piece.radius

    @property
    def ball(self) -> float:
        """Radius of the ball that grows the corners, 0 for a cylinder; [m]."""
        return self.piece.radius if isinstance(self.piece, Hull) else 0.0


BY_FILE = "left out by the problem file"
"""Why two things are not held apart that `ignore_pairs` names."""


@dataclass(frozen=True)
class SelfPairs:
    """Which bodies of an arm are held apart.

    Args:
        held: Numbers of two bodies; the first rides nearer to the base, shape (n, 2).
        left_out: The other pairs, with a reason each.
    """

    held: IntArray
    left_out: tuple[LeftOut, ...]


def arm_bodies(arm: Manipulator) -> tuple[ArmBody, ...]:
    """Every convex body: links 1 to N, tool, feed, then the others in file order."""
    found = []
    for k, (name, span) in enumerate(zip(arm.axis_names, arm.axis_spans, strict=True)):
        link, axis = min(k + 1, arm.n_links), np.zeros((2, 3))
        axis[:, 0] = span
        solid = Hull(axis, float(arm.axis_radii[k]))
        found.append(ArmBody(name, link, solid))
    if arm.feed:
        axis = np.array([[-arm.feed.length, 0.0, 0.0], [0.0, 0.0, 0.0]])
        found.append(ArmBody(FEED, 0, Hull(axis, arm.feed.radius)))
    for body in arm.bodies:
        pieces = convex_cover(body)
        for k, piece in enumerate(pieces, start=1):
            part = f"{body.name}{PART}{k}" if len(pieces) > 1 else body.name
            found.append(ArmBody(part, body.link, piece, carried=True, of=body.name))
    return tuple(found)


def convex_cover(body: LinkBody) -> tuple[Hull | FlatCylinder, ...]:
    """Convex pieces that together hold a body.

    A mesh's have all of its triangles and, unless it is a surface only, its inside.
    """
    if isinstance(body.solid, Mesh):
        corners = body.solid.vertices[body.solid.triangles]
        solid = not body.solid.is_surface
        points = covering_points(corners, triangle_groups(body), solid=solid)
        return tuple(Hull(outer_points(each)) for each in points)
    return tuple(_bounded(piece) for piece in body.solid.pieces)


def _bounded(piece: Piece) -> Hull | FlatCylinder:
    assert not isinstance(piece, HalfSpacePiece)  # `LinkBody` has none
    return piece


def triangle_groups(body: LinkBody) -> tuple[IntArray, ...]:
    """Numbers of the triangles under each hull of a mesh body."""
    assert isinstance(body.solid, Mesh)
    return grouped(body.solid.vertices[body.solid.triangles], body.parts)


def covering_points(
    corners: FloatArray, groups: Sequence[IntArray], *, solid: bool = True
) -> Iterator[FloatArray]:
    """Points of hulls that hold triangles and, of a solid, what they enclose.

    Hulls of one closed surface have a point in common. Tetrahedra over its triangles
    that have their tip there wind round any point as often as the surface does: each
    point of its inside is in one of them. Where a mesh has gaps, what lies across them
    is of one surface.

    Args:
        corners: Of the triangles, shape (m, 3, 3); [m].
        groups: Numbers of the triangles under each hull.
        solid: Whether the inside is to be held.

    Yields:
        Of each hull, shape (n, 3); [m].
    """
    found = [corners[group].reshape(-1, 3) for group in groups]
    if not solid or len(groups) == 1:
        yield from found
        return
    together = _of_one_surface(corners, groups)
    counts = np.array([len(points) for points in found])
    sums = np.array([points.sum(axis=0) for points in found])
    tips = (together @ sums) / (together @ counts)[:, None]
    for points, tip in zip(found, tips, strict=True):
        yield np.vstack([points, tip])


def _of_one_surface(corners: FloatArray, groups: Sequence[IntArray]) -> BoolArray:
    """Which groups have triangles of one surface, or of those of one that has, (k, k).

    Where the mesh is open, its triangles may be joined if they are near.
    """
    if (part := closed_parts(corners)) is not None:
        has = np.zeros((len(groups), int(part.max()) + 1), np.float32)
        for k, group in enumerate(groups):
            has[k, part[group]] = 1.0
        near = has @ has.T > 0.0
    else:
        low, high = (
            np.array([end(corners[group], axis=(0, 1)) for group in groups])
            for end in (np.min, np.max)
        )
        gap = NEAR * float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        reaches = (low[:, None] <= high + gap).all(axis=2)
        near = np.asarray(reaches & reaches.T)
    while (near != (farther := near @ near)).any():
        near = farther
    return near


def grouped(corners: FloatArray, parts: int) -> tuple[IntArray, ...]:
    """Numbers of triangles (n, 3, 3) in so many groups of neighbours, at most n.

    A closed surface has groups of its own where there are enough for all.
    """
    parts = min(parts, len(corners))
    if parts == 1:
        return (np.arange(len(corners)),)
    part = closed_parts(corners)
    sizes = np.bincount(np.zeros(len(corners), int) if part is None else part)
    if part is None or len(sizes) > parts:
        part, sizes = np.zeros(len(corners), int), np.array([len(corners)])
    counts = np.ones_like(sizes)
    while counts.sum() < parts:
        counts[np.argmax(sizes / counts)] += 1
    found: list[IntArray] = []
    for k, count in enumerate(counts.tolist()):
        rows = np.flatnonzero(part == k)
        order = coherent_order(corners[rows].mean(axis=1))
        found += np.array_split(rows[order], count)
    return tuple(found)


def outer_points(points: FloatArray) -> FloatArray:
    """Some of the points, with the same hull; those surely inside are left out."""
    points = distinct_rows(points)
    return np.asarray(points[missed_by_few(points) > 0.0])


def missed_by_few(points: FloatArray) -> FloatArray:
    """How far points are at most from a hull of few of them; inf for these few.

    Args:
        points: Shape (n, 3); [m].

    Returns:
        Shape (n,); [m].
    """
    missed = np.full(len(points), np.inf)
    if len(points) <= DIRECTIONS // 4:
        return missed
    directions = np.random.default_rng(0).normal(size=(DIRECTIONS, 3))
    few = distinct(np.argmax(directions @ points.T, axis=1))
    missed = hull_distances(points, points[few])
    missed[few] = np.inf
    return missed


def hull_distances(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Bounds from above of how far points are from a hull, shape (n,); [m].

    Args:
        points: Shape (n, 3); [m].
        corners: Of the hull, shape (m, 3); [m].
    """
    pieces = pack_pieces([[Hull(corners)]])
    ends = np.ascontiguousarray(np.repeat(points[:, None], 2, axis=1))
    none = np.zeros(len(points), np.int64)
    return row_brackets(pieces, ends, none, TOLERANCES.bracket_gap)[:, 1]


def self_pairs(arm: Manipulator, bodies: tuple[ArmBody, ...]) -> SelfPairs:
    """Which bodies are held apart: all that move against each other and can part.

    Args:
        arm: The arm.
        bodies: `arm_bodies(arm)`.

    Returns:
        Pairs in the order of the bodies. Left out are bodies of one link, links, tool
        and feed that meet at the joint between them in every pose, and what the file
        says. Parts of one body are no pair.
    """
    held, left_out = [], {}
    for i, one in enumerate(bodies):
        for k in range(i + 1, len(bodies)):
            other = bodies[k]
            near, far = (one, other) if one.link <= other.link else (other, one)
            reason = _reason(arm, near, far)
            if reason:
                names = one.owner, other.owner
                left_out[names] = LeftOut(*names, reason)
            else:
                held.append((i, k) if near is one else (k, i))
    pairs = np.array(held, dtype=np.int64).reshape(-1, 2)
    told = (row for row in left_out.values() if row.body != row.other)
    return SelfPairs(pairs, tuple(told))


def _reason(arm: Manipulator, near: ArmBody, far: ArmBody) -> str:
    """Why two bodies are not held apart; empty where they are."""
    if near.link == far.link:
        return f"both ride on link {near.link}"
    if far.link == near.link + 1 and not (near.carried or far.carried):
        length = arm.link_lengths[near.link - 1] if near.link else 0.0
        gap = (length - near.corners[1, 0]) + far.corners[0, 0]
        if gap <= near.ball + far.ball:
            return f"{MEET} {far.link} in every pose"
    if arm.ignores(near.name, far.name):
        return BY_FILE
    return ""
