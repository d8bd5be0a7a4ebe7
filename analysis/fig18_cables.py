"""Fig. 18: lengths of the 24 driving cables inside the first joint, in obs1."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.curves import draw_moments, shade_detours
from paper_figures.runs import Run, Runs
from paper_figures.style import save_all
from paper_figures.views import thin

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.palette import oklch
from vdsm_pin.units import MM_PER_M

NAME = "fig18"
WIDTH, HEIGHT = 5.35, 1.65  # of one panel; [inch]


def spans(run: Run) -> FloatArray:
    """Length of every cable inside joint 1, shape (n_samples, N, 3); [m] (Eq. 20).

    With all other joints straight, what a cable runs outside joint 1 is known (Eq. 21).
    """
    arm, rows = run.problem.manipulator, run.trajectory
    first = np.zeros(arm.n_links)
    first[0] = 1.0
    whole = cable_lengths(arm, rows.alpha * first, rows.theta * first)
    gap = 2.0 * arm.cables.half_gap
    elsewhere = arm.stations[1:] - gap
    return np.asarray(whole - elsewhere[:, None])


def hole_colour(angle: float) -> str:
    """A colour of the circle for the angle phi of a hole."""
    return oklch(0.66, 0.14, float(np.rad2deg(angle)))


def draw(runs: Runs) -> dict[str, Figure]:
    """One panel per strategy, and the holes in their colours."""
    both = runs.both("obs1")
    pitch = HEIGHT + 0.52
    figure = style.sheet(len(both) * pitch + 0.26)
    for k, run in enumerate(both):
        low = 0.36 + (len(both) - 1 - k) * pitch
        axes = style.place(figure, 0.46, low, WIDTH, HEIGHT)
        _curves(axes, run)
        axes.set_title(f"({'ab'[k]}) obs1, ‘{run.strategy}’", pad=11.0)
        axes.set_ylabel("length in joint 1 [mm]")
        if k == len(both) - 1:
            axes.set_xlabel("waypoint")
    high = 0.36 + (len(both) - 1) * pitch
    _holes(style.place(figure, 5.95, high + 0.25, 1.15, 1.15), both[0])
    return {NAME: figure}


def _curves(axes: Axes, run: Run) -> None:
    lengths = spans(run) * MM_PER_M
    holes = run.problem.manipulator.cables.hole_angles
    rows = np.arange(len(lengths))
    for i in range(lengths.shape[1]):
        for j in range(3):
            line = thin(np.column_stack([rows, 12.0 * lengths[:, i, j]]))
            axes.plot(line[:, 0], line[:, 1] / 12.0, linewidth=0.8,
                      color=hole_colour(holes[i, j]))  # fmt: skip
    axes.set_xlim(0, rows[-1])
    axes.grid(visible=True, axis="y")
    shade_detours(axes, run)
    draw_moments(axes, run)


def _holes(axes: Axes, run: Run) -> None:
    """Where the holes lie, seen along the link: phi from z towards y (Fig. 10)."""
    arm = run.problem.manipulator
    radius = arm.cables.hole_radius * MM_PER_M
    body = arm.link_radius * MM_PER_M
    axes.add_patch(mpl.patches.Circle((0, 0), body, fill=False, edgecolor=style.FAINT))
    for i, row in enumerate(arm.cables.hole_angles):
        for phi in row:
            at = np.array([np.sin(phi), np.cos(phi)])
            axes.plot(*radius * at, "o", color=hole_colour(phi), markersize=4.2)
            axes.text(
                *0.77 * radius * at, str(i + 1), ha="center", va="center", size=6.0
            )
    axes.set(xlim=(-1.1 * body, 1.1 * body), ylim=(-1.1 * body, 1.1 * body))
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title("holes by link", loc="center", weight="normal")


if __name__ == "__main__":
    save_all(draw(Runs()))
