"""Fig. 9: the projected arm while the tip moves from A5 to A6, in obs1."""

from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.marks import row_of
from paper_figures.projections import (
    HIGH,
    LOW,
    draw_background,
    draw_chain,
    draw_trails,
)
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAME = "fig09"
SHARES = (1.0 / 3.0, 2.0 / 3.0, 1.0)  # of the rows from A5 to A6
NAMES = ("A₅₋₁", "A₅₋₂", "A₆")


def draw(runs: Runs) -> dict[str, Figure]:
    """A third and two thirds of the way, and A6, by both strategies."""
    size = (HIGH - LOW) * 1.52
    pitch = size[2] + 0.30
    both = runs.both("obs1")
    figure = style.sheet(len(both) * pitch + 0.38)
    for r, run in enumerate(both):
        first, last = row_of(run, "A₅"), row_of(run, "A₆")
        for k, (share, name) in enumerate(zip(SHARES, NAMES, strict=True)):
            row = round(first + share * (last - first))
            low = 0.38 + (len(both) - 1 - r) * pitch
            left = 0.50 + k * (style.WIDTH - 0.42) / 3.0
            axes = style.place(figure, left, low, size[1], size[2])
            draw_background(axes, run, row)
            draw_chain(axes, run, row, draw_trails(axes, run, first, row))
            style.panel_title(axes, "abcdef"[3 * r + k], f"{name}, ‘{run.strategy}’")
            if k > 0:
                axes.set_ylabel("")
                axes.tick_params(labelleft=False)
            if r + 1 < len(both):
                axes.set_xlabel("")
                axes.tick_params(labelbottom=False)
    return {NAME: figure}


if __name__ == "__main__":
    save_all(draw(Runs()))
