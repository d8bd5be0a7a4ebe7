"""The strip of stills in the README: the arm going round the pillar of obs1.

python analysis/readme_strip.py --out reports
"""

import argparse
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.runs import Run, Runs
from paper_figures.scenery import draw_arm, draw_obstacles
from paper_figures.views import View, oblique, thin

from vdsm_pin.geometry.arrays import FloatArray, IntArray

NAME: Final = "readme"
STILLS: Final = 5
WIDTH, HEIGHT = 12.0, 2.05  # of the strip; [inch]
CAMERA: Final = oblique(50.0, 20.0)
CORNERS: Final = np.array([[0.0, -0.55, -0.30], [3.20, 1.10, 1.40]])
"""What every still shows: low and high corner, shape (2, 3); [m]."""


def moments(run: Run) -> IntArray:
    """Rows spread evenly over the way of the whole arm where it is bent, (STILLS,)."""
    swept = np.linalg.norm(np.diff(run.centres, axis=0), axis=2).sum(axis=1)
    bent = np.flatnonzero(run.psi[:, 1:].max(axis=1) > np.deg2rad(5.0))
    first, last = int(bent[0]), int(bent[-1])
    way = np.concatenate([[0.0], np.cumsum(swept[first:last])])
    wanted = np.linspace(0.0, way[-1], STILLS + 2)[1:-1]
    return first + np.searchsorted(way, wanted)


def draw(runs: Runs) -> dict[str, Figure]:
    """Five moments of the plan by the strategy `fewest`."""
    run = runs("obs1", "fewest")
    figure = style.sheet(HEIGHT, WIDTH)
    corners = CAMERA(np.array(np.meshgrid(*CORNERS.T)).reshape(3, -1).T)
    rows = moments(run)
    for k, row in enumerate(rows):
        each = WIDTH / len(rows)
        axes = style.place(figure, k * each + 0.03, 0.05, each - 0.06, HEIGHT - 0.32)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.set_xlim(corners[:, 0].min(), corners[:, 0].max())
        axes.set_ylim(corners[:, 1].min(), corners[:, 1].max() - 420.0)
        _still(axes, CAMERA, run, int(row))
        share = row / (run.trajectory.n_samples - 1)
        angles = int((run.psi[row, 1:] > np.deg2rad(0.05)).sum())
        knees = "1 knee" if angles == 1 else f"{angles} knees"
        axes.set_title(f"{100 * share:.0f} % of the motion, {knees}", weight="normal",
                       loc="center", size=8.5)  # fmt: skip
    return {NAME: figure}


def _still(axes: Axes, view: View, run: Run, row: int) -> None:
    """The arm at one row, where its tip has been, and the floor shadow for depth."""
    problem = run.problem
    wanted = view(problem.path.corners)
    axes.plot(*wanted.T, color=style.FAINT, linewidth=1.2, zorder=1)
    been = thin(view(run.centres[: row + 1, -1]))
    axes.plot(*been.T, color=style.STRATEGY_COLOURS["fewest"], linewidth=1.8, zorder=2)
    _shadow(axes, view, run.centres[row])
    draw_obstacles(axes, view, problem)
    draw_arm(axes, view, problem, run.centres[row], behind=2.5)
    tip = view(run.centres[row, -1])
    axes.plot(*tip, "o", color=style.TIP, markersize=3.0, zorder=7)


def _shadow(axes: Axes, view: View, centres: FloatArray) -> None:
    """The arm seen from above, on the floor of the room."""
    floor = centres.copy()
    floor[:, 2] = CORNERS[0, 2]
    line = view(floor)
    axes.plot(*line.T, color=style.INK, alpha=0.12, linewidth=4.0, zorder=0.5)


def main() -> None:
    """Write readme.png and readme.svg."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=style.REPORTS.parent)
    folder = parser.parse_args().out
    for name, figure in draw(Runs()).items():
        style.save(figure, name, folder)


if __name__ == "__main__":
    main()
