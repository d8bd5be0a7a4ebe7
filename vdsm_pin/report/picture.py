"""A small still picture of a problem and its arm, as SVG, for the index of a batch."""

from typing import Final

import numpy as np
from shapely import MultiPoint, Polygon

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import HalfSpace
from vdsm_pin.problem.scene import solid_of
from vdsm_pin.report.drawing import start_pose
from vdsm_pin.report.html import rendered
from vdsm_pin.report.page_data import drawing_of
from vdsm_pin.report.palette import OBSTACLE, OBSTACLE_EDGE, PATH, link_colours
from vdsm_pin.report.solids import surface
from vdsm_pin.report.thinning import MOST_DRAWN, nearest_obstacles
from vdsm_pin.verification.records import Verification

_WIDTH, _HEIGHT = 240, 160
_MARGIN: Final = 12.0
_MOST_POINTS: Final = 150  # of a drawn line


def _view(points: FloatArray) -> FloatArray:
    """Seen from the side, the front and above, (n, 3) to (n, 2); y points down."""
    x, y, z = points.T
    return np.column_stack([0.88 * x - 0.36 * y, -0.92 * z - 0.2 * y - 0.12 * x])


def picture(verification: Verification) -> str:
    """The arm or robot at the moment of its smallest clearance, in its scene."""
    near = verification.approaches[:1]
    moment = near[0].moment if near else 0.0
    drawing = drawing_of(verification.problem, verification.trajectory)
    shape = drawing.silhouette(moment)
    links, path = list(map(_view, shape.links)), _view(_thin(drawing.path))
    everything = np.vstack([*links, path])
    low, span = everything.min(axis=0), np.ptp(everything, axis=0)
    room = np.array([_WIDTH, _HEIGHT]) - 2.0 * _MARGIN
    scale = float(np.min(room / np.maximum(span, shape.radius or 1e-3)))
    shift = _MARGIN + (room - scale * span) / 2.0 - scale * low

    def text(points: FloatArray) -> str:
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in scale * points + shift)

    hulls = links if shape.radius else list(map(_hull, links))
    return rendered(
        "picture.svg.j2",
        width=_WIDTH,
        height=_HEIGHT,
        obstacles=list(map(text, _outlines(verification))),
        path=text(path),
        links=list(zip(map(text, hulls), link_colours(len(links)), strict=True)),
        thick=max(3.0, 2.0 * shape.radius * scale) if shape.radius else 0.0,
        obstacle_colour=OBSTACLE,
        edge_colour=OBSTACLE_EDGE,
        path_colour=PATH,
    )


def _outlines(verification: Verification) -> list[FloatArray]:
    found = []
    obstacles = verification.problem.scene.obstacles
    for k in nearest_obstacles(verification, MOST_DRAWN):
        solid = solid_of(obstacles[k])
        if isinstance(solid, HalfSpace):
            continue  # covers all or nothing of a flat picture
        pose = start_pose(obstacles[k], verification.trajectory)
        corners = surface(solid, 1.0).vertices @ pose[:3, :3].T + pose[:3, 3]
        found.append(_hull(_view(corners)))
    return found


def _hull(points: FloatArray) -> FloatArray:
    """The corners of the hull of points in the plane; of points in a line its ends."""
    hull = MultiPoint(points).convex_hull
    if isinstance(hull, Polygon):
        return np.asarray(hull.exterior.coords)[:-1]
    return np.asarray(hull.coords)


def _thin(points: FloatArray) -> FloatArray:
    chosen = np.linspace(0, len(points) - 1, min(len(points), _MOST_POINTS))
    return points[np.unique(chosen.astype(np.int64))]
