"""Figs. 4 and 11-13: the paths of the key points in four views, and joint by joint."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_figures import style
from paper_figures.marks import marks
from paper_figures.runs import Run
from paper_figures.scenery import (
    ROOM,
    draw_arm,
    draw_danger_edge,
    draw_desired_path,
    draw_key_paths,
    draw_obstacles,
    square,
)
from paper_figures.views import FRONT, OBLIQUE, SIDE, TOP, View, thin

SCALE: Final = 0.95
"""Of the three views along the axes; [inch/m]."""

LEFT, GAP, FOOT, HEAD = 0.55, 0.62, 0.40, 0.26
STRIP: Final = 1.28
"""Height of the row of single joints; [inch]."""


def four_views(run: Run, single_joints: bool) -> Figure:
    """Paths of O_1..O_{N+1}, seen along the axes and obliquely.

    Args:
        run: A plan.
        single_joints: Whether to add each joint's projected path by itself.
    """
    size = SCALE * (ROOM[1] - ROOM[0])
    strip = STRIP if single_joints else 0.0
    figure = style.sheet(strip + 2.0 * (size[2] + FOOT + HEAD))
    low = strip + FOOT
    high = strip + 2.0 * FOOT + HEAD + size[1]
    right = LEFT + size[0] + GAP
    front = style.place(figure, LEFT, high, size[0], size[2])
    side = style.place(figure, right, high, size[1], size[2])
    top = style.place(figure, LEFT, low, size[0], size[1])
    rest = style.WIDTH - right + 0.28
    perspective = style.place(
        figure, right - 0.33, strip + 0.05, rest, low - strip + size[1] - 0.05
    )
    for axes, view, letter, name in (
        (front, FRONT, "a", "front view"),
        (side, SIDE, "b", "side view"),
        (top, TOP, "c", "top view"),
    ):
        _view(axes, view, run)
        square(axes, view, ROOM[0], ROOM[1])
        style.panel_title(axes, letter, name)
    _oblique(perspective, run)
    _legend(figure, side, run)
    if single_joints:
        _single_joints(figure, run)
    return figure


def _view(axes: Axes, view: View, run: Run) -> None:
    draw_danger_edge(axes, view, run.problem)
    draw_obstacles(axes, view, run.problem)
    draw_desired_path(axes, view, run.problem)
    draw_key_paths(axes, view, run.problem.manipulator, run.centres)


def _oblique(axes: Axes, run: Run) -> None:
    """The paths with the arm at mid-way of its hardest stretch, without axes."""
    axes.set_aspect("equal")
    axes.axis("off")
    rail = OBLIQUE(np.array([[ROOM[0, 0], 0.0, 0.0], [ROOM[1, 0], 0.0, 0.0]]))
    axes.plot(*rail.T, color=style.FAINT, linewidth=0.6, dashes=(8, 2, 1, 2), zorder=1)
    _view(axes, OBLIQUE, run)
    row = int(np.argmax(run.psi.sum(axis=1)))
    draw_arm(axes, OBLIQUE, run.problem, run.centres[row], zorder=6.0, behind=2.5)
    corners = np.array(np.meshgrid(*ROOM.T)).reshape(3, -1).T
    seen = OBLIQUE(corners)
    axes.set_xlim(seen[:, 0].min(), seen[:, 0].max())
    axes.set_ylim(seen[:, 1].min(), seen[:, 1].max())
    here = {mark.row: mark.name for mark in marks(run)}.get(row, f"waypoint {row}")
    axes.set_title(f"     (d) oblique view, arm at {here}")


def _legend(figure: Figure, beside: Axes, run: Run) -> None:
    colours = style.key_colours(run.problem.manipulator)
    lines = [Line2D([], [], color=colour, linewidth=1.6) for colour in colours]
    names = [f"O{style.subscript(i)}" for i in range(1, len(colours) + 1)]
    names[-1] += " tip"
    lines.append(Line2D([], [], color=style.FAINT, linewidth=2.4, alpha=0.45))
    names.append("desired")
    place = beside.get_position()
    figure.legend(
        lines, names, loc="upper left", bbox_to_anchor=(place.x1 + 0.012, place.y1),
        handlelength=1.2, labelspacing=0.35,
    )  # fmt: skip


def _single_joints(figure: Figure, run: Run) -> None:
    """Panels (e) on: the projection of each joint's path, to one scale."""
    arm = run.problem.manipulator
    colours = style.key_colours(arm)
    count = arm.n_links - 1
    width = (style.WIDTH - LEFT - 0.08) / count
    for k in range(count):
        axes = style.place(figure, LEFT + k * width, 0.20, width - 0.06, width - 0.06)
        draw_danger_edge(axes, SIDE, run.problem)
        draw_obstacles(axes, SIDE, run.problem, zorder=1.0)
        line = thin(SIDE(run.centres[:, k + 1]))
        axes.plot(*line.T, color=colours[k + 1], linewidth=1.0)
        square(axes, SIDE, ROOM[0], ROOM[1])
        axes.set(xlabel="", ylabel="", xticks=[0, 1000], yticks=[0, 1000])
        if k > 0:
            axes.tick_params(labelleft=False)
        letter = chr(ord("e") + k)
        axes.set_title(f"({letter}) O{style.subscript(k + 2)}", pad=2.5)
