"""Drawings of one waypoint: the shadow, the cross, the lift, angles and cables.

A `Canvas` is a small plane drawing as SVG: equal scales, axes in millimetres.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely

from vdsm_pin.app.explanation.cross import Cross
from vdsm_pin.app.explanation.parts import Moment, name
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import HalfSpace
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.problem.scene import solid_of
from vdsm_pin.report.html import rendered
from vdsm_pin.report.palette import link_colours
from vdsm_pin.report.solids import surface
from vdsm_pin.units import MM_PER_M, signed

WIDTH: Final = 560.0
MARGIN: Final = 46.0
MOST_HEIGHT: Final = 620.0
TICKS: Final = 6
"""About so many ticks on the longer axis."""


class Canvas:
    """A drawing that holds some points.

    Args:
        points: What must be inside, shape (n, 2); [m].
        across: Name of the first coordinate.
        up: Name of the second one.
    """

    def __init__(self, points: FloatArray, across: str, up: str) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        pad = 0.05 * float(np.max(high - low)) + 0.05
        self._low, span = low - pad, high - low + 2.0 * pad
        room = WIDTH - 2.0 * MARGIN, MOST_HEIGHT - 2.0 * MARGIN
        self._scale = float(min(room / span))
        self._size = self._scale * span + 2.0 * MARGIN
        self._parts: list[dict[str, str]] = []
        self._axes(low - pad, high + pad, (across, up))

    def line(
        self, points: FloatArray, style: str, colour: str = "", width: float = 1.4
    ) -> None:
        """A polyline of shape (n, 2), in one of the page's styles; [m]."""
        points_text, thick = self._text(points), f"{width:g}"
        self._put("line", style, points=points_text, colour=colour, width=thick)

    def area(self, outline: FloatArray, style: str) -> None:
        """An outline of shape (n, 2), as far as it lies inside the drawing; [m]."""
        width, height = (f"{size:.1f}" for size in self._size - 2.0 * MARGIN)
        self._put("area", style, points=self._text(outline), width=width, height=height)

    def dot(
        self,
        point: FloatArray,
        style: str,
        label: str = "",
        beside: tuple[float, float] = (6.0, -6.0),
    ) -> None:
        """A point of shape (2,) with a word beside it.

        Args:
            point: [m].
            style: One of the page's.
            label: The word.
            beside: Where it stands; to the left of a negative number it ends; [px].
        """
        x, y = self._place(point)
        self._put("dot", style, x=f"{x:.1f}", y=f"{y:.1f}")
        if label:
            dx, dy = beside
            self._word(x + dx, y + dy, "start" if dx > 0.0 else "end", label)

    def svg(self, title: str) -> str:
        """The drawing; the title is read out where it cannot be seen."""
        width, height = (f"{size:.0f}" for size in self._size)
        size = {"width": width, "height": height, "margin": f"{MARGIN:g}"}
        return rendered("canvas.svg.j2", title=title, parts=self._parts, **size)

    def _put(self, kind: str, style: str, **values: str) -> None:
        self._parts.append({"kind": kind, "style": style, **values})

    def _word(
        self, x: float, y: float, anchor: str, text: str, style: str = ""
    ) -> None:
        places = {"x": f"{x:.1f}", "y": f"{y:.1f}"}
        self._put("word", style, anchor=anchor, text=text, **places)

    def _axes(self, low: FloatArray, high: FloatArray, names: tuple[str, str]) -> None:
        step = round_step(float(np.max(high - low)) / TICKS)
        for axis, word in enumerate(names):
            first, last = math.ceil(low[axis] / step), math.floor(high[axis] / step)
            for k in range(first, last + 1):
                ends = np.stack([low, high])
                ends[:, axis] = k * step
                self.line(ends, "grid", width=0.6)
                x, y = self._place(ends[0])
                at = (x, y + 14, "middle") if axis == 0 else (x - 6, y + 4, "end")
                tick = signed(f"{k * step * MM_PER_M:.0f}")
                self._word(*at, tick, "tick")
            far = [[high[0], low[1]], [low[0], high[1]]][axis]
            x, y = self._place(np.array(far))
            shift, anchor = [(30.0, "end"), (-10.0, "start")][axis]
            self._word(x, y + shift, anchor, f"{word} [mm]")

    def _place(self, point: FloatArray) -> tuple[float, float]:
        x, y = self._scale * (point - self._low) + MARGIN
        return float(x), float(self._size[1] - y)

    def _text(self, points: FloatArray) -> str:
        return " ".join("{:.1f},{:.1f}".format(*self._place(p)) for p in points)


def round_step(step: float) -> float:
    """The next larger of 1, 2, 5 times a power of ten; [m]."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= step)


VIEWS = {"y": (1, 2), "side": (0, 2), "top": (0, 1)}


def outline(region: DangerRegion) -> FloatArray:
    """The boundary of a danger region, shape (n, 2); [m]."""
    core = shapely.MultiPoint(region.corners).convex_hull
    return np.asarray(core.buffer(region.radius, quad_segs=32).exterior.coords)


def shadows(moment: Moment, view: Sequence[int]) -> list[FloatArray]:
    """Outlines of the obstacles in a view, half-spaces left out; [m]."""
    found = []
    for obstacle in map(solid_of, moment.plan.problem.scene.obstacles):
        if isinstance(obstacle, HalfSpace):
            continue
        corners = surface(obstacle, 1.0).vertices[:, list(view)]
        hull = shapely.MultiPoint(corners).convex_hull
        if isinstance(hull, shapely.Polygon):
            found.append(np.asarray(hull.exterior.coords))
    return found


def canvas(
    moment: Moment,
    view: tuple[int, int],
    regions: Sequence[DangerRegion] = (),
    more: Sequence[FloatArray] = (),
) -> Canvas:
    """Obstacles, danger regions and the desired path, seen in a view.

    Args:
        moment: The plan at its waypoint.
        view: The two coordinates seen.
        regions: Danger regions.
        more: Points that must be inside too, shape (n, 2) each; [m].
    """
    path, centres = moment.plan.problem.path, moment.steps.centres
    corners = path.corners[:, list(view)]
    shown = [corners, centres[moment.row][:, list(view)], path.start[None, list(view)]]
    made = Canvas(np.concatenate([*shown, *more]), *("xyz"[k] for k in view))
    for body in shadows(moment, view):
        made.area(body, "obstacle")
    for region in regions:
        made.area(outline(region), "region")
    made.line(corners, "path")
    return made


def chain(made: Canvas, arm: Manipulator, points: FloatArray, letter: str) -> None:
    """The links in their colours and the joints with their names."""
    for i, colour in enumerate(link_colours(arm.n_links)):
        made.line(points[i : i + 2], "link", colour, 3.0)
    rises = (points[-1] - points[0]).prod() > 0.0
    beside = (7.0, 15.0) if rises else (7.0, -7.0)
    for i, point in enumerate(points):
        made.dot(point, "joint", name(letter, i + 1), beside)


def cross_pictures(
    moment: Moment, crosses: Sequence[Cross], region: DangerRegion
) -> tuple[str, ...]:
    """Every cross that moves a joint, in one scale."""
    moved = [one for one in crosses if one.moved]
    places = [one.points for one in moved]
    return tuple(
        _cross_picture(
            moment, one, canvas(moment, VIEWS["y"], [region, one.region], places)
        )
        for one in moved
    )


def _cross_picture(moment: Moment, one: Cross, made: Canvas) -> str:
    """P'_i on the ray to P_{i+1}, the cross, its four points, P_i."""
    arm, planar = moment.plan.problem.manipulator, moment.planar
    i = one.joint
    made.line(np.stack([planar[0], planar[i]]), "ray")
    colours = link_colours(arm.n_links)
    for j in range(i - 1, arm.n_links):
        made.line(planar[j : j + 2], "link", colours[j], 3.0)
    for k in (0, 2):
        made.line(one.points[k : k + 2], "cross")
    for k, point in enumerate(one.points):
        made.dot(point, "nearest" if k == one.nearest else "crossing")
    made.line(one.way, "cross")
    made.dot(one.proportional, "wanted", name("P′", i), (-7.0, -7.0))
    made.dot(one.former, "former", "before", (-9.0, 4.0))
    made.dot(planar[i], "joint", name("P", i + 1), (8.0, 5.0))
    made.dot(one.place, "taken", name("P", i), (4.0, -9.0))
    return made.svg(f"Step 5 for joint {i}")


def link_angle_bars(psi: FloatArray, limit: float) -> str:
    """Link angles psi, shape (N,), as bars beside their limit; [deg]."""
    names = [name("ψ", k + 1) for k in range(len(psi))]
    rows = zip(names, psi.tolist(), link_colours(len(psi)), strict=True)
    top = 1.1 * max(limit, float(np.abs(psi).max()))
    return rendered("bars.svg.j2", bars=list(rows), limit=limit, top=top)


def hole_circle(arm: Manipulator, change: FloatArray) -> str:
    """The cable holes on their circle; dark ones paid out, bright ones drawn in.

    Args:
        arm: The arm.
        change: Cable lengths less those of the straight arm, shape (N, 3); [m].
    """
    angles, colours = arm.cables.hole_angles, link_colours(arm.n_links)
    shares = change / (float(np.abs(change).max()) or 1.0)
    holes = [
        (f"{j + 1}{'abc'[k]}", np.sin(angle), np.cos(angle), shares[j, k], colours[j])
        for (j, k), angle in np.ndenumerate(angles)
    ]
    return rendered("holes.svg.j2", holes=holes)
