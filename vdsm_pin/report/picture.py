"""A small still picture of a problem and its arm, as SVG, for the index of a batch."""

from typing import Final

import numpy as np
from shapely import MultiPoint, Polygon

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import HalfSpace
from vdsm_pin.problem.scene import solid_of
from vdsm_pin.report.moves import start_pose
from vdsm_pin.report.palette import OBSTACLE, OBSTACLE_EDGE, PATH, link_colours
from vdsm_pin.report.solids import surface
from vdsm_pin.report.thinning import MOST_DRAWN, nearest_obstacles
from vdsm_pin.verification.records import ArmVerification, Verification

_WIDTH, _HEIGHT = 240.0, 160.0
_MARGIN: Final = 12.0
_MOST_POINTS: Final = 150  # of a drawn line


def _view(points: FloatArray) -> FloatArray:
    """Seen from the side, the front and above, (n, 3) to (n, 2); y points down."""
    x, y, z = points.T
    return np.column_stack([0.88 * x - 0.36 * y, -0.92 * z - 0.2 * y - 0.12 * x])


def picture(verification: Verification) -> str:
    """The robot at the moment of its smallest clearance, in its scene."""
    if isinstance(verification, ArmVerification):
        return _of_arm(verification)
    # Whoever draws an arm needs no robots.
    from vdsm_pin.report.robot_page import placed_corners
    from vdsm_pin.robots.judgement import RobotVerification

    assert isinstance(verification, RobotVerification)
    links = [_hull(_view(corners)) for corners in placed_corners(verification)]
    scale, shift = _fitted(np.vstack(links), 1e-3)
    parts = [
        f'<polygon points="{_text(scale * link + shift)}" fill="{colour}" '
        'fill-opacity=".85"/>'
        for link, colour in zip(links, link_colours(len(links)), strict=True)
    ]
    return "".join([*_scene(verification, scale, shift), *parts, "</svg>\n"])


def _fitted(everything: FloatArray, least: float) -> tuple[float, FloatArray]:
    """Scale and shift that fit points into the picture."""
    low, span = everything.min(axis=0), np.ptp(everything, axis=0)
    room = np.array([_WIDTH, _HEIGHT]) - 2.0 * _MARGIN
    scale = float(np.min(room / np.maximum(span, least)))
    return scale, _MARGIN + (room - scale * span) / 2.0 - scale * low


def _scene(verification: Verification, scale: float, shift: FloatArray) -> list[str]:
    """The head of the picture and its obstacles."""
    head = f'viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}">'
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" {head}',
        *(
            f'<polygon points="{_text(scale * outline + shift)}" fill="{OBSTACLE}" '
            f'fill-opacity=".7" stroke="{OBSTACLE_EDGE}"/>'
            for outline in _outlines(verification)
        ),
    ]


def _of_arm(verification: ArmVerification) -> str:
    problem, rows = verification.problem, verification.trajectory
    arm = problem.manipulator
    k = verification.approaches[0].interval if verification.approaches else 0
    one = slice(k, k + 1)
    centres = joint_centres(arm, rows.x0[one], rows.alpha[one], rows.theta[one])[0]
    corners = np.zeros((0, 3)) if problem.tip_path is None else problem.path.corners
    seen, path = _view(centres), _view(_thin(corners))
    scale, shift = _fitted(np.vstack([seen, path]), arm.link_radius)
    parts = _scene(verification, scale, shift)
    if len(path):
        line = _text(scale * path + shift)
        ink = f'fill="none" stroke="{PATH}" stroke-width="1.5"'
        parts.append(f'<polyline points="{line}" {ink}/>')
    width = max(3.0, 2.0 * arm.link_radius * scale)
    body = scale * seen + shift
    parts += [
        f'<polyline points="{_text(body[i : i + 2])}" stroke="{colour}" '
        f'stroke-width="{width:.1f}" stroke-linecap="round"/>'
        for i, colour in enumerate(link_colours(arm.n_links))
    ]
    return "".join([*parts, "</svg>\n"])


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


def _text(points: FloatArray) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
