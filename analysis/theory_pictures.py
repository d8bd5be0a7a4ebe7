"""docs/theory_chart.svg and docs/theory_bound.svg, drawn from the arm's own kinematics.

python analysis/theory_pictures.py
"""

from itertools import pairwise
from pathlib import Path
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.report.palette import AXES, PATH

FOLDER: Final = Path(__file__).parents[1] / "docs"
INK, PALE, ARM, PLANE = "#1f2733", "#b6bfcb", PATH, AXES["z"]
KNEE: Final = 4
"""The joint at which the arm of the chart bends."""

TIP, CORNER = np.array([0.9, 0.5]), np.array([0.15, 0.0])
"""Where the projections of the tip and of the knee lie across the rail; [m]."""

START, END = np.radians([0.0, 25.0]), np.radians([38.0, -12.0])
"""Pitch of joints 1 and 3 at the two rows of the bound."""


def projections(arm: Manipulator) -> np.ndarray:
    """P_1 .. P_{N+1} of an arm with one knee, shape (N + 1, 2); [m]."""
    along = np.concatenate([[0.0], np.cumsum(arm.link_lengths)])
    first = np.clip(along / along[KNEE], 0.0, 1.0)[:, None]
    rest = np.clip((along - along[KNEE]) / (along[-1] - along[KNEE]), 0, 1)[:, None]
    return np.asarray(first * CORNER + rest * (TIP - CORNER))


def lifted(arm: Manipulator, planar: np.ndarray) -> np.ndarray:
    """Places on the rail's axis, shape (N + 1,): the lift of Eq. 7; [m]."""
    across = np.linalg.norm(np.diff(planar, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(np.sqrt(arm.link_lengths**2 - across**2))])


def draw_chart(target: Path) -> None:
    """Projections of an arm across the rail, and the arm that is lifted from them."""
    arm = built_in("hrm8")
    planar = projections(arm)
    x = lifted(arm, planar)
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), width_ratios=(1, 2))
    for axes, across in ((left, planar[:, 0]), (right, x)):
        axes.plot(across, planar[:, 1], "-o", color=ARM, lw=3, ms=6)
    for i in (0, KNEE, arm.n_links):
        left.annotate(
            f"$P_{{{i + 1}}}$", planar[i], (6, -12), textcoords="offset points"
        )
        place = x[i], planar[i, 1]
        right.annotate(f"$O_{{{i + 1}}}$", place, (2, 8), textcoords="offset points")
    left.set(title="the chart: across the rail", xlabel="y [m]", ylabel="z [m]")
    right.set(title="lifted: from the side", xlabel="x, along the rail [m]")
    _save(figure, (left, right), target)


def draw_bound(target: Path) -> None:
    """Height of a joint centre between two rows, its chord and the band about it."""
    arm = built_in("hrm8")
    tau = np.linspace(0.0, 1.0, 201)
    height = heights(arm, tau)
    reach = bend(arm)
    figure, row = plt.subplots(1, 2, figsize=(8, 3), sharey=True)
    for axes, cuts in zip(row, ((0.0, 1.0), (0.0, 0.5, 1.0)), strict=True):
        for a, b in pairwise(cuts):
            ends = np.array([a, b])
            chord, up = np.interp(ends, tau, height), reach * (b - a) ** 2 / 8.0
            axes.fill_between(ends, chord - up, chord + up, color=PALE, alpha=0.5, lw=0)
            axes.plot(ends, chord, "--o", color=INK, lw=1, ms=4)
            axes.hlines(max(chord) + up, a, b, color=PLANE, lw=2)
        axes.plot(tau, height, color=ARM, lw=2)
        slices = len(cuts) - 1
        title = "one slice" if slices == 1 else f"{slices} slices"
        axes.set(title=title, xlabel="τ, from row to row", xlim=(0.0, 1.0))
    row[0].set_ylabel("height n·p [m]")
    _save(figure, tuple(row), target, equal=False)


def heights(arm: Manipulator, tau: np.ndarray) -> np.ndarray:
    """Height of O_4 along -z while joints 1 and 3 pitch, shape (n,); [m]."""
    alpha, theta = np.zeros((2, tau.size, arm.n_links))
    theta[:, [0, 2]] = START + tau[:, None] * (END - START)
    return -np.asarray(joint_centres(arm, np.zeros(tau.size), alpha, theta)[:, 3, 2])


def bend(arm: Manipulator) -> float:
    """M of O_4: the sum of L_l W_l^2 (docs/certificate.md); [m]."""
    change = np.abs(END - START)
    turning = np.array([change[0], change[0], change.sum()])
    return float((arm.link_lengths[:3] * turning**2).sum())


def _save(
    figure: plt.Figure, axes: tuple[Axes, ...], target: Path, *, equal: bool = True
) -> None:
    for one in axes:
        one.spines[["top", "right"]].set_visible(False)
        if equal:
            one.set_aspect("equal", adjustable="datalim")
    figure.tight_layout()
    figure.savefig(target, metadata={"Date": None})
    plt.close(figure)


def main() -> None:
    """Draw both pictures."""
    mpl.rcParams.update({"svg.hashsalt": "theory", "font.size": 9})
    draw_chart(FOLDER / "theory_chart.svg")
    draw_bound(FOLDER / "theory_bound.svg")


if __name__ == "__main__":
    main()
