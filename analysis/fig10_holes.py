"""Fig. 10: a joint with its cables, and the holes with their angles."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.runs import Runs
from paper_figures.style import save_all

from vdsm_pin.arm.kinematics import link_frames
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.units import MM_PER_M

NAME: Final = "fig10"
PRINTED: Final = {(5, "b"): 0, (6, "b"): 15, (1, "a"): 180, (4, "b"): 345}
"""Hole angles that the paper prints, by link and hole; [deg]."""
ALPHA, THETA = np.deg2rad(20.0), np.deg2rad(-25.0)


def draw(runs: Runs) -> dict[str, Figure]:
    """Left the first joint, bent, from the side; right its 24 holes along the link."""
    del runs  # nothing is planned
    arm = built_in("hrm8")
    figure = style.sheet(3.5)
    oblique: Any = figure.add_axes((0.0, 0.02, 0.5, 0.9), projection="3d")
    _joint(oblique, arm)
    axes = style.place(figure, 3.75, 0.15, 3.15, 3.0)
    _holes(axes, arm)
    style.panel_title(axes, "b", "the holes of joint 1, seen along the arm")
    figure.text(0.016, 0.922, "(a) joint 1 with its 24 cables", weight="bold", size=7.5)
    return {NAME: figure}


def _places(arm: Manipulator) -> FloatArray:
    """Holes in the plane of a face, y and z, shape (N, 3, 2); [mm]."""
    phi, radius = arm.cables.hole_angles, arm.cables.hole_radius * MM_PER_M
    return np.asarray(radius * np.stack([np.sin(phi), np.cos(phi)], axis=-1))


def _joint(axes: Any, arm: Manipulator) -> None:
    """Both end faces of a bent joint and the cables between them (Eq. 16-20)."""
    gap, colours = arm.cables.half_gap * MM_PER_M, style.key_colours(arm)
    turn = link_frames(np.array([[ALPHA]]), np.array([[THETA]]))[0, 0]
    round_ = np.linspace(0.0, 2.0 * np.pi, 90)
    rim = arm.link_radius * MM_PER_M * np.stack([np.sin(round_), np.cos(round_)], 1)
    for way, frame in ((-1.0, np.eye(3)), (1.0, turn)):
        for far in (gap, gap + 65.0):
            face = np.column_stack([np.full(len(rim), way * far), rim]) @ frame.T
            axes.plot(*face.T, color=style.INK, linewidth=0.9)
    places = _places(arm)
    for (j, k), _ in np.ndenumerate(arm.cables.hole_angles):
        near = np.array([-gap, *places[j, k]])
        far = turn @ np.array([gap, *places[j, k]])
        ends = np.stack([near - [65.0, 0.0, 0.0], near, far, far + 65.0 * turn[:, 0]])
        axes.plot(*ends.T, color=colours[j], linewidth=0.9)
    axes.plot([0.0], [0.0], [0.0], "o", color=style.INK, markersize=5)
    axes.text(8.0, 0.0, 8.0, "O₁", size=7.0)
    axes.set_axis_off()
    axes.view_init(elev=24, azim=-58)
    axes.set_box_aspect((1, 1, 1), zoom=0.98)
    for limits in (axes.set_xlim, axes.set_ylim, axes.set_zlim):
        limits(-82.0, 82.0)


def _holes(axes: Axes, arm: Manipulator) -> None:
    radius, colours = arm.cables.hole_radius * MM_PER_M, style.key_colours(arm)
    round_ = np.linspace(0.0, 2.0 * np.pi, 180)
    axes.plot(radius * np.sin(round_), radius * np.cos(round_), color=style.GRID)
    for (j, k), phi in np.ndenumerate(arm.cables.hole_angles):
        way = np.array([np.sin(phi), np.cos(phi)])
        axes.plot(*(radius * way), "o", color=colours[j], markersize=5.0, zorder=3)
        word = f"1{j + 1}{'abc'[k]}"
        printed = PRINTED.get((j + 1, "abc"[k]))
        if printed is not None:
            word += f"\n{np.rad2deg(phi):.0f}°"
        axes.text(*(1.2 * radius * way), word, size=6.2, ha="center", va="center",
                  weight="bold" if printed is not None else "normal")  # fmt: skip
    for way, word in (((1.0, 0.0), "y"), ((0.0, 1.0), "z")):
        end = 0.5 * radius * np.array(way)
        axes.annotate("", tuple(end), (0.0, 0.0), arrowprops={
            "arrowstyle": "-|>", "color": style.INK, "linewidth": 0.7,
        })  # fmt: skip
        axes.text(*(1.15 * end), word, size=7.0, ha="center", va="center")
    axes.text(0.0, -0.28 * radius, "φ from z\ntowards y", size=6.2, ha="center")
    axes.set_aspect("equal")
    axes.set_xlim(-1.42 * radius, 1.42 * radius)
    axes.set_ylim(-1.35 * radius, 1.35 * radius)
    axes.set_axis_off()


if __name__ == "__main__":
    save_all(draw(Runs()))
