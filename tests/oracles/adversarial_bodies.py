"""Obstacles that touch a plane at a stated point, many at once, as arrays.

Every body lies where n.x >= n.p and holds p. Sizes run from 1e-9 to 1 m and angles
come within 1e-12 of the degenerate ones: that is where distance proofs go wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
from vdsm_pin.geometry.pieces import (
    CYLINDER,
    HALF_SPACE,
    HULL,
    PackedPieces,
    pack_pieces,
)

SHAPES: Final = (
    "sphere",
    "capsule_side",
    "capsule_parallel",
    "capsule_cap",
    "cylinder_side",
    "cylinder_parallel",
    "cylinder_cap",
    "cylinder_rim",
    "box_face",
    "box_edge",
    "box_corner",
    "hull",
    "mesh_box",
    "mesh_slivers",
    "sliver_face",
    "sliver_edge",
    "sliver_corner",
    "plate",
    "half_space",
)
SHARES: Final = np.array([0.3 if s.startswith("mesh") else 1.0 for s in SHAPES])
"""How often each is asked about, any scale: meshes cost ten times as much."""
CORNERS: Final = np.array(list(product((-1.0, 1.0), repeat=3)))
BOX_FACES: Final = (
    *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
    *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
)
FAN_FACES: Final = tuple((0, a, b) for a, b in pairwise(range(1, 14)))


@dataclass(frozen=True)
class Bodies:
    """Obstacles of one kind, one a row.

    Args:
        kind: HULL, CYLINDER or HALF_SPACE.
        points: Corners, shape (n, m, 3), m = 0 unless hulls; [m].
        faces: Corners of each convex piece; empty where one piece has all of them.
        radius: Shape (n,); [m].
        centre: Shape (n, 3); [m].
        axis: Axis of a cylinder or normal of a half-space, shape (n, 3); [-].
        extent: Half length of a cylinder or offset of a half-space, shape (n,); [m].
    """

    kind: int
    points: Any
    faces: tuple[tuple[int, ...], ...]
    radius: Any
    centre: Any
    axis: Any
    extent: Any

    @property
    def size(self) -> int:
        """Number of obstacles."""
        return len(self.radius)

    def pieces(self, k: int) -> tuple[Any, ...]:
        """The convex pieces of one obstacle, as those of the scene are."""
        if self.kind == CYLINDER:
            numbers = float(self.extent[k]), float(self.radius[k])
            return (FlatCylinder(self.centre[k], self.axis[k], *numbers),)
        if self.kind == HALF_SPACE:
            return (HalfSpacePiece(self.axis[k], float(self.extent[k])),)
        faces = self.faces or (tuple(range(self.points.shape[1])),)
        radius = float(self.radius[k])
        return tuple(Hull(self.points[k, list(face)], radius) for face in faces)


def hulls(points: Any, radius: Any = None, faces: Any = ()) -> Bodies:
    n, zero = len(points), np.zeros(len(points))
    none, radius = np.zeros((n, 3)), zero if radius is None else radius
    return Bodies(HULL, points, tuple(faces), radius, none, none, zero)


# ---- packing -------------------------------------------------------------------------


def pack(groups: Sequence[Bodies]) -> PackedPieces:
    """What `pack_pieces` makes of them, but for the order of triangles."""
    parts = [_packed(group) for group in groups]
    sizes = [np.full(g.size, len(g.faces) or 1) for g in groups]
    first_piece = np.concatenate([[0], np.cumsum(np.concatenate(sizes))])
    nodes = [2 * size - 1 for size in sizes]
    root = np.concatenate([[0], np.cumsum(np.concatenate(nodes))])[:-1]
    bounds = np.cumsum([group.size for group in groups])[:-1]
    for part, piece, node in zip(
        parts, np.split(first_piece[:-1], bounds), np.split(root, bounds), strict=True
    ):
        part["range"] = part["range"] + piece[:, None, None]
        part["right"] = np.where(part["right"] < 0, -1, part["right"] + node[:, None])

    def flat(key: str, *shape: int) -> Any:
        found = [part[key].reshape(-1, *shape) for part in parts]
        return np.ascontiguousarray(np.concatenate(found))

    counts = flat("count").astype(np.int64)
    return PackedPieces(
        order=flat("order").astype(np.int64),
        kind=flat("kind").astype(np.int64),
        first_point=np.concatenate([[0], np.cumsum(counts)]),
        points=flat("points", 3),
        radius=flat("radius"),
        centre=flat("centre", 3),
        axis=flat("axis", 3),
        extent=flat("extent"),
        first_piece=first_piece.astype(np.int64),
        root=root.astype(np.int64),
        node_range=flat("range", 2).astype(np.int64),
        node_right=flat("right").astype(np.int64),
        node_low=flat("low", 3),
        node_high=flat("high", 3),
    )


def _packed(group: Bodies) -> dict[str, Any]:
    """Arrays of one group, obstacles first."""
    n, m = group.size, group.points.shape[1]
    faces = group.faces or (tuple(range(m)),)
    count = len(faces)
    points = group.points[:, [k for face in faces for k in face]]
    like = pack_pieces([[Hull(np.zeros((1, 3)))] * count])
    low, high = np.zeros((2, n, count, 3))
    centre = np.repeat(group.centre[:, None], count, axis=1)
    if group.kind == HULL:
        split = np.split(points, np.cumsum([len(face) for face in faces])[:-1], axis=1)
        radius = group.radius[:, None]
        for k, part in enumerate(split):
            low[:, k] = part.min(axis=1) - radius
            high[:, k] = part.max(axis=1) + radius
            centre[:, k] = part.mean(axis=1)
    elif group.kind == CYLINDER:
        across = np.hypot(np.roll(group.axis, 1, axis=1), np.roll(group.axis, 2, 1))
        half = group.extent[:, None] * np.abs(group.axis)
        half = (half + group.radius[:, None] * across) * (1.0 + 4.0 * 2.0**-52)
        low[:, 0], high[:, 0] = group.centre - half, group.centre + half
    else:
        low[:], high[:] = -np.inf, np.inf
        centre[:, 0] = group.extent[:, None] * group.axis
    ends = like.node_range.tolist()
    of_faces = [len(face) if group.kind == HULL else 0 for face in faces]
    return {
        "order": np.tile(np.arange(count), n),
        "kind": np.full(n * count, group.kind),
        "count": np.tile(of_faces, n),
        "points": points,
        "radius": np.repeat(group.radius, count),
        "centre": centre,
        "axis": np.repeat(group.axis, count, axis=0),
        "extent": np.repeat(group.extent, count),
        "range": np.tile(like.node_range, (n, 1, 1)),
        "right": np.tile(like.node_right, (n, 1)),
        "low": np.stack([low[:, a:b].min(axis=1) for a, b in ends], axis=1),
        "high": np.stack([high[:, a:b].max(axis=1) for a, b in ends], axis=1),
    }


# ---- shapes --------------------------------------------------------------------------


def across(n: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """Two unit vectors that make a frame with each n, turned at random."""
    helper = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    u = np.cross(n, helper)
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(n, u)
    angle = rng.uniform(-np.pi, np.pi, len(n))[:, None]
    return np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u


def small_angles(rng: np.random.Generator, size: int) -> Any:
    """Angles in [0, pi/2], often 0, pi/2 or within 1e-4 .. 1e-12 of them."""
    angle = rng.uniform(0.0, np.pi / 2, size)
    tiny = 10.0 ** rng.uniform(-12, -4, size)
    pick = rng.integers(0, 6, size)
    angle = np.where(pick == 0, 0.0, angle)
    angle = np.where(pick == 1, tiny, angle)
    return np.where(pick == 2, np.pi / 2 - tiny, angle)


def sizes(rng: np.random.Generator, size: int) -> Any:
    """Radii and half lengths from 1e-6 to 1 m."""
    return 10.0 ** rng.uniform(-6.0, 0.0, (size, 1))


def bodies(shape: str, p: Any, n: Any, u: Any, rng: np.random.Generator) -> Bodies:
    """One obstacle for each contact.

    Args:
        shape: One of SHAPES.
        p: Contact points, shape (k, 3); [m].
        n: Unit normals, shape (k, 3); the bodies lie where n.x >= n.p.
        u: Directions to be parallel to, shape (k, 3).
        rng: Source of randomness.
    """
    if shape == "half_space":
        offsets, blank = np.einsum("ij,ij->i", -n, p), np.zeros((len(p), 3))
        return Bodies(
            HALF_SPACE, blank[:, None][:, :0], (), blank[:, 0], blank, -n, offsets
        )
    if shape.startswith("sliver"):
        return _slivers(shape, p, n, rng)
    if shape in ("hull", "mesh_slivers"):
        return _hulls(shape, p, n, rng)
    if shape.startswith(("box", "mesh", "plate")):
        return _boxes(shape, p, n, rng)
    return _round_bodies(shape, p, n, u, rng)


def _round_bodies(shape: str, p: Any, n: Any, u: Any, rng: Any) -> Bodies:
    """Spheres, capsules and cylinders."""
    size = len(p)
    e, f = across(n, rng)
    radius, half = sizes(rng, size), sizes(rng, size)
    phi = small_angles(rng, size)[:, None]
    if shape.endswith("parallel"):  # as parallel to the link as rounding allows
        e = u - np.einsum("ij,ij->i", u, n)[:, None] * n
        length = np.linalg.norm(e, axis=1)[:, None]
        e = np.where(length > 1e-3, e / np.maximum(length, 1e-3), f)
    shift = rng.uniform(-1.0, 1.0, (size, 1)) * half
    tilted = np.cos(phi) * n + np.sin(phi) * e
    axis, centre = e, p + radius * n + shift * e
    if shape == "capsule_cap":
        axis, centre = tilted, p + radius * n + half * tilted
    elif shape == "cylinder_cap":
        offset = rng.choice([0.0, 1.0, 0.5], (size, 1)) * radius * f
        axis, centre = n, p + half * n + offset
    elif shape == "cylinder_rim":
        rim = np.sin(phi) * n - np.cos(phi) * e
        axis, centre = tilted, p + half * tilted + radius * rim
    if shape.startswith("cylinder"):
        none = np.zeros((size, 0, 3))
        return Bodies(CYLINDER, none, (), radius[:, 0], centre, axis, half[:, 0])
    if shape == "sphere":
        points = (p + radius * n)[:, None]
    else:
        points = np.stack([centre - half * axis, centre + half * axis], axis=1)
    return hulls(points, radius[:, 0])


def _boxes(shape: str, p: Any, n: Any, rng: Any) -> Bodies:
    """Boxes, thin plates and meshes of boxes."""
    size = len(p)
    e, f = across(n, rng)
    half = 10.0 ** rng.uniform(-4.0, 0.0, (size, 3))
    phi = small_angles(rng, size)[:, None]
    if shape == "plate":
        half[:, 0] = 10.0 ** rng.uniform(-9.0, -3.0, size)
    frame = np.stack([n, e, f], axis=1)  # rows are the box's axes
    inside = rng.uniform(-1.0, 1.0, (size, 3))
    inside[:, 0] = -1.0
    a = np.cos(phi) * n + np.sin(phi) * e
    b = np.cos(phi) * e - np.sin(phi) * n
    if shape in ("box_edge", "mesh_box"):
        frame = np.stack([a, b, f], axis=1)
        inside[:, 1] = 1.0
    elif shape == "box_corner":
        chi = small_angles(rng, size)[:, None]
        c = np.cos(chi) * b - np.sin(chi) * f
        frame = np.stack([a, c, np.cross(a, c)], axis=1)
        low = np.sign(np.einsum("ikj,ij->ik", frame, n))
        inside = -np.where(low == 0.0, 1.0, low)
    centre = p - np.einsum("ik,ikj->ij", inside * half, frame)
    edges = half[..., None] * frame
    corners = centre[:, None] + np.einsum("ck,ikj->icj", CORNERS, edges)
    return hulls(corners, faces=BOX_FACES if shape == "mesh_box" else ())


def _slivers(shape: str, p: Any, n: Any, rng: Any) -> Bodies:
    """Triangles, some a billion times longer than wide."""
    size = len(p)
    e, f = across(n, rng)
    long, thin = sizes(rng, size), 10.0 ** rng.uniform(-10.0, -1.0, (size, 1))
    rise = 10.0 ** rng.uniform(-12.0, 0.0, (size, 1))
    if shape == "sliver_corner":
        rest = p + long * e + rise * n, p - long * thin * f + long * e + 2.0 * rise * n
        points = np.stack([p, *rest], axis=1)
    elif shape == "sliver_edge":
        points = np.stack([p - long * e, p + long * e, p + thin * f + rise * n], axis=1)
    else:
        points = np.stack([p - long * e, p + long * e - thin * f, p + thin * f], axis=1)
        points += (p - points.mean(axis=1))[:, None]
    return hulls(points)


def _hulls(shape: str, p: Any, n: Any, rng: Any) -> Bodies:
    """Hulls that rest on a corner, an edge or a face at p; fans of slivers."""
    size, count = len(p), 14 if shape == "mesh_slivers" else 7
    e, f = across(n, rng)
    long = sizes(rng, size)[:, :, None]
    if shape == "hull":
        flat = rng.uniform(-1.0, 1.0, (size, count - 1, 2))
        rise = rng.uniform(0.0, 1.0, (size, count - 1))
        # The first ones in the plane make an edge or a face of it.
        rise[np.arange(count - 1) < rng.integers(0, 4, size)[:, None]] = 0.0
    else:
        steps = 10.0 ** rng.uniform(-9.0, -0.5, (size, count - 1))
        angle = np.cumsum(steps, axis=1)
        flat = np.stack([np.cos(angle), np.sin(angle)], axis=2)
        rise = 10.0 ** rng.uniform(-12.0, 0.0, (size, 1)) * np.ones(count - 1)
    turned = flat[..., :1] * e[:, None] + flat[..., 1:] * f[:, None]
    rest = p[:, None] + long * (turned + rise[..., None] * n[:, None])
    points = np.concatenate([p[:, None], rest], axis=1)
    return hulls(points, faces=FAN_FACES if shape == "mesh_slivers" else ())
