"""The moving picture in the README: the arm drawing its path round the pillar of obs1.

python analysis/readme_animation.py --out reports
"""

import argparse
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from paper_figures import style
from paper_figures.runs import Run, Runs
from paper_figures.scenery import draw_arm, draw_obstacles
from paper_figures.views import View, oblique, thin
from PIL import Image

from vdsm_pin.geometry.arrays import FloatArray, IntArray

NAME: Final = "readme"
FRAMES: Final = 84
SECONDS: Final = 9.0
WIDTH, HEIGHT, DPI = 6.4, 3.5, 100  # of a frame; [inch], [inch], [1/inch]
COLOURS: Final = 64  # keeps the file below a megabyte
NEARLY_WHITE: Final = 248  # of 255
CAMERA: Final = oblique(50.0, 20.0)
CORNERS: Final = np.array([[0.0, -0.55, -0.30], [3.20, 1.10, 1.25]])
"""What every frame shows: low and high corner, shape (2, 3); [m]."""
MARGIN: Final = 60.0  # about that, as drawn; [mm]


def moments(run: Run, count: int) -> IntArray:
    """Rows spread evenly over the way of the whole arm, shape (count,)."""
    swept = np.linalg.norm(np.diff(run.centres, axis=0), axis=2).sum(axis=1)
    way = np.concatenate([[0.0], np.cumsum(swept)])
    return np.searchsorted(way, np.linspace(0.0, way[-1], count))


def frame(run: Run, row: int) -> Image.Image:
    """One picture of the motion."""
    figure = style.sheet(HEIGHT, WIDTH)
    axes = style.place(figure, 0.0, 0.0, WIDTH, HEIGHT)
    corners = CAMERA(np.array(np.meshgrid(*CORNERS.T)).reshape(3, -1).T)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_xlim(corners[:, 0].min() - MARGIN, corners[:, 0].max() + MARGIN)
    axes.set_ylim(corners[:, 1].min() - MARGIN, corners[:, 1].max() - 2.0 * MARGIN)
    draw_still(axes, CAMERA, run, row)
    canvas = FigureCanvasAgg(figure)
    figure.set_dpi(DPI)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def draw_still(axes: Axes, view: View, run: Run, row: int) -> None:
    """The arm at one row, where its tip has been, and a shadow on the floor."""
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


def _palette(picture: Image.Image) -> Image.Image:
    """Its most common colours; the background stays white."""
    few = picture.quantize(COLOURS, dither=Image.Dither.NONE)
    colours = np.array(few.getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) >= NEARLY_WHITE] = 255
    few.putpalette(colours.ravel().tolist())
    return few


def write(run: Run, path: Path, count: int = FRAMES) -> None:
    """Write the motion as an animated GIF that plays for ever."""
    pictures = [frame(run, int(row)) for row in moments(run, count)]
    # One palette for all, or the background would flicker.
    palette = _palette(pictures[count // 2])
    first, *others = (
        picture.quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    duration = round(1000.0 * SECONDS / count)
    first.save(
        path, save_all=True, append_images=others, duration=duration, loop=0,
        optimize=True,
    )  # fmt: skip


def main() -> None:
    """Write readme.gif."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=style.REPORTS.parent)
    folder = parser.parse_args().out
    write(Runs()("obs1", "fewest"), folder / f"{NAME}.gif")


if __name__ == "__main__":
    main()
