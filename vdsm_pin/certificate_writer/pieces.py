"""What solids and links are made of, for the header of a certificate."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, Final, TypeAlias

import numpy as np

from vdsm_pin.arm.bodies import triangle_groups
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.certificate_writer.schema import LinkPieces, Primitive
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.solids import ConvexCover, Mesh, Prism, Solid
from vdsm_pin.problem.scene import Moving, Obstacle, Scene, solid_of

EDGES: Final[Mapping[int, tuple[int, ...]]] = {1: (), 2: (1,), 8: (1, 2, 4)}
"""By the number of a primitive's corners those at the ends of the first one's edges."""

Covers: TypeAlias = Sequence[tuple[IntArray, ...] | Hull]
"""Of each mesh of a link the triangles under each hull, or the primitive around it."""


def link_pieces(
    links: Iterable[tuple[str, Covers]], places: Sequence[int], pieces: PackedPieces
) -> Iterator[tuple[str, LinkPieces]]:
    """Of each link that is not as its URDF says what it is made of.

    Args:
        links: Names, and what covers their meshes.
        places: The number of each among the solids that were packed.
        pieces: Theirs, among others.
    """
    for k, (name, covers) in zip(places, links, strict=True):
        order = pieces.order[pieces.first_piece[k] : pieces.first_piece[k + 1]]
        sorted_ = bool((np.diff(order) != 1).any())
        if sorted_ or covers:
            told = order.tolist() if sorted_ else []
            yield name, LinkPieces(order=told, meshes=[_cover(one) for one in covers])


def links_of_others(
    obstacles: Sequence[tuple[int, Obstacle]], pieces: PackedPieces
) -> dict[str, LinkPieces]:
    """The same of other robots' links among the obstacles, each with its number."""
    links, places = list[tuple[str, Any]](), list[int]()
    for k, one in obstacles:
        if isinstance(one, Moving) and isinstance(one.solid, ConvexCover):
            name = one.name.removeprefix(f"{one.carrier.robot}: ")
            links.append((one.name, one.carrier.itself.covers.get(name, ())))
            places.append(k)
    return dict(link_pieces(links, places, pieces))


def _cover(cover: tuple[IntArray, ...] | Hull) -> list[int] | Primitive:
    """What holds a mesh: the hull over each of its triangles, or a primitive."""
    if not isinstance(cover, Hull):
        hulls = np.zeros(sum(map(len, cover)), np.int64)
        for k, group in enumerate(cover):
            hulls[group] = k
        return [int(k) for k in hulls]
    origin = cover.points[0]
    edges = [cover.points[k] - origin for k in EDGES[len(cover.points)]]
    return Primitive(
        origin_m=origin.tolist(),
        edges_m=[edge.tolist() for edge in edges],
        radius_m=cover.radius,
    )


def pieces_of_obstacles(
    obstacles: Iterable[tuple[int, Obstacle]], pieces: PackedPieces
) -> dict[str, list[Any]]:
    """The pieces of cut prisms and of meshes in the order in which planes count them.

    Triangles by the numbers of their corners for a prism; none for a mesh, cloud or
    grid that was sorted, which has its order by halves.

    Args:
        obstacles: The solids, each with its number among those that were packed.
        pieces: Theirs, among others.
    """
    result: dict[str, list[Any]] = {}
    for k, one in obstacles:
        obstacle: Solid | ConvexCover = solid_of(one)
        if isinstance(obstacle, ConvexCover):
            continue  # a link of another robot
        order = pieces.order[pieces.first_piece[k] : pieces.first_piece[k + 1]]
        if isinstance(obstacle, Prism) and len(order) > 1:
            triangles = _triangles(obstacle)
            result[obstacle.name] = [triangles[i] for i in order]
        elif (np.diff(order) != 1).any():
            result[obstacle.name] = []
    return result


def pieces_carried(bodies: Iterable[LinkBody]) -> dict[str, list[Any]]:
    """As of obstacles; of a mesh on a link the triangles under each hull."""
    result: dict[str, list[Any]] = {}
    for body in bodies:
        if isinstance(body.solid, Prism) and len(body.solid.convex_sections) > 1:
            result[body.name] = _triangles(body.solid)
        elif isinstance(body.solid, Mesh):
            result[body.name] = [group.tolist() for group in triangle_groups(body)]
    return result


def joined_corners(scene: Scene) -> dict[str, tuple[list[Any], list[Any]]]:
    """By mesh the corners that are joined to close it, and its seams."""
    result = {}
    for mesh in map(solid_of, scene.obstacles):
        if isinstance(mesh, Mesh) and mesh.has_inside:
            joined = _corners_and_seams(mesh)
            if any(joined):
                result[mesh.name] = joined
    return result


def _corners_and_seams(mesh: Mesh) -> tuple[list[Any], list[Any]]:
    """Both by numbers of corners: 3 k + i is corner i of the file's triangle k."""
    closed, given = mesh.closed_mesh, mesh.triangles.reshape(-1)
    count = len(given)
    at = np.zeros(len(mesh.vertices), np.int64)
    at[given[::-1]] = np.arange(count)[::-1]  # where a vertex occurs first
    names = closed.triangles.reshape(-1)
    away = (mesh.vertices[names[:count]] != mesh.vertices[given]).any(axis=1)
    moved = np.flatnonzero(away)
    corners = np.stack([moved, at[names[moved]]], axis=1)
    seams = np.column_stack([at[names[count:]].reshape(-1, 3), closed.beside])
    return corners.tolist(), seams.tolist()


def _triangles(prism: Prism) -> list[list[int]]:
    """The section's triangles by corner numbers, run in the sense of the polygon."""
    corners = {tuple(corner): k for k, corner in enumerate(prism.polygon.tolist())}
    sense = _sense(prism.polygon)
    return [
        [corners[tuple(c)] for c in part.tolist()][:: sense * _sense(part)]
        for part in prism.convex_sections
    ]


def _sense(polygon: FloatArray) -> int:
    """1 where the corners, shape (n, 2), run anticlockwise, -1 where clockwise."""
    corners = [(Fraction(x), Fraction(y)) for x, y in polygon.tolist()]
    edges = pairwise([*corners, corners[0]])
    return 1 if sum(a[0] * b[1] - a[1] * b[0] for a, b in edges) > 0 else -1
