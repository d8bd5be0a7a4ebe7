"""Fig. 1: the arm and its frames, the 16 traditional ones and the 8 of Table 1."""

from itertools import pairwise
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle
from paper_figures import style
from paper_figures.runs import Runs
from paper_figures.style import save_all

from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.palette import AXES
from vdsm_pin.units import MM_PER_M

NAME: Final = "fig01"
ARROW: Final = 105.0
"""Length of a drawn axis; [mm]."""


def draw(runs: Runs) -> dict[str, Figure]:
    """Three rows: traditional frames, those of Table 1, the arm with its lengths."""
    del runs  # nothing is planned
    arm = built_in("hrm8")
    figure = style.sheet(4.15)
    for row, (title, painter) in enumerate(
        (
            ("16 traditional frames: x along the link, z the axis of the turn", _old),
            ("8 frames of Table 1: x along the link, yaw α about z, pitch θ about y",
             _new),
            ("the arm on its rail; lengths in mm", _arm),
        )
    ):  # fmt: skip
        axes = style.place(figure, 0.12, 2.85 - 1.34 * row, style.WIDTH - 0.24, 1.05)
        axes.set_xlim(-560.0, arm.total_length * MM_PER_M + 230.0)
        axes.set_ylim(-270.0, 250.0)
        axes.set_axis_off()
        axes.set_aspect("equal", adjustable="box", anchor="W")
        painter(axes, arm)
        style.panel_title(axes, "abc"[row], title)
    return {NAME: figure}


def _stations(arm: Manipulator) -> FloatArray:
    return np.asarray(arm.stations * MM_PER_M)


def _line(axes: Axes, arm: Manipulator) -> None:
    at = _stations(arm)
    axes.plot([-500.0, at[-1]], [0.0, 0.0], color=style.FAINT, linewidth=0.8, zorder=1)
    colours = style.key_colours(arm)
    for x, colour in zip(at, colours, strict=True):
        axes.plot(x, 0.0, "o", color=colour, markersize=4.5, zorder=4)


def _axis(axes: Axes, x: float, name: str, way: tuple[float, float], word: str) -> None:
    """An axis of a frame; way (0, 0) is towards the reader."""
    if way == (0.0, 0.0):
        axes.plot(x, 0.0, "o", markersize=7.5, markerfacecolor="none", zorder=5,
                  markeredgecolor=AXES[name], markeredgewidth=1.0)  # fmt: skip
        axes.annotate(word, (x, 0.0), (x - 22.0, -78.0), color=AXES[name], size=6.2,
                      ha="center", va="center")  # fmt: skip
        return
    end = x + ARROW * way[0], ARROW * way[1]
    axes.annotate("", end, (x, 0.0), arrowprops={
        "arrowstyle": "-|>", "color": AXES[name], "linewidth": 1.0,
        "shrinkA": 0, "shrinkB": 0, "mutation_scale": 6,
    })  # fmt: skip
    axes.text(end[0] + 26.0 * way[0], end[1] + 40.0 * way[1], word, color=AXES[name],
              size=6.2, ha="center", va="center")  # fmt: skip


def _old(axes: Axes, arm: Manipulator) -> None:
    """The yaw frame above, the pitch frame below: z is the axis that turns."""
    _line(axes, arm)
    for i, x in enumerate(_stations(arm)[:-1], start=1):
        first, second = 2 * i - 2, 2 * i - 1
        _axis(axes, float(x), "z", (0.0, 1.0), f"z{style.subscript(first)}")
        _axis(axes, float(x), "z", (0.0, 0.0), f"z{style.subscript(second)}")
        _axis(axes, float(x), "x", (1.0, 0.0), "")
        axes.text(x, 205.0, f"α{style.subscript(i)}", size=6.5, ha="center")
        axes.text(x, -165.0, f"θ{style.subscript(i)}", size=6.5, ha="center")
    axes.text(-500.0, 25.0, "rail, x₀", size=6.5)


def _new(axes: Axes, arm: Manipulator) -> None:
    _line(axes, arm)
    for i, x in enumerate(_stations(arm), start=1):
        _axis(axes, float(x), "z", (0.0, 1.0), f"z{style.subscript(i)}")
        _axis(axes, float(x), "y", (0.0, 0.0), f"y{style.subscript(i)}")
        _axis(axes, float(x), "x", (1.0, 0.0), "")
        axes.text(x, -165.0, f"O{style.subscript(i)}", size=6.5, ha="center")
    axes.text(-500.0, 25.0, "rail, x₀", size=6.5)


def _arm(axes: Axes, arm: Manipulator) -> None:
    """Bodies, joints and the dimensions that Table 1 prints."""
    at, radius = _stations(arm), arm.link_radius * MM_PER_M
    gap, colours = arm.cables.half_gap * MM_PER_M, style.key_colours(arm)
    axes.add_patch(Rectangle((-540.0, -95.0), 540.0, 190.0, facecolor=style.GRID,
                             edgecolor=style.FAINT, linewidth=0.7))  # fmt: skip
    axes.text(-270.0, 0.0, "propulsion\nplatform", size=6.2, ha="center", va="center")
    for i, (x, end) in enumerate(pairwise(at.tolist())):
        last = i == arm.n_links - 1
        body = FancyBboxPatch(
            (x + gap, -radius), end - x - (1.0 if last else 2.0) * gap, 2.0 * radius,
            boxstyle="round,pad=0,rounding_size=14", facecolor=colours[i],
            edgecolor=style.INK, linewidth=0.5, alpha=0.85, zorder=3,
        )  # fmt: skip
        axes.add_patch(body)
        axes.plot(x, 0.0, "o", color=style.INK, markersize=4.2, zorder=4)
        axes.annotate("", (x, -150.0), (end, -150.0), arrowprops={
            "arrowstyle": "<->", "color": style.INK, "linewidth": 0.6,
            "shrinkA": 0, "shrinkB": 0, "mutation_scale": 5,
        })  # fmt: skip
        words = f"L{style.subscript(i + 1)} {end - x:.0f}"
        axes.text((x + end) / 2.0, -205.0, words, size=6.0, ha="center", va="center")
    axes.plot(at[-1], 0.0, "o", color=style.TIP, markersize=3.6, zorder=5)
    axes.text(at[-1] + 30.0, 0.0, "tip O₉", size=6.5, va="center")
    axes.annotate(
        "x₀",
        (0.0, 150.0),
        (-500.0, 150.0),
        size=6.5,
        va="center",
        arrowprops={"arrowstyle": "-|>", "color": style.INK, "linewidth": 0.8},
    )


if __name__ == "__main__":
    save_all(draw(Runs()))
