"""Fig. 15: the link angles enlarged where an obstacle changes them."""

from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.curves import (
    MM_PER_DEG,
    angle_legend,
    draw_link_angles,
    draw_moments,
    shade_detours,
    top_of,
)
from paper_figures.runs import Run, Runs
from paper_figures.style import save_all
from paper_table import stretches

NAME = "fig15"
MARGIN = 12  # waypoints shown before and after
WIDTH, HEIGHT = 3.12, 1.30  # of one panel; [inch]
PLACES = (("obs1", -1, "about A₅"), ("obs2", 0, "from B₁"),
          ("obs2", -1, "the way back"), ("obs3", 0, "about the column"))  # fmt: skip
"""Scene, stretch and name of the places the paper enlarges, in its order."""


def draw(runs: Runs) -> dict[str, Figure]:
    """The four places in rows, the strategies in columns."""
    first = {scene: runs.both(scene) for scene in ("obs1", "obs2", "obs3")}
    pitch = HEIGHT + 0.52
    figure = style.sheet(len(PLACES) * pitch + 0.50)
    for k, (scene, stretch, what) in enumerate(PLACES):
        for r in range(2):
            run = first[scene][r]
            left, low = 0.45 + r * (WIDTH + 0.30), 0.38 + (len(PLACES) - 1 - k) * pitch
            axes = style.place(figure, left, low, WIDTH, HEIGHT)
            draw_link_angles(axes, run, window(run, stretch))
            shade_detours(axes, run)
            draw_moments(axes, run)
            axes.set_ylim(top=top_of(first[scene]))
            title = f"({'abcdefgh'[2 * k + r]}) {scene}, {what}, ‘{run.strategy}’"
            axes.set_title(title, pad=11.0)
            if r == 0:
                axes.set_ylabel("ψ [°]")
            if k == len(PLACES) - 1:
                axes.set_xlabel("waypoint")
    lines, names = angle_legend(first["obs1"][0])
    names[names.index("x₀")] = f"x₀, {MM_PER_DEG:.0f} mm to 1°"
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
    found, n = stretches(run.psi), run.trajectory.n_samples
    rows = found[stretch] if found else slice(0, n)
    return slice(max(rows.start - MARGIN, 0), min(rows.stop + MARGIN, n))


if __name__ == "__main__":
    save_all(draw(Runs()))
