"""What a page shows of a robot of a URDF: its links, its motion, its joints' plots.

Links are drawn as the URDF says that they look, and as they are judged: a mesh as its
convex hull.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, first_equal, quaternions
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.proof.bodies import Body
from vdsm_pin.report.charts import chart, packed, series
from vdsm_pin.report.drawing import (
    DrawnPart,
    Silhouette,
    obstacle_data,
    row_data,
    subdivided,
)
from vdsm_pin.report.palette import link_colours
from vdsm_pin.report.solids import Surface, coarse, joined, piece_surface
from vdsm_pin.report.thinning import Thinned, thinned
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.visuals import Visual, Visuals, visuals_of
from vdsm_pin.units import MM_PER_M

_STEP: Final = np.deg2rad(4.0)
"""Between two moments that a page is told no joint moves farther; [rad], [m]."""

_MOST: Final = 4_000
"""Moments that a page is told besides the rows."""

_SMOOTH: Final = 8
"""Parts of a smooth piece at least."""

LOOK_TRIANGLES: Final = 24_000
"""Triangles that a page has at most of how all links look: about half a megabyte."""

FEWEST_TRIANGLES: Final = 60
"""Of one mesh: below, it is no longer recognised."""


@dataclass(frozen=True)
class RobotDrawing:
    """How the motion of a robot of a URDF is drawn."""

    problem: Cell
    trajectory: JointTrajectory

    @property
    def extent(self) -> float:
        """How far obstacles without an end are drawn; [m]."""
        spans = [np.ptp(skin.vertices, axis=0).max() for skin in self._skins]
        return 2.0 * float(max(spans))

    @property
    def path(self) -> FloatArray:
        """No desired path, shape (0, 3)."""
        return np.zeros((0, 3))

    @property
    def names(self) -> list[str]:
        """Names of the links, in the order of the brackets."""
        return [body.name for body in self.problem.robot.bodies]

    @property
    def not_drawn(self) -> list[str]:
        """What cannot be read of how links look."""
        return self._visuals.notes

    def scene(self, obstacles: Sequence[Obstacle]) -> dict[str, Any]:
        """Some obstacles and the links, each about the middle of its corners."""
        bodies = self.problem.robot.bodies
        return {
            **obstacle_data(self.problem, obstacles, self.trajectory, self.extent),
            "radius": 0.05 * self.extent,
            "colours": list(link_colours(len(bodies))),
            "links": [
                {
                    "name": body.name,
                    "vertices": packed(skin.vertices),
                    "triangles": packed(skin.triangles, "<u4"),
                    "round": skin.round,
                    "looks": [_told(*look) for look in looks],
                }
                for body, skin, looks in zip(
                    bodies, self._skins, self._looks, strict=True
                )
            ],
        }

    def motion(self, shown: Thinned) -> dict[str, Any]:
        """Where the links are at moments, near enough to go straight in between."""
        moments = _moments(self.trajectory, shown)
        places, turns = self._stances(self.trajectory.path.at_moments(moments))
        return {
            **row_data(self.trajectory, shown),
            "moments": packed(moments, "<f8"),
            "links": len(self.problem.robot.bodies),
            "places": packed(places),
            "turns": packed(turns),
        }

    def stance(self, q: FloatArray) -> dict[str, Any]:
        """Middles and turns of the links at values of the joints, (n_joints,)."""
        places, turns = self._stances(q[None])
        return {"centres": places[:, 0].tolist(), "turns": turns[:, 0].tolist()}

    def _stances(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Middles and turns of the links at rows of q, (n_links, n_rows, 3 and 4)."""
        places, turns = self._frames(q)
        return places, quaternions(turns)

    def _frames(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Middles and turns of the links at rows of q, (n_links, n_rows, ..)."""
        robot = self.problem.robot
        poses, bodies = robot.poses(q), zip(robot.bodies, self._middles, strict=True)
        places = [
            poses[:, body.frame, :3, :3] @ middle + poses[:, body.frame, :3, 3]
            for body, middle in bodies
        ]
        turns = [poses[:, body.frame, :3, :3] for body in robot.bodies]
        return np.array(places), np.array(turns)

    @cached_property
    def _middles(self) -> list[FloatArray]:
        """The middle of each link's corners, in its frame; [m]."""
        return [_middle(body) for body in self.problem.robot.bodies]

    @cached_property
    def _skins(self) -> list[Surface]:
        """Triangles to draw each link with, about its middle."""
        skins = []
        for body, middle in zip(self.problem.robot.bodies, self._middles, strict=True):
            skin = joined([piece_surface(piece) for piece in body.pieces])
            skins.append(replace(skin, vertices=skin.vertices - middle))
        return skins

    @cached_property
    def _visuals(self) -> Visuals:
        return visuals_of(self.problem.robot)

    @cached_property
    def _looks(self) -> list[list[tuple[Surface, str]]]:
        """How each link looks besides, about its middle, and in which colours."""
        links = self._visuals.links
        shapes = [one.shape for one in chain(*links)]
        count = sum(len(shape) for shape in shapes if isinstance(shape, np.ndarray))
        share = min(1.0, LOOK_TRIANGLES / max(1, count))
        return [
            [(_look(one, middle, share), one.colour) for one in looks]
            for looks, middle in zip(links, self._middles, strict=True)
        ]

    def silhouette(self, moment: float) -> Silhouette:
        """Corners of each link at a moment in waypoints."""
        places, turns = self._frames(
            self.trajectory.path.at_moments(np.array([moment]))
        )
        each = zip(self._skins, places, turns, strict=True)
        links = [skin.vertices @ turn[0].T + place[0] for skin, place, turn in each]
        return Silhouette(links, 0.0)

    def told_moments(self) -> FloatArray:
        """Moments near enough that links go straight and turn evenly in between."""
        return _moments(self.trajectory, thinned(self.trajectory, np.zeros(0, int)))

    def points(self, moments: FloatArray) -> FloatArray:
        """The links' middles at moments in waypoints, shape (n, n_links, 3); [m]."""
        places, _ = self._frames(self.trajectory.path.at_moments(moments))
        return places.swapaxes(0, 1)

    def parts(self, moments: FloatArray) -> list[DrawnPart]:
        """The links at moments in waypoints."""
        colours, parts = link_colours(len(self.names)), []
        rows = self._frames(self.trajectory.path.at_moments(moments))
        each = zip(self.names, self._skins, self._looks, colours, *rows, strict=True)
        for name, skin, looks, colour, places, turns in each:
            for shown, ink in looks or [(skin, colour)]:
                parts.append(DrawnPart(name, shown, ink, places, turns))
        return parts

    def charts(
        self, shown: Thinned, clearances: list[dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """The clearances, the joints that turn, and those that slide."""
        joints, q = self.problem.robot.joints, self.trajectory.q[shown.rows]
        colours, charts = link_colours(len(joints)), list(clearances)
        note = "By the names of the URDF, at the waypoints."
        for turns, kind, title, unit, factor in (
            (True, "turning", "Joint angles", "°", np.degrees(1.0)),
            (False, "sliding", "Joint positions", "mm", MM_PER_M),
        ):
            lines = [
                series(joint.name, colours[k], factor * q[:, k])
                for k, joint in enumerate(joints)
                if joint.turns is turns
            ]
            if lines:
                charts.append(chart(title, f"value [{unit}]", lines, note, id=kind))
        return charts


def _moments(motion: JointTrajectory, shown: Thinned) -> FloatArray:
    rows = shown.rows.astype(np.float64)
    if len(rows) < 2:
        return rows
    ways = np.abs(np.diff(motion.q[shown.rows], axis=0)).max(axis=1, initial=0.0)
    most = max(1, _MOST // len(ways))
    least = 1 if motion.path.degree == 1 else min(_SMOOTH, most)
    parts = np.ceil(ways / _STEP).clip(least, most).astype(int)
    return subdivided(rows, parts)


def _look(visual: Visual, middle: FloatArray, share: float) -> Surface:
    """How a link looks, about its middle, with a part of its triangles."""
    if not isinstance(visual.shape, np.ndarray):
        skin = piece_surface(visual.shape)
        return replace(skin, vertices=skin.vertices - middle)
    corners = visual.shape.reshape(-1, 3) - middle
    first, index = first_equal(corners)
    most = max(FEWEST_TRIANGLES, int(share * len(visual.shape)))
    return coarse(corners[first], index.reshape(-1, 3), most)


def _told(skin: Surface, colour: str) -> dict[str, Any]:
    """What a page is told of how a link looks."""
    return {
        "vertices": packed(skin.vertices),
        "triangles": packed(skin.triangles, "<u4"),
        "round": skin.round,
        "colour": colour,
    }


def _middle(body: Body) -> FloatArray:
    """The middle of a body's corners, in the frame of its link; [m]."""
    corners = [
        piece.points if isinstance(piece, Hull) else np.array([piece.centre])
        for piece in body.pieces
        if isinstance(piece, Hull | FlatCylinder)
    ]
    return np.asarray(np.concatenate(corners).mean(axis=0))
