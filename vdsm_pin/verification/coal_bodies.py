"""Obstacles as Coal geometry, and one careful distance call.

What Coal 3.0 needs to be believed (each point has a test): a GJK tolerance of 1e-8,
since 1e-6 reads 1.5e-6 m too far and 1e-12 returns NaN; the default EPA tolerance; a
cleared result for every call, since a used one keeps its smaller value; and below zero
only the sign. A mesh is its surface to Coal: whoever is inside one is told the distance
to its skin, so that the sign of a body in a mesh has to come from elsewhere.
"""

import math
from collections.abc import Iterable
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.solids import (
    Box,
    Capsule,
    ConvexCover,
    Cylinder,
    HalfSpace,
    Mesh,
    PointCloud,
    Prism,
    Solid,
    Sphere,
    Voxels,
)
from vdsm_pin.problem.scene import Obstacle, solid_of
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_hulls import CoalBody, coal_parts, placed, swept_polygon

GROUP: Final = 64
"""Bodies of a cloud that share a ball around them."""


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


NOTHING: Final = Measured(
    float("inf"), frozen(np.full(3, np.nan)), frozen(np.full(3, np.nan))
)
"""The distance to no body at all."""


class CoalCloud:
    """Many equal bodies, of which those that can be the nearest are measured.

    Coal's broad-phase managers are of no use: their one result keeps the last closed
    form, of balls, and not the least.

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
        self._shape, self._rotation, self._centres = shape, rotation, centres
        first = np.arange(0, len(centres), GROUP)
        low = np.minimum.reduceat(centres, first)
        high = np.maximum.reduceat(centres, first)
        self._middle = 0.5 * (low + high)
        self._each = reach
        self._reach = np.linalg.norm(high - self._middle, axis=1) + reach

    def measured(self, request: Any, geometry: Any, pose: Any) -> Measured:
        """What Coal says of the nearest body; arguments are those of `measure`."""
        geometry.computeLocalAABB()
        box, best, result = geometry.aabb_local, NOTHING, new_result()
        bounds = _gaps(box, pose, self._middle) - self._reach
        for k in np.argsort(bounds):
            if bounds[k] > max(best.distance, 0.0):
                break  # where they meet the sign is known
            group = self._centres[k * GROUP : (k + 1) * GROUP]
            each = _gaps(box, pose, group) - self._each
            for i in np.argsort(each):
                if each[i] > max(best.distance, 0.0):
                    break
                body = placed(self._shape, group[i], self._rotation)
                found = _nearest(request, geometry, pose, (body,), result)
                best = min(best, found, key=lambda one: one.distance)
        return best


def _gaps(box: Any, pose: Any, points: FloatArray) -> FloatArray:
    """How far points (n, 3) lie off a placed coal.AABB, shape (n,); [m]."""
    place = (points - pose.getTranslation()) @ pose.getRotation()
    gaps = np.maximum(np.maximum(place - box.max_, box.min_ - place), 0.0)
    return np.asarray(np.linalg.norm(gaps, axis=1))


CoalObstacle: TypeAlias = tuple[CoalBody, ...] | CoalCloud

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
        case Sphere() | Capsule() | Cylinder():
            parts = coal_parts(obstacle.pieces)
            assert parts is not None  # Coal takes all of these
            return parts
        case Box():
            body = coal.Box(2.0 * obstacle.half_size)
            return (placed(body, obstacle.centre, obstacle.rotation),)
        case HalfSpace():
            normal = obstacle.normal
            return (placed(coal.Halfspace(normal, float(normal @ obstacle.point))),)
        case Prism():
            hulls = (one for one in obstacle.pieces if isinstance(one, Hull))
            return tuple(placed(swept_polygon(one.points)) for one in hulls)
        case Mesh():
            return (placed(_surface(coal, obstacle)),)
        case PointCloud():
            ball, radius = coal.Sphere(obstacle.radius), obstacle.radius
            return CoalCloud(ball, np.eye(3), obstacle.points, radius)
        case Voxels():
            cell, half = coal.Box(2.0 * obstacle.half_size), obstacle.half_size
            reach = float(np.linalg.norm(half))
            return CoalCloud(cell, obstacle.rotation, obstacle.centres, reach)


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


def coal_obstacle(obstacle: Obstacle) -> CoalObstacle | None:
    """An obstacle as Coal has it; None where Coal cannot take a piece of it.

    Raises:
        VerificationFailed: If Coal refuses the shape.
    """
    solid: Solid | ConvexCover = solid_of(obstacle)
    if isinstance(solid, ConvexCover):
        return coal_parts(solid.pieces)
    return coal_bodies(solid)


def distance_request() -> Any:
    """Coal's settings for a distance that can be compared with a proof."""
    import coal

    request = coal.DistanceRequest()
    request.gjk_tolerance = TOLERANCES.coal_gjk
    request.enable_signed_distance = True
    return request


def new_result() -> Any:
    """Room for one answer of Coal after the other."""
    import coal

    return coal.DistanceResult()


def measure(
    request: Any, geometry: Any, pose: Any, bodies: CoalObstacle, result: Any = None
) -> Measured:
    """Distance between one body and the nearest part of an obstacle.

    Args:
        request: From `distance_request`.
        geometry: A coal.CollisionGeometry.
        pose: Its coal.Transform3s.
        bodies: The obstacle.
        result: From `new_result`, for those who measure much; None for a new one.

    Returns:
        The nearest part's answer; one unusable answer makes the whole unusable.
    """
    if isinstance(bodies, CoalCloud):
        return bodies.measured(request, geometry, pose)
    return _nearest(request, geometry, pose, bodies, result or new_result())


def _nearest(
    request: Any, geometry: Any, pose: Any, bodies: Iterable[CoalBody], result: Any
) -> Measured:
    import coal

    best = NOTHING
    for body in bodies:
        result.clear()
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
