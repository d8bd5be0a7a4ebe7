"""Obstacles seen along an axis: the convex section of a prismatic body.

The paper's rule works on a section: along X for obs1 and obs2 (seen in the plane Y0Z0),
along Z or Y for obs3 (top or front view). A body that ends somewhere along its axis is
taken as endless, and a section that is not convex as its hull; both are on the safe
side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import shapely

from vdsm_pin.geometry.arrays import FloatArray, freeze
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, Prism
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.tolerances import TOLERANCES

VIEWS: Final = {"x": (1, 2), "y": (0, 2), "z": (0, 1)}
"""The two coordinates seen along each axis."""


@dataclass(frozen=True)
class Section:
    """Convex hull of points in a view, grown by a radius.

    Args:
        name: Name of the obstacle.
        points: Corners of the hull in counterclockwise order, shape (n, 2), n >= 1;
            [m].
        radius: 0 or more; [m].
        centres: Of the obstacles that it stands for, where there are several, shape
            (k, 2); [m].
    """

    name: str
    points: FloatArray
    radius: float
    centres: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self, "points")

    @cached_property
    def centre(self) -> FloatArray:
        """Centre of the corners' bounding circle, shape (2,); [m]."""
        circle = shapely.minimum_bounding_circle(shapely.MultiPoint(self.points))
        return np.array(circle.centroid.coords[0])

    def rounded(self, rounding: float) -> "Section":
        """A larger section with blunter corners.

        The corners shrink towards the centre by that part while the radius grows to
        make up for it: 0 leaves the section alone, 1 gives its enclosing circle.
        """
        if rounding == 0.0 or len(self.points) == 1:
            return self
        offset = self.points - self.centre
        if rounding == 1.0:
            offset = offset[:1] * 0.0
        reach = float(np.linalg.norm(self.points - self.centre, axis=1).max())
        points = self.centre + (1.0 - rounding) * offset
        radius = self.radius + rounding * reach
        return Section(self.name, points, radius, self.centres)


def merged(sections: Sequence[Section]) -> Section:
    """One convex section that holds several; one alone stays as it is.

    Points are grown by the largest radius of all, which is on the safe side.
    """
    if len(sections) == 1:
        return sections[0]
    return Section(
        " and ".join(section.name for section in sections),
        hull_corners(np.vstack([section.points for section in sections])),
        max(section.radius for section in sections),
        np.stack([section.centre for section in sections]),
    )


def section_along(obstacle: Obstacle, axis: str) -> Section | None:
    """The section of an obstacle seen along x, y or z; None if it is not prismatic so.

    Args:
        obstacle: Any solid of the scene.
        axis: "x", "y" or "z".
    """
    unit = np.eye(3)["xyz".index(axis)]
    view = list(VIEWS[axis])
    match obstacle:
        case Cylinder() | Capsule():
            if not _parallel(obstacle.axis, unit):
                return None
            centre = obstacle.centre[None, view]
            return Section(obstacle.name, centre, obstacle.radius)
        case Box():
            if not any(_parallel(edge, unit) for edge in obstacle.rotation.T):
                return None
        case Prism():
            if not _parallel(obstacle.rotation[:, 2], unit):
                return None
        case _:
            return None
    corners = np.vstack([piece.points for piece in obstacle.pieces])  # type: ignore[union-attr]
    return Section(obstacle.name, hull_corners(corners[:, view]), 0.0)


def hull_corners(points: FloatArray) -> FloatArray:
    """Corners of the convex hull of points in a plane, counterclockwise, (n, 2)."""
    hull = shapely.MultiPoint(points).convex_hull
    if hull.geom_type != "Polygon":
        return np.asarray(shapely.get_coordinates(hull))
    return np.asarray(shapely.get_coordinates(shapely.orient_polygons(hull))[:-1])


def grown_by(problem: PlanningProblem) -> float:
    """How far the axis of a link stays from an obstacle's surface; [m]."""
    return problem.manipulator.most_radius + planned_gap(problem)


def planned_gap(problem: PlanningProblem) -> float:
    """Clearance aimed at: the required one and the reserves, no margin; [m]."""
    reserves = TOLERANCES.planned_clearance + TOLERANCES.planned_reserve
    return problem.required_clearance + reserves


def _parallel(direction: FloatArray, unit: FloatArray) -> bool:
    return bool(np.linalg.norm(np.cross(direction, unit)) <= TOLERANCES.parallel)
