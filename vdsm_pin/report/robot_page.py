"""What a page shows of a robot of a URDF: its links, its motion, its joints' plots.

Links are drawn as they are judged: a mesh as its convex hull.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.proof.bodies import Body
from vdsm_pin.proof.paths import Path
from vdsm_pin.report.charts import packed, series
from vdsm_pin.report.moves import quaternion, subdivided
from vdsm_pin.report.palette import link_colours
from vdsm_pin.report.solids import Surface, joined, piece_surface
from vdsm_pin.report.thinning import Thinned
from vdsm_pin.robots.judgement import RobotVerification
from vdsm_pin.robots.model import Robot
from vdsm_pin.units import MM_PER_M

_STEP: Final = np.deg2rad(4.0)
"""Between two moments that a page is told no joint moves farther; [rad], [m]."""

_MOST: Final = 4_000
"""Moments that a page is told besides the rows."""

_SMOOTH: Final = 8
"""Parts of a smooth piece at least."""


def robot_links(verification: RobotVerification) -> dict[str, Any]:
    """The links to draw, each about the middle of its corners."""
    bodies = verification.problem.robot.bodies
    skins, middles = [_skin(body) for body in bodies], _middles(bodies)
    size = max(float(np.ptp(skin.vertices, axis=0).max()) for skin in skins)
    return {
        "radius": 0.1 * size,
        "colours": list(link_colours(len(bodies))),
        "links": [
            {
                "name": body.name,
                "vertices": packed(skin.vertices - middle),
                "triangles": packed(skin.triangles, "<u4"),
                "round": skin.round,
            }
            for body, skin, middle in zip(bodies, skins, middles, strict=True)
        ],
    }


def robot_motion(verification: RobotVerification, shown: Thinned) -> dict[str, Any]:
    """Where the links are at moments, near enough to go straight in between."""
    cell, path = verification.problem, verification.trajectory
    moments = _moments(path, shown)
    places, turns = _stances(cell.robot, path.at_moments(moments))
    return {
        "moments": packed(moments, "<f8"),
        "links": len(cell.robot.bodies),
        "places": packed(places),
        "turns": packed(turns),
    }


def robot_stance(robot: Robot, q: FloatArray) -> dict[str, Any]:
    """Where the links are at values of the joints, shape (n_joints,)."""
    places, turns = _stances(robot, q[None])
    return {"centres": places[:, 0].tolist(), "turns": turns[:, 0].tolist()}


def _stances(robot: Robot, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middles of the links and their turns at rows of q, (n_links, n_rows, 3 and 4)."""
    poses = robot.poses(q)
    places, turns = [], []
    for body, middle in zip(robot.bodies, _middles(robot.bodies), strict=True):
        of_link = poses[:, body.frame]
        places.append(of_link[:, :3, :3] @ middle + of_link[:, :3, 3])
        turns.append([quaternion(pose[:3, :3]) for pose in of_link])
    return np.array(places), np.array(turns)


def placed_corners(verification: RobotVerification) -> list[FloatArray]:
    """Corners of each link where the motion comes nearest, shape (n, 3); [m]."""
    cell, path = verification.problem, verification.trajectory
    near = verification.approaches[:1]
    interval = np.array([one.interval for one in near] or [0])
    share = np.array([one.share for one in near] or [0.0])
    poses = cell.robot.poses(path.within(interval, share))[0]
    found = []
    for body in cell.robot.bodies:
        pose = poses[body.frame]
        found.append(_skin(body).vertices @ pose[:3, :3].T + pose[:3, 3])
    return found


def _moments(path: Path, shown: Thinned) -> FloatArray:
    rows = shown.rows.astype(np.float64)
    if len(rows) < 2:
        return rows
    ways = np.abs(np.diff(path.knots[shown.rows], axis=0)).max(axis=1, initial=0.0)
    most = max(1, _MOST // len(ways))
    least = 1 if path.degree == 1 else min(_SMOOTH, most)
    parts = np.ceil(ways / _STEP).clip(least, most).astype(int)
    return subdivided(rows, parts)


def _middles(bodies: Sequence[Body]) -> list[FloatArray]:
    """The middle of each body's corners, in the frame of its link; [m]."""
    found = []
    for body in bodies:
        corners = [
            piece.points if isinstance(piece, Hull) else np.array([piece.centre])
            for piece in body.pieces
            if isinstance(piece, Hull | FlatCylinder)
        ]
        found.append(np.concatenate(corners).mean(axis=0))
    return found


def _skin(body: Body) -> Surface:
    """Triangles to draw a body with, in the frame of its link."""
    return joined([piece_surface(piece) for piece in body.pieces])


def joint_charts(
    verification: RobotVerification, shown: Thinned
) -> list[dict[str, Any]]:
    """A plot of the joints that turn, and one of those that slide."""
    joints = verification.problem.robot.joints
    q = verification.trajectory.knots[shown.rows]
    colours, charts = link_colours(len(joints)), []
    for turns, name, unit, factor in (
        (True, "Joint angles", "°", np.degrees(1.0)),
        (False, "Joint positions", " mm", MM_PER_M),
    ):
        mine = [k for k, joint in enumerate(joints) if joint.turns is turns]
        if not mine:
            continue
        charts.append(
            {
                "id": "turning" if turns else "sliding",
                "title": name,
                "note": "By the names of the URDF, at the waypoints.",
                "unit": unit,
                "axis": f"value [{unit.strip()}]",
                "limits": [],
                "series": [
                    series(joints[k].name, colours[k], factor * q[:, k]) for k in mine
                ],
            }
        )
    return charts
