"""Drawing of obstacles, danger regions, paths and the arm at its true thickness."""

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon
from matplotlib.ticker import MultipleLocator

from paper_figures import style
from paper_figures.views import View, thin
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.solids import HalfSpace
from vdsm_pin.planner.paper.sections import VIEWS, section_along
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.report.palette import OBSTACLE, OBSTACLE_EDGE
from vdsm_pin.report.solids import surface
from vdsm_pin.units import MM_PER_M

ROOM: Final = np.array([[-0.25, -0.70, -0.40], [3.35, 1.20, 1.50]])
"""The part of the base frame that is drawn: low and high corner, shape (2, 3); [m]."""

PIECES: Final = 24
"""Pieces into which a link is cut where an obstacle may hide it."""


def outline(axes: Axes, shape: shapely.Geometry, **look: object) -> None:
    """Fill a polygon of the drawing plane; holes do not occur."""
    for part in shapely.get_parts(shape):
        corners = shapely.get_coordinates(part.exterior)
        axes.add_patch(Polygon(corners, closed=True, **look))  # type: ignore[arg-type]


def faces(view: View, obstacle: Obstacle) -> tuple[shapely.Geometry, shapely.Geometry]:
    """An obstacle in a view, cut to the room: its silhouette and its visible faces."""
    room = ROOM if not isinstance(obstacle, HalfSpace) else 2.0 * ROOM
    solid = surface(obstacle, 4.0)
    corners = np.clip(solid.vertices, room[0], room[1])
    triangles = corners[solid.triangles]
    normals = np.cross(
        triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    )
    lengths = np.linalg.norm(normals, axis=1)
    seen = normals @ view.towards > 1e-3 * lengths
    silhouette = shapely.MultiPoint(view(corners)).convex_hull
    flat = [shapely.polygons(view(t)) for t in triangles[seen & _end(normals, lengths)]]
    return silhouette, shapely.union_all(shapely.make_valid(flat))


def _end(normals: FloatArray, lengths: FloatArray) -> BoolArray:
    """Triangles square to an axis: the ends of the bodies that are drawn here."""
    unit = normals / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    return np.asarray((np.abs(unit) > 1.0 - 1e-6).any(axis=1))


def draw_obstacles(
    axes: Axes, view: View, problem: PlanningProblem, zorder: float = 3.0
) -> None:
    """The obstacles, translucent, their ends a little stronger."""
    for obstacle in problem.scene.obstacles:
        silhouette, ends = faces(view, obstacle)
        outline(
            axes,
            silhouette,
            facecolor=OBSTACLE,
            edgecolor=OBSTACLE_EDGE,
            linewidth=0.6,
            alpha=0.55,
            zorder=zorder,
        )
        if not ends.is_empty and ends.area < 0.99 * silhouette.area:
            outline(
                axes,
                ends,
                facecolor=OBSTACLE,
                edgecolor=OBSTACLE_EDGE,
                linewidth=0.6,
                alpha=0.6,
                zorder=zorder,
            )


@dataclass(frozen=True)
class Zone:
    """The section of an obstacle, grown by a radius.

    Args:
        core: What is grown, in the projection plane; [m].
        radius: [m].
    """

    core: shapely.Geometry
    radius: float

    @property
    def shape(self) -> shapely.Geometry:
        """As a polygon of the drawing plane; [mm]."""
        core = shapely.transform(self.core, lambda xy: xy * MM_PER_M)
        return core.buffer(self.radius * MM_PER_M, quad_segs=24)

    @property
    def centre(self) -> FloatArray:
        """Centroid of the core, shape (2,); [m]."""
        return np.array(self.core.centroid.coords[0])


def zone(problem: PlanningProblem, axis: str, growth: float) -> Zone | None:
    """The first obstacle's section along x, y or z, grown; None if it has none so.

    Args:
        problem: What was asked.
        axis: "x", "y" or "z".
        growth: [m].
    """
    if not problem.scene.obstacles:
        return None
    section = section_along(problem.scene.obstacles[0], axis)
    if section is None:
        return None
    return Zone(
        shapely.MultiPoint(section.corners).convex_hull, section.radius + growth
    )


def danger_zone(problem: PlanningProblem, axis: str) -> Zone | None:
    """Where the axis of a link must not go: body radius and required clearance.

    The planner's region grows it further where joints slide.
    """
    growth = problem.manipulator.link_radius + problem.required_clearance
    return zone(problem, axis, growth)


def draw_section(axes: Axes, problem: PlanningProblem, axis: str) -> None:
    """The obstacle and its danger region, seen along the axis it is prismatic along."""
    danger, body = danger_zone(problem, axis), zone(problem, axis, 0.0)
    if danger is None or body is None:
        return
    outline(
        axes,
        danger.shape,
        facecolor=style.DANGER,
        edgecolor=style.DANGER_EDGE,
        linewidth=0.7,
        linestyle=(0, (4, 2)),
        zorder=1.0,
    )
    outline(
        axes,
        body.shape,
        facecolor=OBSTACLE,
        edgecolor=OBSTACLE_EDGE,
        linewidth=0.8,
        zorder=1.5,
    )


def draw_danger_edge(axes: Axes, view: View, problem: PlanningProblem) -> None:
    """The edge of the danger region, in the view along the obstacle's axis only."""
    for axis, along in zip("xyz", np.eye(3), strict=True):
        danger = danger_zone(problem, axis)
        if danger is not None and np.allclose(np.abs(view.towards), along):
            outline(
                axes,
                danger.shape,
                fill=False,
                edgecolor=style.DANGER_EDGE,
                linewidth=0.7,
                linestyle=(0, (3, 2)),
                zorder=2.0,
            )


def draw_desired_path(axes: Axes, view: View, problem: PlanningProblem) -> None:
    """What the tip shall draw."""
    line = view(problem.path.corners)
    axes.plot(*line.T, color=style.FAINT, linewidth=2.4, alpha=0.45, zorder=1.8)


def draw_key_paths(
    axes: Axes, view: View, manipulator: Manipulator, centres: FloatArray
) -> None:
    """The paths of O_1..O_{N+1}, each in its colour."""
    colours = style.key_colours(manipulator)
    for i, colour in enumerate(colours):
        line = thin(view(centres[:, i]))
        axes.plot(*line.T, color=colour, linewidth=1.0, zorder=4.0 + 0.01 * i)


def hidden(view: View, problem: PlanningProblem, points: FloatArray) -> BoolArray:
    """Whether an obstacle stands between points and the viewer, shape (n, 3) to (n,).

    Seen along its own axis, an endless prismatic body hides what the ray to the viewer
    crosses it for.
    """
    covered = np.zeros(len(points), dtype=bool)
    far = points + 20.0 * view.towards
    for obstacle in problem.scene.obstacles:
        for axis, columns in VIEWS.items():
            section = section_along(obstacle, axis)
            if section is None:
                continue
            core = shapely.MultiPoint(section.corners).convex_hull
            body = core.buffer(section.radius) if section.radius else core
            rays = np.stack([points, far], axis=1)[:, :, list(columns)]
            covered |= shapely.intersects(body, shapely.linestrings(rays))
            break
    return covered


def draw_arm(
    axes: Axes,
    view: View,
    problem: PlanningProblem,
    centres: FloatArray,
    *,
    alpha: float = 1.0,
    zorder: float = 5.0,
    behind: float | None = None,
) -> None:
    """The arm as capsules of true thickness, with a light along its upper side.

    Args:
        axes: Where to draw.
        view: The view.
        problem: Arm and obstacles.
        centres: Joint centres, shape (N + 1, 3); [m].
        alpha: Opacity; [-].
        zorder: Where visible parts are put.
        behind: Where parts hidden by an obstacle are put; None to hide nothing.
    """
    arm = problem.manipulator
    colours = style.key_colours(arm)
    radius = arm.link_radius * MM_PER_M
    order = np.argsort(view.depth(0.5 * (centres[1:] + centres[:-1])))
    for place, i in enumerate(order):
        for covered, part in _parts(view, problem, centres[i : i + 2], behind):
            level = zorder if not covered or behind is None else behind
            level += 0.02 * place
            base = to_rgb(colours[i])
            axis = shapely.linestrings(view(part))
            body = axis.buffer(radius, quad_segs=6)
            outline(
                axes,
                body,
                facecolor=base,
                edgecolor=_shade(base, 0.55),
                linewidth=0.4,
                alpha=alpha,
                zorder=level,
            )
            light = shapely.transform(
                axis.buffer(0.30 * radius, quad_segs=3),
                lambda xy: xy + np.array([-0.15, 0.38]) * radius,
            )
            outline(
                axes,
                light,
                facecolor=_shade(base, 1.5),
                edgecolor="none",
                alpha=0.55 * alpha,
                zorder=level + 0.01,
            )


def _parts(
    view: View, problem: PlanningProblem, link: FloatArray, behind: float | None
) -> list[tuple[bool, FloatArray]]:
    """A link cut where it goes behind an obstacle: hidden or not, and its two ends."""
    if behind is None or not problem.scene.obstacles:
        return [(False, link)]
    along = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    points = link[0] + along * (link[1] - link[0])
    covered = hidden(view, problem, 0.5 * (points[1:] + points[:-1]))
    cuts = np.flatnonzero(np.diff(covered)) + 1
    bounds = [0, *cuts.tolist(), PIECES]
    return [(bool(covered[a]), points[[a, b]]) for a, b in itertools.pairwise(bounds)]


def _shade(colour: tuple[float, float, float], factor: float) -> tuple[float, ...]:
    """A darker (below 1) or lighter (above 1) colour."""
    if factor <= 1.0:
        return tuple(factor * c for c in colour)
    share = (factor - 1.0) / factor
    return tuple(c + (1.0 - c) * share * 1.6 if share < 0.6 else 1.0 for c in colour)


def square(axes: Axes, view: View, low: FloatArray, high: FloatArray) -> None:
    """Equal axes that show a box of the base frame, labelled.

    Args:
        axes: The axes.
        view: A view along a coordinate axis.
        low: Low corner, shape (3,); [m].
        high: High corner, shape (3,); [m].
    """
    axes.set_aspect("equal")
    (left, bottom), (right, top) = view(low), view(high)
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_xlabel(view.labels[0])
    axes.set_ylabel(view.labels[1])
    axes.xaxis.set_major_locator(MultipleLocator(500))
    axes.yaxis.set_major_locator(MultipleLocator(500))
    axes.grid(visible=True)
