"""Fig. 15: the link angles enlarged where an obstacle changes them."""

import numpy as np
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.curves import (
    angle_legend,
    draw_link_angles,
    draw_moments,
    shade_detours,
)
from paper_figures.runs import Run, Runs
from paper_figures.style import save

from vdsm_pin.tolerances import TOLERANCES

NAME = "fig15"
MARGIN = 12  # waypoints shown before and after
LONGEST = 260  # waypoints of one panel
WIDTH, HEIGHT = 1.58, 1.55  # of one panel; [inch]


def draw(runs: Runs) -> dict[str, Figure]:
    """Four places in columns, the strategies in rows."""
    first = {scene: runs.both(scene) for scene in ("obs1", "obs2", "obs3")}
    places = (("obs1", -1, "about A₅"), ("obs2", 0, "first bend"),
              ("obs2", -1, "last bend"), ("obs3", 0, "column"))  # fmt: skip
    pitch = HEIGHT + 0.60
    figure = style.sheet(2.0 * pitch + 0.28)
    for r in range(2):
        for k, (scene, stretch, what) in enumerate(places):
            run = first[scene][r]
            left = 0.40 + k * (WIDTH + 0.12)
            axes = style.place(figure, left, 0.36 + (1 - r) * pitch, WIDTH, HEIGHT)
            draw_link_angles(axes, run, window(run, stretch))
            shade_detours(axes, run)
            draw_moments(axes, run)
            letter = "abcdefgh"[4 * r + k]
            axes.set_title(f"({letter}) {scene}, {what}", pad=11.0)
            if k == 0:
                axes.set_ylabel(f"ψ [°], strategy ‘{run.strategy}’")
            else:
                axes.tick_params(labelleft=False)
            if r == 1:
                axes.set_xlabel("waypoint")
    lines, names = angle_legend(first["obs1"][0])
    figure.legend(
        lines, names, loc="upper center", bbox_to_anchor=(0.5, 0.995), ncols=10,
        columnspacing=1.1,
    )  # fmt: skip
    return {NAME: figure}


def window(run: Run, stretch: int) -> slice:
    """The waypoints about one stretch on which psi_2..psi_N change.

    Args:
        run: The plan.
        stretch: Which of them, 0 the first and -1 the last.
    """
    bent = (run.psi[:, 1:] > TOLERANCES.changed_angle).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], bent.astype(int), [0]])))
    stretches = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
    begin, end = stretches[stretch] if stretches else (0, run.trajectory.n_samples)
    if end - begin > LONGEST:
        begin, end = (begin, begin + LONGEST) if stretch == 0 else (end - LONGEST, end)
    return slice(max(begin - MARGIN, 0), min(end + MARGIN, run.trajectory.n_samples))


if __name__ == "__main__":
    for name, figure in draw(Runs()).items():
        save(figure, name)
