"""Fig. 4 and 11-13: paths of all key points, without and with obstacles."""

from typing import Final

from matplotlib.figure import Figure
from paper_figures.four_views import four_views
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAMES: Final = {
    "obs1": "fig11",
    "obs2": "fig12",
    "obs2-small": "fig12-small",
    "obs3": "fig13",
}
"""Figures by scene, obs2 in both readings of its prism."""


def draw(runs: Runs) -> dict[str, Figure]:
    """One figure per scene and strategy; joints one by one round what lies along X."""
    free = {"fig04": four_views(runs("free", "paper"), single_joints=False)}
    return free | {
        f"{name}-{run.strategy}": four_views(run, single_joints=scene != "obs3")
        for scene, name in NAMES.items()
        for run in runs.both(scene)
    }


if __name__ == "__main__":
    save_all(draw(Runs()))
