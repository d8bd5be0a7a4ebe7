"""Fig. 16: the ranges of psi_i and x0, with the numbers the paper prints."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from paper_figures import style
from paper_figures.curves import MM_PER_DEG, base_axis, draw_limit, top_of
from paper_figures.paper_says import MAX_PSI_DEG, X0_MAX_MM, X0_MIN_MM
from paper_figures.runs import SCENES, STRATEGIES, Run, Runs, degrees
from paper_figures.style import save_all

from vdsm_pin.units import MM_PER_M

NAME = "fig16"
BAR = 0.38  # width of a bar; [-]
WIDTH, HEIGHT = 2.98, 1.35  # of one panel; [inch]


def draw(runs: Runs) -> dict[str, Figure]:
    """One panel per environment; bars of both strategies side by side."""
    pitch = HEIGHT + 0.48
    rows = (len(SCENES) + 1) // 2
    figure = style.sheet(rows * pitch + 0.16)
    for k, scene in enumerate(SCENES):
        left = 0.42 + (k % 2) * (WIDTH + 0.32)
        low = 0.28 + (rows - 1 - k // 2) * pitch
        axes = style.place(figure, left, low, WIDTH, HEIGHT)
        both = [runs(scene, strategy) for strategy in STRATEGIES]
        for j, run in enumerate(both):
            _bars(axes, run, (j - 0.5) * BAR)
        _printed(axes, scene, both[0].problem.manipulator.n_links)
        draw_limit(axes, float(np.rad2deg(both[0].problem.manipulator.max_link_angle)))
        axes.set_ylim(-12.0, top_of(both) + 3.0)
        axes.axhline(0.0, color=style.INK, linewidth=0.6)
        base_axis(axes, labelled=k % 2 == 1 or k == len(SCENES) - 1)
        axes.grid(visible=True, axis="y")
        axes.set_yticks([0, 10, 20, 30, 40])
        if k % 2 == 0:
            axes.set_ylabel("ψ [°]")
        style.panel_title(axes, "abcde"[k], scene)
    _legend(figure, rows * pitch + 0.16, pitch)
    return {NAME: figure}


def _bars(axes: Axes, run: Run, shift: float) -> None:
    """From the smallest to the largest value of psi_1..psi_N and of x0."""
    psi = degrees(run.psi)
    x0 = run.trajectory.x0 * MM_PER_M / MM_PER_DEG
    low = np.append(psi.min(axis=0), x0.min())
    high = np.append(psi.max(axis=0), x0.max())
    low, high = np.where(np.abs(low) < 1e-9, 0.0, low), np.where(high < 0.05, 0.0, high)
    at = np.arange(len(low))
    colour = style.STRATEGY_COLOURS[run.strategy]
    axes.bar(at + shift, high - low, 0.94 * BAR, bottom=low, color=colour, zorder=3)
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 0.4}
    for x, top in enumerate(high[:-1]):
        if top > 0.0:
            axes.text(
                x + shift, top + 0.9, f"{top:.0f}", ha="center", va="bottom", size=6.0,
                bbox=box, zorder=6,
            )  # fmt: skip
    # Numbers of x0 are wider than a bar: they run outwards from the middle.
    x, side = at[-1] + np.sign(shift) * 0.03, "right" if shift < 0.0 else "left"
    for value, up in ((high[-1], 0.9), (low[-1], -0.9)):
        axes.text(
            x, value + up, f"{value * MM_PER_DEG:.0f}".replace("-", "−"), ha=side,
            va="bottom" if up > 0.0 else "top", size=6.0, bbox=box, zorder=6,
        )  # fmt: skip
    names = [f"ψ{style.subscript(i)}" for i in range(1, len(at))]
    axes.set_xticks(at, [*names, "x₀"])
    axes.tick_params(axis="x", length=0)


def _printed(axes: Axes, scene: str, n_links: int) -> None:
    """The paper's largest psi across all joints, and its extremes of x0."""
    look = {"color": style.AUXILIARY, "linewidth": 1.0, "zorder": 5}
    key = "obs2" if scene == "obs2-small" else scene
    if key in MAX_PSI_DEG:
        axes.hlines(MAX_PSI_DEG[key], -0.5, n_links - 0.5, **look)
    for value in (X0_MIN_MM.get(key), X0_MAX_MM.get(key)):
        if value is not None:
            y = value / MM_PER_DEG
            axes.hlines(y, n_links - 0.5, n_links + 0.5, **look)


def _legend(figure: Figure, height: float, pitch: float) -> None:
    handles = [Patch(color=colour) for colour in style.STRATEGY_COLOURS.values()]
    names = [f"strategy ‘{name}’" for name in style.STRATEGY_COLOURS]
    handles.append(Line2D([], [], color=style.AUXILIARY, linewidth=1.0))
    names.append("printed in the paper: largest ψ, extremes of x₀")
    handles.append(Line2D([], [], color=style.LIMIT, linewidth=0.8, dashes=(4, 2)))
    names.append("limit of ψ")
    figure.legend(
        handles, names, loc="upper left", labelspacing=0.9,
        bbox_to_anchor=(0.56, (pitch - 0.25) / height),
    )  # fmt: skip


if __name__ == "__main__":
    save_all(draw(Runs()))
