"""Fig. 4: paths of all key points without obstacles, in four views."""

from matplotlib.figure import Figure
from paper_figures.four_views import four_views
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAME = "fig04"


def draw(runs: Runs) -> dict[str, Figure]:
    """The figure by the paper's method; `fewest` moves the arm the same way."""
    return {NAME: four_views(runs("free", "paper"), single_joints=False)}


if __name__ == "__main__":
    save_all(draw(Runs()))
