"""Fig. 14: psi_i and x0 over the motion, in every environment."""

from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.curves import (
    angle_legend,
    base_axis,
    draw_link_angles,
    draw_moments,
    shade_detours,
    top_of,
)
from paper_figures.runs import SCENES, STRATEGIES, Runs
from paper_figures.style import save_all

NAME = "fig14"
WIDTH, HEIGHT = 2.98, 1.22  # of one panel; [inch]


def draw(runs: Runs) -> dict[str, Figure]:
    """Environments in rows, strategies in columns."""
    pitch = HEIGHT + 0.50
    figure = style.sheet(len(SCENES) * pitch + 0.50)
    for r, scene in enumerate(SCENES):
        top = top_of(runs(scene, strategy) for strategy in STRATEGIES)
        for k, strategy in enumerate(STRATEGIES):
            run = runs(scene, strategy)
            left = 0.42 + k * (WIDTH + 0.32)
            low = 0.36 + (len(SCENES) - 1 - r) * pitch
            axes = style.place(figure, left, low, WIDTH, HEIGHT)
            draw_link_angles(axes, run)
            shade_detours(axes, run)
            draw_moments(axes, run)
            axes.set_ylim(top=top)
            base_axis(axes, labelled=k == 1)
            letter = "abcdefghij"[2 * r + k]
            axes.set_title(f"({letter}) {scene}, ‘{strategy}’", pad=11.0)
            if k == 0:
                axes.set_ylabel("ψ [°]")
            else:
                axes.tick_params(labelleft=False)
            if r == len(SCENES) - 1:
                axes.set_xlabel("waypoint")
    lines, names = angle_legend(runs(SCENES[0], STRATEGIES[0]))
    figure.legend(
        lines, names, loc="upper center", bbox_to_anchor=(0.5, 0.995), ncols=10,
        columnspacing=1.1,
    )  # fmt: skip
    return {NAME: figure}


if __name__ == "__main__":
    save_all(draw(Runs()))
