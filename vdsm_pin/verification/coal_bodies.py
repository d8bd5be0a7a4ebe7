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
from vdsm_pin.geometry.arrays import FloatArray
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

    def nearest(
        self, request: Any, result: Any, geometry: Any, pose: Any
    ) -> tuple[float, CoalBody | None]:
        """The nearest body and its distance; arguments as for `measure`; [m]."""
        import coal

        geometry.computeLocalAABB()
        box, best, found = geometry.aabb_local, math.inf, None
        bounds = _gaps(box, pose, self._middle) - self._reach
        for k in np.argsort(bounds):
            if bounds[k] > max(best, 0.0):
                break  # where they meet the sign is known
            group = self._centres[k * GROUP : (k + 1) * GROUP]
            each = _gaps(box, pose, group) - self._each
            for i in np.argsort(each):
                if each[i] > max(best, 0.0):
                    break
                body = placed(self._shape, group[i], self._rotation)
                told = _answer(coal, request, result, geometry, pose, body)
                if told < best:
                    best, found = told, body
        return best, found


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


def measure(
    request: Any, geometry: Any, pose: Any, bodies: CoalObstacle, result: Any = None
) -> float:
    """Distance between one body and the nearest part of an obstacle; [m].

    Args:
        request: From `distance_request`.
        geometry: A coal.CollisionGeometry.
        pose: Its coal.Transform3s.
        bodies: The obstacle.
        result: A coal.DistanceResult to use again: a new one costs as much as a
            distance.

    Returns:
        Positive apart; where they meet only the sign is meant. One unusable answer
        makes the whole unusable: -inf.
    """
    import coal

    result = coal.DistanceResult() if result is None else result
    return _nearest(coal, request, result, geometry, pose, bodies)[0]


def _nearest(
    coal: Any, request: Any, result: Any, geometry: Any, pose: Any, bodies: CoalObstacle
) -> tuple[float, CoalBody | None]:
    """`measure`, and the part of the obstacle that is nearest."""
    if isinstance(bodies, CoalCloud):
        return bodies.nearest(request, result, geometry, pose)
    best, found = math.inf, None
    for body in bodies:
        told = _answer(coal, request, result, geometry, pose, body)
        if told < best:
            best, found = told, body
    return best, found


def _answer(
    coal: Any, request: Any, result: Any, geometry: Any, pose: Any, body: CoalBody
) -> float:
    """Coal's distance of two bodies; -inf where its answer is not usable; [m]."""
    result.clear()
    distance: float = coal.distance(
        geometry, pose, body.geometry, body.pose, request, result
    )
    gap = distance
    if distance > 0.0:
        near, far = result.getNearestPoint1(), result.getNearestPoint2()
        gap = math.dist(near.tolist(), far.tolist())
    return distance if _usable(distance, result.min_distance, gap) else -math.inf


def _usable(distance: float, stored: float, gap: float) -> bool:
    """Whether an answer is one: a number, no sentinel, and borne out by its witness.

    Args:
        distance: As Coal returns it; [m].
        stored: The same as Coal keeps it; [m].
        gap: Between its witnesses; [m].
    """
    borne_out = abs(gap - distance) <= TOLERANCES.coal_agreement
    number = distance == stored and abs(distance) < LARGEST
    return bool(number and (borne_out or distance <= 0.0))


Call: TypeAlias = tuple[int, Any, FloatArray, FloatArray, CoalObstacle | None]
"""Number of a pair, a coal.CollisionGeometry and its R and p, and the obstacle that it
is measured from; None for one that Coal cannot take."""


def measure_each(calls: Iterable[Call], count: int) -> FloatArray:
    """`measure` of many pairs, each the nearest of its calls, shape (count,); [m].

    Args:
        calls: What is asked.
        count: Number of pairs; NaN is told of one without any call.
    """
    import coal

    request, result = distance_request(), coal.DistanceResult()
    found, pose = [math.nan] * count, coal.Transform3s()
    for pair, shape, turn, shift, bodies in calls:
        pose.setTransform(turn, shift)
        if bodies:
            told = measure(request, shape, pose, bodies, result)
            if not found[pair] <= told:
                found[pair] = told
    return np.array(found)


class Witness(NamedTuple):
    """Where Coal has two bodies nearest to each other.

    Args:
        near: On the first body, in the frame of the second, shape (3,); [m].
        far: On the second body, the same; [m].
        normal: Unit vector from the second body towards the first, the shortest way
            out where they meet, shape (3,); [-].
    """

    near: FloatArray
    far: FloatArray
    normal: FloatArray


def witness(calls: Iterable[Call]) -> Witness:
    """The witness of the nearest of the calls of one pair, none of them without bodies.

    Args:
        calls: What is asked, of one pair.
    """
    import coal

    request, result = distance_request(), coal.DistanceResult()
    least, asked = math.inf, None
    for _, shape, turn, shift, bodies in calls:
        assert bodies
        pose = coal.Transform3s(turn, shift)
        told, body = _nearest(coal, request, result, shape, pose, bodies)
        if body is not None and told < least:
            least, asked = told, (shape, pose, body.geometry, body.pose)
    assert asked is not None
    result.clear()
    coal.distance(*asked, request, result)
    near, far = result.getNearestPoint1(), result.getNearestPoint2()
    # Coal's normal goes from the first body to the second.
    return Witness(np.array(near), np.array(far), -np.array(result.normal))
