"""Obstacles seen along an axis: the convex section of a prismatic body.

The paper's rule works on a section: along X for obs1 and obs2 (seen in the plane Y0Z0),
along Z or Y for obs3 (top or front view). A body that ends somewhere along its axis is
taken as endless, and a section that is not convex as its hull; both are on the safe
side.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, Prism
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.tolerances import TOLERANCES

VIEWS: Final = {"x": (1, 2), "y": (0, 2), "z": (0, 1)}
"""The two coordinates seen along each axis."""


class Passed(NamedTuple):
    """What is gone round.

    Args:
        section: Of one obstacle, or one that holds several.
        obstacles: Their numbers in the scene.
    """

    section: DangerRegion
    obstacles: tuple[int, ...]


def merged(sections: Sequence[DangerRegion]) -> DangerRegion:
    """One convex section that holds several; one alone stays as it is.

    Points are grown by the largest radius of all, which is on the safe side.
    """
    if len(sections) == 1:
        return sections[0]
    return DangerRegion(
        " and ".join(section.name for section in sections),
        hull_corners(np.vstack([section.corners for section in sections])),
        max(section.radius for section in sections),
        np.stack([section.middle for section in sections]),
    )


def section_along(obstacle: Obstacle, axis: str) -> DangerRegion | None:
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
            return DangerRegion(obstacle.name, centre, obstacle.radius)
        case Box():
            if not any(_parallel(edge, unit) for edge in obstacle.rotation.T):
                return None
        case Prism():
            if not _parallel(obstacle.rotation[:, 2], unit):
                return None
        case _:
            return None
    corners = np.vstack([piece.points for piece in obstacle.pieces])  # type: ignore[union-attr]
    return DangerRegion(obstacle.name, hull_corners(corners[:, view]), 0.0)


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
    between = TOLERANCES.planned_reserve * problem.manipulator.total_length
    return problem.required_clearance + TOLERANCES.planned_clearance + between


def _parallel(direction: FloatArray, unit: FloatArray) -> bool:
    return bool(np.linalg.norm(np.cross(direction, unit)) <= TOLERANCES.parallel)
