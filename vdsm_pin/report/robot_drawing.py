"""What a page shows of a robot of a URDF: its links, its motion, its joints' plots.

Links are drawn as they are judged: a mesh as its convex hull.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.proof.bodies import Body
from vdsm_pin.proof.paths import Path
from vdsm_pin.report.charts import packed, series
from vdsm_pin.report.drawing import Silhouette, obstacle_data, row_data
from vdsm_pin.report.moves import quaternion, subdivided
from vdsm_pin.report.palette import link_colours
from vdsm_pin.report.solids import Surface, joined, piece_surface
from vdsm_pin.report.thinning import Thinned
from vdsm_pin.robots.cell import Cell
from vdsm_pin.units import MM_PER_M

_STEP: Final = np.deg2rad(4.0)
"""Between two moments that a page is told no joint moves farther; [rad], [m]."""

_MOST: Final = 4_000
"""Moments that a page is told besides the rows."""

_SMOOTH: Final = 8
"""Parts of a smooth piece at least."""


@dataclass(frozen=True)
class RobotDrawing:
    """How the motion of a robot of a URDF is drawn."""

    cell: Cell
    path: Path

    @property
    def names(self) -> list[str]:
        """Names of the links, in the order of the brackets."""
        return [body.name for body in self.cell.robot.bodies]

    def scene(self, obstacles: Sequence[Obstacle]) -> dict[str, Any]:
        """Some obstacles and the links, each about the middle of its corners."""
        bodies = self.cell.robot.bodies
        skins, middles = [_skin(body) for body in bodies], _middles(bodies)
        size = max(float(np.ptp(skin.vertices, axis=0).max()) for skin in skins)
        return {
            **obstacle_data(self.cell, obstacles, self.path, 2.0 * size),
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

    def motion(self, shown: Thinned) -> dict[str, Any]:
        """Where the links are at moments, near enough to go straight in between."""
        moments = _moments(self.path, shown)
        places, turns = self._stances(self.path.at_moments(moments))
        return {
            **row_data(self.path, shown),
            "moments": packed(moments, "<f8"),
            "links": len(self.cell.robot.bodies),
            "places": packed(places),
            "turns": packed(turns),
        }

    def stance(self, q: FloatArray) -> dict[str, Any]:
        """Middles and turns of the links at values of the joints, (n_joints,)."""
        places, turns = self._stances(q[None])
        return {"centres": places[:, 0].tolist(), "turns": turns[:, 0].tolist()}

    def _stances(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Middles and turns of the links at rows of q, (n_links, n_rows, 3 and 4)."""
        robot = self.cell.robot
        poses = robot.poses(q)
        places, turns = [], []
        for body, middle in zip(robot.bodies, _middles(robot.bodies), strict=True):
            of_link = poses[:, body.frame]
            places.append(of_link[:, :3, :3] @ middle + of_link[:, :3, 3])
            turns.append([quaternion(pose[:3, :3]) for pose in of_link])
        return np.array(places), np.array(turns)

    def silhouette(self, moment: float) -> Silhouette:
        """Corners of each link at a moment in waypoints."""
        robot = self.cell.robot
        poses = robot.poses(self.path.at_moments(np.array([moment])))[0]
        links = [
            _skin(body).vertices @ poses[body.frame][:3, :3].T
            + poses[body.frame][:3, 3]
            for body in robot.bodies
        ]
        return Silhouette(links, 0.0, np.zeros((0, 3)))

    def charts(
        self, shown: Thinned, clearances: list[dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """The clearances, the joints that turn, and those that slide."""
        joints, q = self.cell.robot.joints, self.path.knots[shown.rows]
        colours, charts = link_colours(len(joints)), list(clearances)
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
                        series(joints[k].name, colours[k], factor * q[:, k])
                        for k in mine
                    ],
                }
            )
        return charts


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
