"""Fig. 13: paths of all key points in obs3."""

from matplotlib.figure import Figure
from paper_figures.four_views import four_views
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAME = "fig13"


def draw(runs: Runs) -> dict[str, Figure]:
    """One figure per strategy."""
    return {
        f"{NAME}-{run.strategy}": four_views(run, single_joints=False)
        for run in runs.both("obs3")
    }


if __name__ == "__main__":
    save_all(draw(Runs()))
