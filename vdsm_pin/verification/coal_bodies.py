"""Obstacles as Coal geometry, and one careful distance call.

What Coal 3.0 needs to be believed (each point has a test): a GJK tolerance of 1e-8,
since 1e-6 reads 1.5e-6 m too far and 1e-12 returns NaN; the default EPA tolerance; a
fresh result for every call, since a used one keeps its smaller value; and below zero
only the sign. A mesh is its surface to Coal: whoever is inside one is told the distance
to its skin, so that the sign of a body in a mesh has to come from elsewhere.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray, frozen, turn_z_to
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    PointCloud,
    Prism,
    Solid,
    Sphere,
    Voxels,
)
from vdsm_pin.tolerances import TOLERANCES

GROUP: Final = 64
"""Bodies of a cloud that share a ball around them."""


@dataclass(frozen=True, eq=False)
class CoalBody:
    """One Coal geometry at its place; an obstacle is one or more of them.

    Args:
        geometry: A coal.CollisionGeometry.
        pose: Its coal.Transform3s in the base frame.
    """

    geometry: Any
    pose: Any


class Measured(NamedTuple):
    """What Coal says about two bodies.

    Args:
        distance: Positive apart; where they meet only the sign is meant; -inf where
            Coal gives no usable answer; [m].
        near: Witness on the first body, base frame, shape (3,); [m].
        far: Witness on the second, base frame, shape (3,); [m].
    """

    distance: float
    near: FloatArray
    far: FloatArray


class CoalCloud:
    """Many equal bodies, of which those that can be the nearest are measured.

    Args:
        shape: The coal.CollisionGeometry of each.
        rotation: Of each, shape (3, 3); [-].
        centres: Shape (n, 3), base frame; [m].
        reach: No point of a body is farther than this from its centre; [m].
    """

    def __init__(
        self, shape: Any, rotation: FloatArray, centres: FloatArray, reach: float
    ) -> None:
        centres = centres[coherent_order(centres)]
        n = len(centres)
        self._shape, self._rotation, self._centres = shape, rotation, centres
        self._first = np.arange(0, n, GROUP)
        low = np.minimum.reduceat(centres, self._first)
        high = np.maximum.reduceat(centres, self._first)
        self._middle = 0.5 * (low + high)
        self._each = reach
        self._reach = np.linalg.norm(high - self._middle, axis=1) + reach

    def nearest_first(self, geometry: Any, pose: Any) -> Iterator["Group"]:
        """Groups of the bodies with a lower bound of their distance, least first."""
        geometry.computeLocalAABB()
        bounds = _gaps(geometry.aabb_local, pose, self._middle) - self._reach
        for k in np.argsort(bounds):
            part = self._centres[self._first[k] : self._first[k] + GROUP]
            each = _gaps(geometry.aabb_local, pose, part) - self._each
            yield Group(float(bounds[k]), self._bodies(part, each))

    def _bodies(
        self, centres: FloatArray, bounds: FloatArray
    ) -> Iterator[tuple[float, CoalBody]]:
        import coal

        for k in np.argsort(bounds):
            pose = coal.Transform3s(np.array(self._rotation), centres[k])
            yield float(bounds[k]), CoalBody(self._shape, pose)


def _gaps(box: Any, pose: Any, points: FloatArray) -> FloatArray:
    """How far points (n, 3) lie off a placed coal.AABB, shape (n,); [m]."""
    place = (points - pose.getTranslation()) @ pose.getRotation()
    gaps = np.maximum(np.maximum(place - box.max_, box.min_ - place), 0.0)
    return np.asarray(np.linalg.norm(gaps, axis=1))


@dataclass(frozen=True, eq=False)
class Group:
    """Some bodies of an obstacle.

    Args:
        bound: Lower bound of their distance; [m].
        bodies: Made as they are asked for, with a lower bound each, least first.
    """

    bound: float
    bodies: Iterable[tuple[float, CoalBody]]


CoalObstacle: TypeAlias = tuple[CoalBody, ...] | CoalCloud

NOTHING: Final = Measured(
    float("inf"), frozen(np.full(3, np.nan)), frozen(np.full(3, np.nan))
)
"""The distance to no body at all."""

LARGEST: Final = float(np.finfo(np.float64).max)
"""Coal's way to say that it has no answer, with a minus sign."""


def coal_bodies(obstacle: Solid) -> CoalObstacle:
    """The Coal geometry of a solid, in its own frame: the base's where it rests.

    Args:
        obstacle: Any solid of a scene.

    Returns:
        One body; for a prism over a non-convex polygon one per convex section, for
        points and voxels one each.

    Raises:
        VerificationFailed: If Coal refuses the shape.
    """
    import coal

    try:
        return _bodies(coal, obstacle)
    except (ValueError, RuntimeError) as error:
        message = f"obstacle {obstacle.name!r}: Coal refuses the shape: {error}"
        raise VerificationFailed(message) from error


def _bodies(coal: Any, obstacle: Solid) -> CoalObstacle:
    match obstacle:
        case Sphere():
            return (_placed(coal, coal.Sphere(obstacle.radius), obstacle.centre),)
        case Capsule():
            body = coal.Capsule(obstacle.radius, 2.0 * obstacle.half_length)
            return (_placed(coal, body, obstacle.centre, turn_z_to(obstacle.axis)),)
        case Cylinder():
            body = coal.Cylinder(obstacle.radius, 2.0 * obstacle.half_length)
            return (_placed(coal, body, obstacle.centre, turn_z_to(obstacle.axis)),)
        case Box():
            body = coal.Box(2.0 * obstacle.half_size)
            return (_placed(coal, body, obstacle.centre, obstacle.rotation),)
        case HalfSpace():
            normal = obstacle.normal
            body = coal.Halfspace(normal, float(normal @ obstacle.point))
            return (_placed(coal, body, np.zeros(3)),)
        case Prism():
            parts = (
                _swept(coal, _prism_corners(obstacle, section))
                for section in obstacle.convex_sections
            )
            return tuple(_placed(coal, part, np.zeros(3)) for part in parts)
        case Mesh():
            return (_placed(coal, _surface(coal, obstacle), np.zeros(3)),)
        case PointCloud():
            ball, radius = coal.Sphere(obstacle.radius), obstacle.radius
            return CoalCloud(ball, np.eye(3), obstacle.points, radius)
        case Voxels():
            cell, half = coal.Box(2.0 * obstacle.half_size), obstacle.half_size
            reach = float(np.linalg.norm(half))
            return CoalCloud(cell, obstacle.rotation, obstacle.centres, reach)


def _placed(
    coal: Any, geometry: Any, p: FloatArray, R: FloatArray | None = None
) -> CoalBody:
    rotation = np.eye(3) if R is None else R
    return CoalBody(geometry, coal.Transform3s(np.array(rotation), np.array(p)))


def _prism_corners(prism: Prism, section: FloatArray) -> FloatArray:
    ends = [np.column_stack([section, np.full(len(section), s)]) for s in prism.span]
    return np.asarray(prism.origin + np.vstack(ends) @ prism.rotation.T)


def _swept(coal: Any, corners: FloatArray) -> Any:
    """A convex polygon swept along a line, by its corners at both ends, (2 k, 3).

    Coal is told the faces: its own way to find them ends the process where the body
    is flat. A corner may have below 256 neighbours, so the ends are cut in zigzag.
    """
    k = len(corners) // 2
    zigzag = [i // 2 if i % 2 == 0 else k - 1 - i // 2 for i in range(k)]
    faces: list[tuple[int, int, int]] = []
    for i, (a, b, c) in enumerate(zip(zigzag, zigzag[1:], zigzag[2:], strict=False)):
        low = (a, c, b) if i % 2 else (a, b, c)
        faces += [low, (k + low[0], k + low[2], k + low[1])]
    for i in range(k):
        j = (i + 1) % k
        faces += [(i, j, k + j), (i, k + j, k + i)]
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend(list(corners))
    triangles.extend([coal.Triangle(*face) for face in faces])
    return coal.Convex(points, triangles)


def _surface(coal: Any, mesh: Mesh) -> Any:
    """A hierarchy over the triangles; building one twice crashes Coal."""
    bvh = coal.BVHModelOBBRSS()
    bvh.beginModel(len(mesh.triangles), len(mesh.vertices))
    bvh.addVertices(np.array(mesh.vertices))
    bvh.addTriangles(np.array(mesh.triangles))
    bvh.endModel()
    if bvh.num_tris != len(mesh.triangles):
        message = (
            f"obstacle {mesh.name!r}: Coal loaded {bvh.num_tris} triangles "
            f"of {len(mesh.triangles)}"
        )
        raise VerificationFailed(message)
    return bvh


def distance_request() -> Any:
    """Coal's settings for a distance that can be compared with a proof."""
    import coal

    request = coal.DistanceRequest()
    request.gjk_tolerance = TOLERANCES.coal_gjk
    request.enable_signed_distance = True
    return request


def measure(request: Any, geometry: Any, pose: Any, bodies: CoalObstacle) -> Measured:
    """Distance between one body and the nearest part of an obstacle.

    Args:
        request: From `distance_request`.
        geometry: A coal.CollisionGeometry.
        pose: Its coal.Transform3s.
        bodies: The obstacle.

    Returns:
        The nearest part's answer; one unusable answer makes the whole unusable.
    """
    if not isinstance(bodies, CoalCloud):
        return _nearest(request, geometry, pose, bodies)
    best = NOTHING
    for group in bodies.nearest_first(geometry, pose):
        if group.bound > max(best.distance, 0.0):
            break  # where they meet the sign is known
        for bound, body in group.bodies:
            if bound > max(best.distance, 0.0):
                break
            found = _nearest(request, geometry, pose, (body,))
            best = min(best, found, key=lambda one: one.distance)
    return best


def _nearest(
    request: Any, geometry: Any, pose: Any, bodies: Iterable[CoalBody]
) -> Measured:
    import coal

    best = NOTHING
    for body in bodies:
        result = coal.DistanceResult()
        distance = coal.distance(
            geometry, pose, body.geometry, body.pose, request, result
        )
        near, far = result.getNearestPoint1(), result.getNearestPoint2()
        if not _usable(distance, result.min_distance, near, far):
            return Measured(float("-inf"), near, far)
        if distance < best.distance:
            best = Measured(float(distance), near, far)
    return best


def _usable(distance: float, stored: float, near: FloatArray, far: FloatArray) -> bool:
    """Whether an answer is one: a number, no sentinel, and borne out by its witness."""
    if distance != stored or not abs(distance) < LARGEST:
        return False
    if distance <= 0.0:
        return True
    excess = abs(math.dist(near.tolist(), far.tolist()) - distance)
    return excess <= TOLERANCES.coal_agreement
