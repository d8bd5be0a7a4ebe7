"""Figs. 7-9: the arm in the projection along the rail."""

from collections.abc import Sequence

import numpy as np
import shapely
from matplotlib.axes import Axes

from paper_figures import style
from paper_figures.labels import label_dots
from paper_figures.runs import Run
from paper_figures.scenery import danger_zone, draw_section, outline, square
from paper_figures.steps import sliding_region
from paper_figures.views import SIDE, thin
from vdsm_pin.geometry.arrays import FloatArray

LOW, HIGH = np.array([0.0, -0.12, -0.24]), np.array([0.0, 1.16, 1.40])
"""The part of the projection that is drawn: low and high corner, shape (3,); [m]."""


def draw_background(axes: Axes, run: Run, row: int) -> None:
    """Obstacle, danger region, the boundary used at this row, and the desired path."""
    draw_section(axes, run.problem, "x")
    used = sliding_region(run, row)
    if used is not None:
        outline(
            axes,
            used.shape,
            fill=False,
            edgecolor=style.DANGER_EDGE,
            linewidth=0.9,
            zorder=1.6,
        )
    corners = SIDE(run.problem.path.corners)
    axes.plot(*corners.T, color=style.FAINT, linewidth=2.2, alpha=0.45, zorder=1.8)
    square(axes, SIDE, LOW, HIGH)


def draw_chain(
    axes: Axes, run: Run, row: int, beside: Sequence[FloatArray] = ()
) -> None:
    """The projected arm P_1..P_{N+1} as coloured links and dots with their names.

    Args:
        axes: Where to draw.
        run: The plan.
        row: Waypoint.
        beside: Lines that names keep clear of, each of shape (m, 2); [mm].
    """
    planar = SIDE(run.centres[row])
    colours = style.key_colours(run.problem.manipulator)
    for i, colour in enumerate(colours[:-1]):
        axes.plot(*planar[i : i + 2].T, color=colour, linewidth=1.8, zorder=4)
    for i, colour in enumerate(colours):
        axes.plot(*planar[i], "o", color=colour, markersize=3.0, zorder=5,
                  markeredgecolor="white", markeredgewidth=0.3)  # fmt: skip
    labels = [f"P{style.subscript(i + 1)}" for i in range(len(planar))]
    lines = [planar, SIDE(run.problem.path.corners), *beside]
    label_dots(axes, planar, labels, lines, region(run, row))


def region(run: Run, row: int) -> shapely.Geometry | None:
    """What labels keep out of: the region that joints slide around, or the danger."""
    used = sliding_region(run, row) or danger_zone(run.problem, "x")
    return None if used is None else used.shape


def draw_trails(axes: Axes, run: Run, first: int, last: int) -> list[FloatArray]:
    """Where each projected joint has come from, as lines of shape (m, 2); [mm]."""
    lines = []
    colours = style.key_colours(run.problem.manipulator)
    for i, colour in enumerate(colours):
        line = thin(SIDE(run.centres[first : last + 1, i]))
        axes.plot(*line.T, color=colour, linewidth=0.8, alpha=0.8, zorder=3)
        lines.append(line)
    return lines
