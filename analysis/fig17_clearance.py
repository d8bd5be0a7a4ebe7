"""Fig. 17: distance of the arm from the obstacle, to its axis and between surfaces."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from paper_figures import style
from paper_figures.curves import draw_limit, draw_moments, shade_detours
from paper_figures.distances import AXES, axis_distance
from paper_figures.paper_says import AXIS_DISTANCE_MM
from paper_figures.runs import STRATEGIES, Run, Runs
from paper_figures.style import save_all
from paper_figures.views import thin
from result_files import at_least

from vdsm_pin.units import MM_PER_M

NAME = "fig17"
SCENES = tuple(AXES)
WIDTH, HEIGHT = 3.14, 1.10  # of one panel; [inch]
GAP = 0.36  # room for the numbers of the right panel; [inch]
TOP_AXIS = 900.0  # [mm]
SURFACE = (1.0, 1_000.0)  # ends of the logarithmic axis; [mm]
END = 0.9  # numbers farther right would touch the next panel's first; [-]
DECADE = 150.0  # makes a decade as long as 150 waypoints, for thinning


def draw(runs: Runs) -> dict[str, Figure]:
    """One figure a measure; environments in rows, strategies in columns."""
    return {
        f"{NAME}-axis": _figure(runs, _axis_panel, "to the axis [mm]"),
        f"{NAME}-surface": _figure(runs, _surface_panel, "clearance [mm]"),
    }


def _figure(runs: Runs, painter: Callable[[Axes, Run], None], quantity: str) -> Figure:
    pitch = HEIGHT + 0.56
    figure = style.sheet(len(SCENES) * pitch + 0.18)
    for k, scene in enumerate(SCENES):
        low = 0.36 + (len(SCENES) - 1 - k) * pitch
        for r, strategy in enumerate(STRATEGIES):
            left = 0.44 + r * (WIDTH + GAP)
            axes = style.place(figure, left, low, WIDTH, HEIGHT)
            painter(axes, runs(scene, strategy))
            letter = "abcdefgh"[2 * k + r]
            axes.set_title(f"({letter}) {scene}, ‘{strategy}’", pad=12.0)
            axes.grid(visible=True, axis="y")
            last = axes.get_xlim()[1]
            ticks = MaxNLocator(6).tick_values(0.0, last)
            axes.set_xticks([tick for tick in ticks if 0.0 <= tick <= END * last])
            if r == 0:
                axes.set_ylabel(quantity)
            if k == len(SCENES) - 1:
                axes.set_xlabel("waypoint")
    return figure


def _axis_panel(axes: Axes, run: Run) -> None:
    """The paper's measure: axis of the nearest link to the axis of the obstacle."""
    distance = axis_distance(run) * MM_PER_M
    rows = np.arange(len(distance))
    line = thin(np.column_stack([rows, distance]))
    axes.plot(*line.T, color=style.STRATEGY_COLOURS[run.strategy], zorder=3)
    axes.set_xlim(0, rows[-1])
    axes.set_ylim(0.0, TOP_AXIS)
    draw_limit(axes, AXIS_DISTANCE_MM)
    k = int(np.argmin(distance))
    axes.plot(rows[k], distance[k], "o", color=style.INK, markersize=2.6, zorder=6)
    _note(axes, f"least {at_least(distance[k], 1)}")
    shade_detours(axes, run)
    draw_moments(axes, run, size=6.0)


def _surface_panel(axes: Axes, run: Run) -> None:
    """Proved brackets of the clearance over each interval, and the sharpened least."""
    profile = run.verification.profile
    first = profile.first_interval
    lower = profile.obstacle_lower.min(axis=1) * MM_PER_M
    upper = profile.obstacle_upper.min(axis=1) * MM_PER_M
    colour = style.STRATEGY_COLOURS[run.strategy]
    for values, look in ((upper, {"alpha": 0.4, "linewidth": 0.7}), (lower, {})):
        shown = np.maximum(values, SURFACE[0])
        line = thin(np.column_stack([first, DECADE * np.log10(shown)]))
        axes.plot(line[:, 0], 10.0 ** (line[:, 1] / DECADE), color=colour, **look)
    axes.set_yscale("log")
    axes.set_yticks([1, 10, 100], ["1", "10", "100"])
    axes.set_xlim(0, run.trajectory.n_samples - 1)
    axes.set_ylim(*SURFACE)
    draw_limit(axes, run.problem.required_clearance * MM_PER_M)
    near = next(one for one in run.verification.approaches if one.pair.obstacle)
    least = near.lower * MM_PER_M
    axes.plot(near.interval, least, "o", color=style.INK, markersize=2.6, zorder=6)
    _note(axes, f"at least {at_least(least, 1)}")
    shade_detours(axes, run)
    draw_moments(axes, run, size=6.0)


def _note(axes: Axes, text: str) -> None:
    """A number in the lower right corner, which no curve comes to."""
    axes.text(
        0.97, 0.05, text, transform=axes.transAxes, ha="right", va="bottom", size=6.3,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8},
        zorder=7,
    )  # fmt: skip


if __name__ == "__main__":
    save_all(draw(Runs()))
