"""Fig. 6: the tip's path in the projection, with obstacle and danger region."""

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.marks import marks
from paper_figures.runs import STRATEGIES, Run, Runs
from paper_figures.scenery import draw_section, square, zone
from paper_figures.style import save_all
from paper_figures.views import SIDE, thin

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.units import MM_PER_M

NAME = "fig06"
LOW, HIGH = np.array([0.0, -0.72, -0.38]), np.array([0.0, 1.44, 1.50])
NEAR_CORNER = 0.75  # from here to 1 the label of a corner is close; [-]
NEAR = 45.0  # labels of moments this near to each other are put side by side; [mm]


def draw(runs: Runs) -> dict[str, Figure]:
    """obs1 and the two readings of obs2 in columns, the strategies in rows."""
    size = (HIGH - LOW) * 0.97
    pitch = size[2] + 0.62
    figure = style.sheet(2.0 * pitch)
    for row, strategy in enumerate(STRATEGIES):
        for column, scene in enumerate(("obs1", "obs2-small", "obs2")):
            left = 0.52 + column * (size[1] + 0.19)
            axes = style.place(figure, left, 0.38 + (1 - row) * pitch, *size[1:])
            draw_panel(axes, runs(scene, strategy))
            if column > 0:
                axes.set_ylabel("")
                axes.tick_params(labelleft=False)
            letter = "abcdef"[3 * row + column]
            style.panel_title(axes, letter, f"{scene}, ‘{strategy}’")
    return {NAME: figure}


def draw_panel(axes: Axes, run: Run) -> None:
    """One tip path."""
    draw_section(axes, run.problem, "x")
    _equidistant_line(axes, run)
    rows = run.trajectory
    corners = SIDE(run.problem.path.corners)
    axes.plot(*corners.T, color=style.FAINT, linewidth=2.6, alpha=0.5, zorder=1.8)
    edges = np.flatnonzero(np.diff(rows.on_path)) + 1
    tip = SIDE(run.centres[:, -1])
    for part in np.split(np.arange(rows.n_samples), edges):
        drawn = bool(rows.on_path[part[0]])
        shown = np.arange(max(part[0] - 1, 0), min(part[-1] + 2, rows.n_samples))
        line = thin(tip[part if drawn else shown])
        colour = style.TIP if drawn else style.STRATEGY_COLOURS["fewest"]
        # Off the path it is wide and pale, so that both show where it runs along it.
        look = {"linewidth": 1.2} if drawn else {"linewidth": 3.0, "alpha": 0.55}
        axes.plot(*line.T, color=colour, zorder=3 if drawn else 2.6, **look)
    _arrows(axes, run, tip)
    square(axes, SIDE, LOW, HIGH)
    _labels(axes, run, tip)


def _equidistant_line(axes: Axes, run: Run) -> None:
    """The line from the start through the obstacle's centre (paper, 4.2.2)."""
    start, section = run.problem.path.start[1:], zone(run.problem, "x", 0.0)
    if section is None:
        return
    ray = section.centre - start
    ends = np.stack([start, start + ray * (1.0 / np.abs(ray).max())]) * MM_PER_M
    axes.plot(*ends.T, color=style.AUXILIARY, linewidth=0.7, zorder=2)
    if (run.scene, run.strategy) != ("obs1", "paper"):
        return
    corners = shapely.LineString(run.problem.path.corners[:, 1:] * MM_PER_M)
    behind = shapely.LineString([section.centre * MM_PER_M, 1.1 * ends[1]])
    for at in shapely.get_coordinates(corners.intersection(behind)):
        axes.plot(*at, "o", color="white", markersize=3.4, zorder=5,
                  markeredgecolor=style.AUXILIARY, markeredgewidth=0.8)  # fmt: skip
        axes.annotate("A₄′", at, (4.0, 5.0), textcoords="offset points", size=6.8,
                      color=style.AUXILIARY)  # fmt: skip


def _arrows(axes: Axes, run: Run, tip: FloatArray) -> None:
    """The sense of the motion, off the path."""
    for part in np.split(
        np.arange(len(tip)), np.flatnonzero(np.diff(run.trajectory.on_path)) + 1
    ):
        if run.trajectory.on_path[part[0]] or len(part) < 30:
            continue
        for share in (0.25, 0.75):
            k = part[int(share * len(part))]
            axes.annotate(
                "", tip[k + 4], tip[k - 4],
                arrowprops={"arrowstyle": "-|>", "lw": 0, "mutation_scale": 9,
                            "color": style.STRATEGY_COLOURS["fewest"]},
            )  # fmt: skip


def _labels(axes: Axes, run: Run, tip: FloatArray) -> None:
    """Moments as red dots; those at one place share a label."""
    places: list[tuple[FloatArray, list[str]]] = []
    for mark in marks(run):
        at = tip[mark.row]
        near = [names for place, names in places if np.hypot(*(place - at)) < NEAR]
        if near:
            near[0].append(mark.name)
        else:
            places.append((at, [mark.name]))
    middle = SIDE(run.problem.path.points).mean(axis=0)
    for at, names in places:
        axes.plot(*at, "o", color=style.AUXILIARY, markersize=3.2, zorder=6)
        outward = at - middle
        # Corners are labelled diagonally, points of a side squarely off it.
        share = outward / np.abs(SIDE(run.problem.path.points) - middle).max(axis=0)
        sign = np.where(np.abs(share) > 0.97, np.sign(share), 0.0)
        if not sign.any():
            sign = np.array([-1.0, 1.0])
        axes.annotate(
            ", ".join(names), at, sign * np.where(sign.all(), 3.0, 4.5),
            textcoords="offset points", size=6.8, zorder=7,
            ha=_alignment(float(sign[0]), float(share[0])),
            va={-1.0: "top", 0.0: "center", 1.0: "bottom"}[float(sign[1])],
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.4},
        )  # fmt: skip


def _alignment(sign: float, share: float) -> str:
    """Side of a label that its point is on; beside a corner it gives way to it."""
    if sign == 0.0 and abs(share) > NEAR_CORNER:
        return "right" if share > 0.0 else "left"
    return {-1.0: "right", 0.0: "center", 1.0: "left"}[sign]


if __name__ == "__main__":
    save_all(draw(Runs()))
