"""What a page's scripts read: the scene, the motion, the plots, as one JSON value."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.any_problem import AnyMotion, AnyProblem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.arm_drawing import ArmDrawing
from vdsm_pin.report.charts import clearance_charts
from vdsm_pin.report.drawing import Drawing
from vdsm_pin.report.impasse import Impasse
from vdsm_pin.report.reason import failing
from vdsm_pin.report.thinning import MOST_DRAWN, nearest_obstacles, thinned
from vdsm_pin.report.words import finite
from vdsm_pin.verification.records import (
    ClosestApproach,
    Counterexample,
    Verification,
)


def drawing_of(problem: AnyProblem, motion: AnyMotion) -> Drawing:
    """How a motion of a snake arm or of any other robot is drawn."""
    if isinstance(problem, PlanningProblem):
        assert isinstance(motion, Trajectory)
        return ArmDrawing(problem, motion)
    # Whoever draws an arm needs no robots.
    from vdsm_pin.report.robot_drawing import RobotDrawing
    from vdsm_pin.robots.cell import Cell

    assert isinstance(problem, Cell)
    assert isinstance(motion, JointTrajectory)
    return RobotDrawing(problem, motion)


def closest_data(
    verification: Verification, approach: ClosestApproach
) -> dict[str, Any]:
    """Where and when one closest approach happens; base frame, [m]."""
    problem, pair = verification.problem, approach.pair
    needed = (
        problem.required_clearance if pair.obstacle else problem.required_self_clearance
    )
    return {
        "moment": approach.moment,
        "link": pair.link,
        "otherLink": pair.other_link,
        "obstacle": pair.obstacle,
        "upper": finite(approach.upper),
        "short": bool(approach.upper < needed),
        "deeper": approach.deeper,
        # The exact motion is drawn, also where a box of errors is judged.
        "nominal": verification.errors != ErrorBox(),
        "linkPoint": _point(approach.link_point),
        "otherPoint": _point(approach.other_point),
    }


def ghost_data(verification: Verification, found: Counterexample) -> dict[str, Any]:
    """What stands at a counterexample, errors applied; base frame, [m]."""
    pair = f"{found.pair.own} comes too near {found.pair.label}"
    words = [f"transparent: with joint errors within the error box {pair}"]
    if verification.errors.base > 0.0 or verification.errors.obstacle > 0.0:
        words.append("errors of base and obstacles are not drawn")
    if verification.nominal_clear:
        words.append("the nominal motion is clear")
    stance = drawing_of(verification.problem, verification.trajectory).stance(
        found.joints
    )
    return {"moment": found.moment, "words": words, **stance}


def report_data(verification: Verification) -> dict[str, Any]:
    """What is drawn on a report, by the names that its template has for it.

    Returns:
        data: Everything its scripts read, as JSON that is safe inside HTML.
        charts: Identifier, title and note of every plot.
        complete: Whether every row of the motion is shown.
        not_drawn: What links look like that is not drawn, and why.
        drawn: How many triangles are drawn of each obstacle drawn, by its name.
    """
    lost = verification.counterexamples
    remarkable = [row.interval for row in verification.approaches]
    remarkable += [one.interval for one in lost]
    intervals = np.array(remarkable, dtype=np.int64)
    shown = thinned(verification.trajectory, np.concatenate([intervals, intervals + 1]))
    drawing = drawing_of(verification.problem, verification.trajectory)
    plots = drawing.charts(shown, clearance_charts(verification, shown, drawing.names))
    obstacles = verification.problem.scene.obstacles
    drawn = [obstacles[k] for k in nearest_obstacles(verification, MOST_DRAWN)]
    scene, motion = drawing.scene(drawn), drawing.motion(shown)
    scene["ghosts"] = [ghost_data(verification, one) for one in lost]
    marks = [
        {"name": one.name, "verdict": one.verdict.value, "moment": float(one.moment)}
        for one in failing(verification)
        if np.isfinite(one.moment)
    ]
    near = [closest_data(verification, row) for row in verification.approaches]
    page = _page(scene, motion, near) | {"marks": marks, "charts": plots}
    return {
        "data": embedded(page),
        "charts": plots,
        "complete": shown.complete,
        "not_drawn": drawing.not_drawn,
        "drawn": {solid["name"]: solid["count"] for solid in scene["obstacles"]},
    }


def view_data(drawing: Drawing) -> str:
    """The data of a 3D view; without a verification nothing is claimed."""
    shown = thinned(drawing.trajectory, np.zeros(0, dtype=np.int64))
    scene = drawing.scene(drawing.problem.scene.obstacles[:MOST_DRAWN])
    return embedded(_page(scene, drawing.motion(shown)))


def impasse_data(problem: PlanningProblem, place: Impasse) -> str:
    """The data of a page about a search without a plan: the arm where it ended.

    What moves is drawn as it comes to rest, which is what plans are made for.
    """
    if problem.scene.moving:
        still = problem.scene.at_time(problem.scene.rest_time)
        problem = replace(problem, scene=still)
    scene = problem.scene.obstacles
    # The obstacle in the way is shown, however many there are.
    first = sorted(range(len(scene)), key=lambda k: scene[k].name != place.obstacle)
    drawn = [scene[k] for k in sorted(first[:MOST_DRAWN])]
    pins = [] if place.tip is None else [place.tip.tolist()]
    pins += [list(place.narrowest)] if place.narrowest else []
    near = {
        "moment": 0.0,
        "link": place.link,
        "otherLink": 0,
        "obstacle": place.obstacle,
        "short": True,
        "linkPoint": None,
        "otherPoint": None,
    }
    shown = thinned(place.arm, np.zeros(0, dtype=np.int64))
    drawing = ArmDrawing(problem, place.arm)
    shown_scene = drawing.scene(drawn) | {"pins": pins}
    return embedded(_page(shown_scene, drawing.motion(shown), [near]))


def _page(
    scene: dict[str, Any], motion: dict[str, Any], closest: Sequence[Any] = ()
) -> dict[str, Any]:
    """What every page has; of nothing judged there are neither marks nor charts."""
    page = {"scene": scene, "motion": motion, "closest": closest}
    return page | {"marks": [], "charts": []}


def _point(point: FloatArray) -> list[float] | None:
    return point.tolist() if np.isfinite(point).all() else None


def embedded(data: dict[str, Any]) -> str:
    """JSON with `<` escaped: no name of an obstacle can end the script element."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")
