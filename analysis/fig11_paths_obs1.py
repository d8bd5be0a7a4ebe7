"""Fig. 11: paths of all key points in obs1."""

from matplotlib.figure import Figure
from paper_figures.four_views import four_views
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAME = "fig11"


def draw(runs: Runs) -> dict[str, Figure]:
    """One figure per strategy."""
    return {
        f"{NAME}-{run.strategy}": four_views(run, single_joints=True)
        for run in runs.both("obs1")
    }


if __name__ == "__main__":
    save_all(draw(Runs()))
