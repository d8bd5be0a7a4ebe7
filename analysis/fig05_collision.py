"""Fig. 5: without avoidance the straight arm meets each of the three obstacles."""

import numpy as np
from matplotlib.figure import Figure
from paper_figures import style
from paper_figures.runs import SCENE_TITLES, Runs
from paper_figures.scenery import (
    ROOM,
    draw_arm,
    draw_danger_edge,
    draw_desired_path,
    draw_obstacles,
    square,
)
from paper_figures.style import save_all
from paper_figures.views import OBLIQUE, SIDE, TOP

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.lift import lift
from vdsm_pin.planner.paper.scale import scale
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.verification.link_clearance import link_clearance

NAME = "fig05"
SCENES = ("obs1", "obs2", "obs3")
TIP_SHOWN = 2  # the corner A6 of the path


def straight_arm(problem: PlanningProblem) -> FloatArray:
    """The straight arm with its tip at A6, shape (N + 1, 3); [m] (Steps 3 and 6)."""
    arm, tip = problem.manipulator, problem.path.points[TIP_SHOWN]
    planar = scale(arm, tip[None, 1:])
    return lift(arm, planar, tip[None, 0])[0]


def colliding_links(problem: PlanningProblem) -> tuple[int, ...]:
    """Numbers of the links that meet the obstacle, counted from 1."""
    nearest = link_clearance(problem)(straight_arm(problem)[None])[0]
    return tuple(int(i) + 1 for i in np.flatnonzero(nearest < 0.0))


def draw(runs: Runs) -> dict[str, Figure]:
    """Each scene obliquely, and seen along the obstacle's axis."""
    width = (style.WIDTH - 0.1) / 3.0
    figure = style.sheet(4.05)
    for k, scene in enumerate(SCENES):
        problem = runs.problem(scene)
        centres = straight_arm(problem)
        upper = style.place(figure, 0.05 + k * width, 2.36, width, 1.42)
        upper.set_aspect("equal")
        upper.axis("off")
        draw_obstacles(upper, OBLIQUE, problem)
        draw_desired_path(upper, OBLIQUE, problem)
        draw_arm(upper, OBLIQUE, problem, centres, behind=2.5)
        seen = OBLIQUE(np.array(np.meshgrid(*ROOM.T)).reshape(3, -1).T)
        upper.set_xlim(seen[:, 0].min(), seen[:, 0].max())
        upper.set_ylim(seen[:, 1].min() + 250.0, seen[:, 1].max() - 450.0)
        style.panel_title(upper, "abc"[k], SCENE_TITLES[scene])
        view = TOP if scene == "obs3" else SIDE
        low, high = (ROOM[0], ROOM[1]) if view is SIDE else _near(ROOM)
        span = np.abs(view(high) - view(low))
        across = 1.72 * span[0] / span[1]
        lower = style.place(
            figure, 0.05 + k * width + 0.5 * (width - across) + 0.12, 0.42, across, 1.72
        )
        draw_danger_edge(lower, view, problem)
        draw_obstacles(lower, view, problem, zorder=1.0)
        draw_desired_path(lower, view, problem)
        draw_arm(lower, view, problem, centres)
        square(lower, view, low, high)
        links = colliding_links(problem)
        lower.text(
            0.03, 0.97, _sentence(links), transform=lower.transAxes, va="top",
            color=style.LIMIT, size=6.8,
        )  # fmt: skip
    return {NAME: figure}


def _near(room: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The outer part of the room, where obs3 stands."""
    return np.array([1.3, *room[0, 1:]]), np.array([3.2, *room[1, 1:]])


def _sentence(links: tuple[int, ...]) -> str:
    if not links:
        return "no link meets it"
    plural = "s" if len(links) > 1 else ""
    verb = "meet" if plural else "meets"
    return f"link{plural} {', '.join(map(str, links))} {verb} it"


if __name__ == "__main__":
    save_all(draw(Runs()))
