"""Fig. 7: the projected arm with the tip at A4 and at A5, in obs1."""

from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.marks import row_of
from paper_figures.projections import HIGH, LOW, draw_background, draw_chain
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAME = "fig07"


def draw(runs: Runs) -> dict[str, Figure]:
    """A4 and A5 by both strategies: one place of the tip, two sides of the obstacle."""
    size = (HIGH - LOW) * 1.22
    figure = style.sheet(size[2] + 0.66)
    panels = [(run, name) for run in runs.both("obs1") for name in ("A₄", "A₅")]
    pitch = (style.WIDTH - 0.55) / 4.0
    for k, (run, name) in enumerate(panels):
        axes = style.place(figure, 0.50 + k * pitch, 0.38, size[1], size[2])
        row = row_of(run, name)
        draw_background(axes, run, row)
        draw_chain(axes, run, row)
        style.panel_title(axes, "abcd"[k], f"{name}, ‘{run.strategy}’")
        if k > 0:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)
    return {NAME: figure}


if __name__ == "__main__":
    save_all(draw(Runs()))
