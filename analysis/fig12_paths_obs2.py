"""Fig. 12: paths of all key points in obs2, in both readings of its prism."""

from matplotlib.figure import Figure
from paper_figures.four_views import four_views
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAME = "fig12"


def draw(runs: Runs) -> dict[str, Figure]:
    """One figure per reading and strategy."""
    return {
        f"{NAME}{reading}-{run.strategy}": four_views(run, single_joints=True)
        for reading in ("", "-small")
        for run in runs.both(f"obs2{reading}")
    }


if __name__ == "__main__":
    save_all(draw(Runs()))
