"""docs/conventions.svg: which way angles turn and where cable holes are counted from.

    python analysis/conventions.py

Every line is placed by the package's own kinematics.
"""

from pathlib import Path
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.report.palette import PATH

TARGET: Final = Path(__file__).parents[1] / "docs" / "conventions.svg"
ANGLE: Final = np.deg2rad(25.0)
INK, LINK, TURNED = "#1f2733", "#b6bfcb", PATH


def _bent(alpha: float, theta: float) -> np.ndarray:
    """Joint centres of an arm whose second joint alone is turned, (N + 1, 3); [m]."""
    arm, angles = built_in("hrm8"), np.zeros((2, 1, 8))
    angles[0, 0, 1], angles[1, 0, 1] = alpha, theta
    return np.asarray(joint_centres(arm, np.zeros(1), *angles)[0])


def _side(axes: Axes, centres: np.ndarray, across: int, title: str, sign: str) -> None:
    straight = _bent(0.0, 0.0)
    for points, colour in ((straight, LINK), (centres, TURNED)):
        axes.plot(*points[:3, [0, across]].T, "-o", color=colour, lw=5, ms=5)
    x, y = centres[1:3, [0, across]].mean(axis=0)
    place = {"color": TURNED, "ha": "center", "va": "center"}
    axes.text(x, y + 0.08 * np.sign(y), sign, **place)
    axes.text(0.02, 0.06, "O₁", color=INK)
    _axes_arrows(axes, ("x (rail)", "yz"[across - 1]), (-0.1, -0.42))
    axes.set(title=title, xlim=(-0.15, 0.95), ylim=(-0.5, 0.4))


def _axes_arrows(
    axes: Axes, names: tuple[str, str], origin: tuple[float, float]
) -> None:
    for name, way in zip(names, ((0.25, 0.0), (0.0, 0.25)), strict=True):
        tip = origin[0] + way[0], origin[1] + way[1]
        axes.annotate("", tip, origin, arrowprops={"arrowstyle": "->", "color": INK})
        axes.text(tip[0] + 0.02, tip[1] + 0.02, name, color=INK)


def _face(axes: Axes) -> None:
    """A link's end face seen from the tip, against x: y to the right, z up."""
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(0.5 * np.sin(turn), 0.5 * np.cos(turn), color=LINK, lw=5)
    arc = np.linspace(0.0, np.deg2rad(40.0), 40)
    axes.plot(0.25 * np.sin(arc), 0.25 * np.cos(arc), color=TURNED, lw=2)
    for degrees in (0.0, 40.0):
        phi = np.deg2rad(degrees)
        hole = 0.4 * np.sin(phi), 0.4 * np.cos(phi)
        axes.plot([0.0, hole[0]], [0.0, hole[1]], color=LINK, lw=1)
        axes.plot(*hole, "o", color=TURNED, ms=8)
        label = "φ = 0" if degrees == 0.0 else f"φ = {degrees:.0f}°"
        axes.text(hole[0] + 0.04, hole[1] - 0.02, label, color=INK)
    _axes_arrows(axes, ("y", "z"), (-0.6, -0.58))
    axes.set(title="end face, seen from the tip", xlim=(-0.75, 0.75), ylim=(-0.6, 0.6))


def main() -> None:
    """Draw the picture."""
    mpl.rcParams.update({"svg.hashsalt": "vdsm-pin", "font.size": 9})
    figure, (side, top, face) = plt.subplots(1, 3, figsize=(10.0, 3.2))
    _side(side, _bent(0.0, ANGLE), 2, "side view: θ₂ = +25° turns down", "θ > 0")
    _side(top, _bent(ANGLE, 0.0), 1, "top view: α₂ = +25° turns to +y", "α > 0")
    _face(face)
    for axes in (side, top, face):
        axes.set_aspect("equal")
        axes.axis("off")
    figure.tight_layout()
    figure.savefig(TARGET, metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    main()
