"""What links of robots are made of, for the header of a certificate."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np

from vdsm_pin.certificate_writer.schema import LinkPieces, Primitive
from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.solids import ConvexCover
from vdsm_pin.problem.scene import Moving, Obstacle

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
