"""Fig. 2: pitch θ and yaw α of a universal joint, link angle ψ, position angle γ."""

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.runs import Runs
from paper_figures.style import save_all

from vdsm_pin.arm.kinematics import link_angles, link_frames, position_angles
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.palette import AXES, OBSTACLE_EDGE, PATH

NAME: Final = "fig02"
ALPHA, THETA = np.deg2rad(38.0), np.deg2rad(-30.0)
"""Large enough to be seen, and θ negative: the link points up."""


def draw(runs: Runs) -> dict[str, Figure]:
    """One joint, drawn by the package's own kinematics."""
    del runs  # nothing is planned
    figure = style.sheet(3.3, 4.6)
    axes: Any = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d")
    axes.set_axis_off()
    axes.view_init(elev=22, azim=-62)
    axes.set_box_aspect((1.6, 1.0, 1.0), zoom=1.55)
    axes.set_xlim(-0.6, 1.0)
    axes.set_ylim(-0.35, 0.65)
    axes.set_zlim(-0.3, 0.7)
    turn = link_frames(np.array([[ALPHA]]), np.array([[THETA]]))[0, 0]
    tip = turn @ [1.0, 0.0, 0.0]
    flat = np.array([tip[0], tip[1], 0.0])
    wall = np.array([0.0, tip[1], tip[2]])
    for start, end, colour, width in (
        ((-0.6, 0.0, 0.0), (0.0, 0.0, 0.0), OBSTACLE_EDGE, 6.0),
        ((0.0, 0.0, 0.0), tip, style.STRATEGY_COLOURS["fewest"], 6.0),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), style.FAINT, 0.8),
        ((0.0, 0.0, 0.0), (0.0, 0.62, 0.0), style.FAINT, 0.8),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.62), style.FAINT, 0.8),
    ):
        _line(axes, [start, end], colour, width)
    for ends in ([(0.0, 0.0, 0.0), flat], [flat, tip], [tip, wall],
                 [(0.0, 0.0, 0.0), wall], [wall, (0.0, tip[1], 0.0)]):  # fmt: skip
        _line(axes, ends, style.INK, 0.6, (0, (3, 2)))
    _arc(axes, 0.42, [1.0, 0.0, 0.0], flat, "α", AXES["x"])
    _arc(axes, 0.62, flat, tip, "θ", AXES["y"])
    _arc(axes, 0.28, [1.0, 0.0, 0.0], tip, "ψ", "#8e44ad")
    _arc(axes, 0.20, [0.0, 1.0, 0.0], wall, "γ", PATH)
    for word, place in (("x", (1.04, 0.0, 0.0)), ("y", (0.0, 0.66, -0.09)),
                        ("z", (0.0, 0.0, 0.67)),
                        ("link i − 1", (-0.55, -0.02, 0.08)),
                        ("link i", tuple(0.72 * tip + [0.0, 0.0, 0.1]))):  # fmt: skip
        axes.text(*place, word, size=7.0)
    psi = np.rad2deg(link_angles(np.array(ALPHA), np.array(THETA)))
    gamma = np.rad2deg(position_angles(np.array(ALPHA), np.array(THETA)))
    figure.text(
        0.03, 0.05,
        f"α = {np.rad2deg(ALPHA):.0f}°, "
        f"θ = −{np.rad2deg(-THETA):.0f}° (up is negative): "
        f"ψ = arccos(cos θ cos α) = {psi:.1f}°,\n"
        f"γ = atan2(−sin θ, cos θ sin α) = {gamma:.1f}°, seen against x",
        size=6.5,
    )  # fmt: skip
    return {NAME: figure}


def _line(
    axes: Any, ends: Any, colour: str, width: float, dashes: Any = "solid"
) -> None:
    points = np.array([np.asarray(end, dtype=float) for end in ends])
    axes.plot(*points.T, color=colour, linewidth=width, linestyle=dashes,
              solid_capstyle="round")  # fmt: skip


def _arc(
    axes: Any, radius: float, start: Any, end: FloatArray, word: str, colour: str
) -> None:
    """An arc about the joint from one direction to another, with its name."""
    first, last = (np.asarray(v) / np.linalg.norm(v) for v in (start, end))
    angle = np.arccos(np.clip(first @ last, -1.0, 1.0))
    part = np.linspace(0.0, 1.0, 40)[:, None]
    between = np.sin((1.0 - part) * angle) * first + np.sin(part * angle) * last
    points = radius * between / np.sin(angle)
    axes.plot(*points.T, color=colour, linewidth=1.4)
    axes.text(*(points[20] * 1.13), word, color=colour, size=8.0)


if __name__ == "__main__":
    save_all(draw(Runs()))
