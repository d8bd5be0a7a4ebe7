"""Convex covers of points: hulls by Coal (Qhull), and the simplest solids."""

from typing import Final

import numpy as np

from vdsm_pin.arm.bodies import hull_distances, missed_by_few
from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.geometry.convex import FewCorners, Hull
from vdsm_pin.geometry.solids import BOX_CORNERS
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_hulls import coal_hull

UNIT_BOX: Final = (BOX_CORNERS + 1.0) / 2.0

FEW_CORNERS: Final = {32: 24, 400: 100}
"""From so many corners on a hull is also known by so few of them."""

SOME: Final = 64
"""Of so many points at once it is looked how far they are missed."""

WAYS: Final = np.concatenate([np.eye(3), -np.eye(3), BOX_CORNERS])
"""Directions in which the first of them are the outermost."""

MOST_GROWN: Final = 1e-6
"""By how much a hull may be grown to hold what Qhull takes for its surface; [m]."""


def covering_hull(points: FloatArray) -> Hull:
    """A hull of few of the points, grown until it is proved to hold all of them.

    Args:
        points: All of them differ, shape (n, 3); [m].
    """
    missed = missed_by_few(points)
    inner = missed <= TOLERANCES.arithmetic
    if (hull := coal_hull(points)) is not None:
        corners = np.array(hull.points())
        # A distance from a hull is convex: what is inner adds no more than it misses.
        known, rest = set(map(tuple, corners.tolist())), points[~inner]
        other = [tuple(point) not in known for point in rest.tolist()]
        grown = missed[inner].max(initial=0.0)
        grown += hull_distances(rest[other], corners).max(initial=0.0)
        if grown <= MOST_GROWN:
            return Hull(corners, float(grown), few_corners(corners))
    corners = points[missed > 0.0]
    return Hull(corners, few=few_corners(corners))


def few_corners(points: FloatArray) -> tuple[FewCorners, ...]:
    """Some of the corners that nearly span a hull, and more; none where it has few.

    The outermost in some directions, then, one by one, those that are missed most.

    Args:
        points: Shape (n, 3); [m].
    """
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    outermost = np.argmax(points @ (WAYS @ axes).T, axis=0).tolist()
    chosen, found = list(dict.fromkeys(outermost)), []
    missed = np.full(len(points), np.inf)
    for many, few in FEW_CORNERS.items():
        if len(points) < many:
            break
        while len(chosen) < few:
            chosen.append(_most_missed(points, chosen, missed))
        most = float(missed[_most_missed(points, chosen, missed)])
        few_points = frozen(points[chosen])
        found.append(FewCorners(few_points, most + TOLERANCES.arithmetic))
    return tuple(found)


def _most_missed(points: FloatArray, chosen: list[int], missed: FloatArray) -> int:
    """The point farthest from the hull of those that are chosen.

    Args:
        points: Shape (n, 3); [m].
        chosen: Numbers of some.
        missed: Bounds from above of how far each is, from when fewer were chosen or
            from now, shape (n,); renewed where that decides; [m].
    """
    fresh = np.zeros(len(points), bool)
    while not fresh[worst := int(np.argmax(missed))]:
        some = np.argsort(missed)[-SOME:]
        missed[some], fresh[some] = hull_distances(points[some], points[chosen]), True
    return worst


def covering_primitive(points: FloatArray) -> Hull:
    """The ball, capsule or box along the axes of inertia that holds all points.

    The one of least volume, grown by what arithmetic may lose.

    Args:
        points: Shape (n, 3); [m].
    """
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    along = (points - middle) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    grown = TOLERANCES.arithmetic
    box = Hull(middle + (low + (high - low) * UNIT_BOX) @ axes, grown)
    centre = 0.5 * (low + high)
    radius = float(np.linalg.norm(along - centre, axis=1).max())
    ball = Hull((middle + centre @ axes)[None], radius + grown)
    across = np.linalg.norm(along[:, 1:] - centre[1:], axis=1)
    girth = float(across.max())
    room = np.sqrt(np.maximum(girth**2 - across**2, 0.0))
    first, last = (along[:, 0] + room).min(), (along[:, 0] - room).max()
    first, last = min(first, last), max(first, last)
    ends = np.array([[first, *centre[1:]], [last, *centre[1:]]])
    capsule = Hull(middle + ends @ axes, girth + grown)
    length = last - first
    volumes = [
        float(np.prod(high - low)),
        4.0 / 3.0 * np.pi * radius**3,
        np.pi * girth**2 * (length + 4.0 / 3.0 * girth),
    ]
    return (box, ball, capsule)[int(np.argmin(volumes))]


def hull_triangles(points: FloatArray) -> tuple[FloatArray, IntArray] | None:
    """Corners and triangles of a hull; None where `coal_hull` has none.

    Returns:
        Corners, shape (n, 3); [m]. Triangles counter-clockwise from outside, (m, 3).
    """
    hull = coal_hull(points)
    if hull is None:
        return None
    corners, count = np.array(hull.points()), hull.num_polygons
    triangles = np.array(
        [[hull.polygons(k)[i] for i in range(3)] for k in range(count)]
    )
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    outward = a - corners.mean(axis=0)
    inside_out = np.einsum("ij,ij->i", np.cross(b - a, c - a), outward) < 0.0
    triangles[inside_out] = triangles[inside_out, ::-1]
    return corners, triangles
