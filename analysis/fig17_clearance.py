"""Fig. 17: distance of the arm from the obstacle, to its axis and between surfaces."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.curves import draw_limit, draw_moments, shade_detours
from paper_figures.distances import AXES, axis_distance
from paper_figures.paper_says import AXIS_DISTANCE_MM
from paper_figures.runs import STRATEGIES, Run, Runs
from paper_figures.style import save
from paper_figures.views import thin

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.units import MM_PER_M

NAME = "fig17"
SCENES = tuple(AXES)
WIDTH, HEIGHT = 1.60, 1.30  # of one panel; [inch]
TOP_AXIS, TOP_SURFACE = 900.0, 700.0  # [mm]


def draw(runs: Runs) -> dict[str, Figure]:
    """Environments in columns; to the axis above, between surfaces below."""
    pitch = HEIGHT + 0.56
    figure = style.sheet(4.0 * pitch - 0.05)
    for k, scene in enumerate(SCENES):
        left = 0.44 + k * (WIDTH + 0.10)
        for r, strategy in enumerate(STRATEGIES):
            run = runs(scene, strategy)
            above = style.place(figure, left, 0.36 + (3 - 2 * r) * pitch, WIDTH, HEIGHT)
            below = style.place(figure, left, 0.36 + (2 - 2 * r) * pitch, WIDTH, HEIGHT)
            letters = "abcdefghijklmnop"[8 * r + k], "abcdefghijklmnop"[8 * r + 4 + k]
            _axis_panel(above, run)
            _surface_panel(below, run)
            for axes, letter in zip((above, below), letters, strict=True):
                axes.set_title(f"({letter}) {scene}, ‘{strategy}’", pad=11.0)
                axes.grid(visible=True, axis="y")
                if k > 0:
                    axes.tick_params(labelleft=False)
            if k == 0:
                above.set_ylabel("to the axis [mm]")
                below.set_ylabel("clearance [mm]")
            if r == 1:
                below.set_xlabel("waypoint")
    return {NAME: figure}


def _axis_panel(axes: Axes, run: Run) -> None:
    """The paper's measure: axis of the nearest link to the axis of the obstacle."""
    distance = axis_distance(run) * MM_PER_M
    rows = np.arange(len(distance))
    line = thin(np.column_stack([rows, distance]))
    axes.plot(*line.T, color=style.STRATEGY_COLOURS[run.strategy], zorder=3)
    axes.set_xlim(0, rows[-1])
    axes.set_ylim(0.0, TOP_AXIS)
    draw_limit(axes, AXIS_DISTANCE_MM)
    _least(axes, rows, distance)
    shade_detours(axes, run)
    draw_moments(axes, run, size=5.2)


def _surface_panel(axes: Axes, run: Run) -> None:
    """Proved brackets of the clearance between surfaces, over each interval."""
    profile = run.verification.profile
    first = profile.first_interval
    lower = profile.obstacle_lower.min(axis=1) * MM_PER_M
    upper = profile.obstacle_upper.min(axis=1) * MM_PER_M
    colour = style.STRATEGY_COLOURS[run.strategy]
    axes.fill_between(
        first, lower, np.maximum(upper, lower), color=colour, alpha=0.3, linewidth=0,
        zorder=2, step="post",
    )  # fmt: skip
    line = thin(np.column_stack([first, lower]))
    axes.plot(*line.T, color=colour, zorder=3)
    axes.set_xlim(0, run.trajectory.n_samples - 1)
    axes.set_ylim(0.0, TOP_SURFACE)
    draw_limit(axes, run.problem.required_clearance * MM_PER_M)
    _least(axes, first, lower)
    shade_detours(axes, run)
    draw_moments(axes, run, size=5.2)


def _least(axes: Axes, rows: FloatArray, values: FloatArray) -> None:
    """The smallest value with its number."""
    k = int(np.argmin(values))
    axes.plot(rows[k], values[k], "o", color=style.INK, markersize=2.6, zorder=6)
    axes.text(
        0.97, 0.93, f"least {values[k]:.1f}", transform=axes.transAxes, ha="right",
        va="top", size=6.3, zorder=7,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8},
    )  # fmt: skip


if __name__ == "__main__":
    for name, figure in draw(Runs()).items():
        save(figure, name)
