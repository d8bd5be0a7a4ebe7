"""Fig. 19 to 21: the moving arm, its joint angles and their errors in closed loop."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.runs import STRATEGIES, Runs
from paper_figures.scenery import draw_arm, draw_obstacles, faces
from paper_figures.views import oblique

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.report.palette import AXES, PATH
from vdsm_pin.simulation.closed_loop import Simulation, simulate
from vdsm_pin.simulation.folder import BAND
from vdsm_pin.simulation.settings import Kick, Settings

VIEW = oblique(35.0, 22.0)
MOMENTS = 6
"""Poses of Fig. 19."""
FIGURES = tuple(f"fig{k}-{name}" for k in (19, 20, 21) for name in STRATEGIES)
KICKS = (
    Kick(axis="alpha", joint=5, share=0.35, torque_nm=6.0),
    Kick(axis="alpha", joint=6, share=0.65, torque_nm=12.0),
)
"""Disturbances of the size that the paper's Fig. 21 shows: about 4 deg."""


def draw(runs: Runs) -> dict[str, Figure]:
    """The three figures of obs3 with both kicks, for each strategy."""
    figures = {}
    for strategy in STRATEGIES:
        run = runs("obs3", strategy)
        arm = run.problem.manipulator
        found = simulate(arm, run.trajectory, Settings(kicks=KICKS))
        figures |= {
            f"fig19-{strategy}": poses(run.problem, found),
            f"fig20-{strategy}": actual_and_planned(found),
            f"fig21-{strategy}": errors(found),
        }
    return figures


def poses(problem: PlanningProblem, found: Simulation) -> Figure:
    """Fig. 19: six poses of the executed motion, evenly over its time."""
    figure = style.sheet(4.6)
    rows = np.linspace(0, len(found.times) - 1, MOMENTS).astype(int)
    joints = found.executed[rows]
    centres = joint_centres(
        problem.manipulator, joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    )
    path = VIEW(problem.path.corners)
    drawn = np.vstack([VIEW(centres.reshape(-1, 3)), path])
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    tops = [faces(VIEW, one)[0].bounds[3] for one in problem.scene.obstacles]
    across = (low[0] - 150.0, high[0] + 150.0)
    up = (low[1] - 150.0, max(high[1] + 150.0, *(top + 30.0 for top in tops)))
    for k, row in enumerate(rows):
        axes = style.place(
            figure, 0.1 + 2.38 * (k % 3), 2.35 - 2.25 * (k // 3), 2.28, 1.95
        )
        draw_obstacles(axes, VIEW, problem)
        axes.plot(path[:, 0], path[:, 1], color=style.FAINT, linewidth=0.8, zorder=1)
        draw_arm(axes, VIEW, problem, centres[k], behind=2.0)
        axes.set_aspect("equal")
        axes.set_xlim(*across)
        axes.set_ylim(*up)
        axes.set_axis_off()
        style.panel_title(axes, "abcdef"[k], f"{found.times[row]:.0f} s")
    return figure


def actual_and_planned(found: Simulation) -> Figure:
    """Fig. 20: the sixteen joint angles, executed over planned."""
    figure, panels = _panels(found)
    for k, axes in enumerate(panels):
        planned, executed = np.rad2deg(
            [found.planned[:, 1 + k], found.executed[:, 1 + k]]
        )
        axes.plot(
            found.times, planned, color=style.FAINT, linewidth=2.2, rasterized=True
        )
        axes.plot(
            found.times, executed, color=_colour(k), linewidth=0.8, rasterized=True
        )
    _labels(figure, "angle [°]: grey as planned, coloured as executed")
    return figure


def errors(found: Simulation) -> Figure:
    """Fig. 21: the sixteen errors and the band of 0.3 deg."""
    figure, panels = _panels(found)
    for k, axes in enumerate(panels):
        axes.plot(
            found.times,
            np.rad2deg(found.errors[:, k]),
            color=_colour(k),
            linewidth=0.7,
            rasterized=True,
        )
        for side in (-1.0, 1.0):
            axes.axhline(
                side * np.rad2deg(BAND), color=style.LIMIT, linewidth=0.6, dashes=(4, 3)
            )
        widest = max(0.45, 1.1 * float(np.rad2deg(np.abs(found.errors[:, k]).max())))
        axes.set_ylim(-widest, widest)
    _labels(figure, "executed less planned [°]; dashed: ±0.3°")
    return figure


def _panels(found: Simulation) -> tuple[Figure, list[Axes]]:
    """A panel an angle, four in a row."""
    count = found.errors.shape[1]
    n_rows = -(-count // 4)
    figure = style.sheet(1.22 * n_rows + 0.25)
    panels = []
    for k in range(count):
        low = 0.45 + 1.22 * (n_rows - 1 - k // 4)
        axes = style.place(figure, 0.48 + 1.72 * (k % 4), low, 1.28, 0.86)
        name = "αθ"[k % 2] + style.subscript(k // 2 + 1)
        axes.set_title(name, pad=2.0)
        axes.grid(True)
        panels.append(axes)
    return figure, panels


def _labels(figure: Figure, what: str) -> None:
    figure.text(0.5, 0.01, f"time [s]; {what}", ha="center", fontsize=7.0)


def _colour(k: int) -> str:
    return AXES["z"] if k % 2 == 0 else PATH
