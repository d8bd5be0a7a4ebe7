"""Fig. 8: Step 5 joint by joint, with the tip at A5 in obs1."""

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.labels import label_dots
from paper_figures.marks import row_of
from paper_figures.projections import HIGH, LOW, draw_background, region
from paper_figures.runs import Run, Runs
from paper_figures.steps import Slide, slides, sliding_region
from paper_figures.style import save_all
from paper_figures.views import SIDE

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.units import MM_PER_M

NAME = "fig08"
PANELS = 6
FAR = 1_500.0  # half the length of a drawn auxiliary line; [mm]


def draw(runs: Runs) -> dict[str, Figure]:
    """Six panels, from joint 8 down to the first joint that is left in proportion."""
    run = runs("obs1", "paper")
    row = row_of(run, "A₅")
    size = (HIGH - LOW) * 1.52
    pitch_x, pitch_y = (style.WIDTH - 0.42) / 3.0, size[2] + 0.34
    figure = style.sheet(2.0 * pitch_y + 0.38)
    found = slides(run, row)
    for k, slide in enumerate(found[:PANELS]):
        left, low = 0.50 + (k % 3) * pitch_x, 0.38 + (1 - k // 3) * pitch_y
        axes = style.place(figure, left, low, size[1], size[2])
        draw_background(axes, run, row)
        _draw_slide(axes, run, row, slide)
        title = "slides onto the boundary" if slide.moved else "stays in proportion"
        style.panel_title(axes, "abcdef"[k], f"P{style.subscript(slide.joint)} {title}")
        if k % 3:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
        if k < 3:
            axes.set_xlabel("")
            axes.tick_params(labelbottom=False)
    return {NAME: figure}


def _draw_slide(axes: Axes, run: Run, row: int, slide: Slide) -> None:
    """The chain so far, P'_i on the ray to P_{i+1}, the cross through it, and P_i."""
    planar = SIDE(run.centres[row])
    colours = style.key_colours(run.problem.manipulator)
    i = slide.joint
    ahead = planar[i]
    ray = np.stack([planar[0], ahead])
    axes.plot(*ray.T, color=style.INK, linewidth=0.7, dashes=(4, 2), zorder=3)
    for j in range(i - 1, len(planar) - 1):
        axes.plot(*planar[j : j + 2].T, color=colours[j], linewidth=1.8, zorder=4)
    shown = [0, *range(i - 1, len(planar))]
    for j in shown:
        axes.plot(*planar[j], "o", color=colours[j], markersize=3.4, zorder=5,
                  markeredgecolor="white", markeredgewidth=0.3)  # fmt: skip
    lines = [planar[i - 1 :], ray, SIDE(run.problem.path.corners)]
    former = SIDE(run.centres[max(row - 1, 0)])[i - 1]
    axes.plot(*former, "s", color="none", markersize=6.0, zorder=5.5,
              markeredgecolor=style.AUXILIARY, markeredgewidth=0.8)  # fmt: skip
    dots = [planar[j] for j in shown]
    names = [f"P{style.subscript(j + 1)}" for j in shown]
    if slide.moved:
        at = slide.proportional * MM_PER_M
        lines += _draw_cross(axes, run, row, at)
        axes.plot(*at, "x", color=style.INK, markersize=4.0, zorder=6)
        dots.append(at)
        names.append(f"P′{style.subscript(i)}")
    label_dots(axes, np.array(dots), names, lines, region(run, row), size=6.5)


def _draw_cross(axes: Axes, run: Run, row: int, at: FloatArray) -> list[FloatArray]:
    """The horizontal and the vertical auxiliary line and where they meet the boundary.

    Returns:
        The two lines, each of shape (2, 2); [mm].
    """
    used = sliding_region(run, row)
    lines = []
    for direction in np.eye(2):
        line = np.stack([at - FAR * direction, at + FAR * direction])
        lines.append(line)
        axes.plot(*line.T, color=style.AUXILIARY, linewidth=0.6, zorder=2.5)
        if used is not None:
            edge = used.shape.boundary
            hits = shapely.get_coordinates(edge.intersection(shapely.linestrings(line)))
            axes.plot(
                *hits.T, "o", color="white", markersize=3.4, zorder=3.5,
                markeredgecolor=style.AUXILIARY, markeredgewidth=0.8,
            )  # fmt: skip
    return lines


if __name__ == "__main__":
    save_all(draw(Runs()))
