"""What a page's scripts read: the scene, the motion, the plots, as one JSON value."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Solid
from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, solid_of
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.charts import charts, packed
from vdsm_pin.report.impasse import Impasse
from vdsm_pin.report.moves import moves
from vdsm_pin.report.palette import link_colours
from vdsm_pin.report.reason import failing
from vdsm_pin.report.solids import FINE, Detail, detail, surface
from vdsm_pin.report.thinning import (
    MOST_DRAWN,
    Thinned,
    nearest_obstacles,
    thinned,
)
from vdsm_pin.report.words import finite
from vdsm_pin.verification.protocols import AnyMotion
from vdsm_pin.verification.records import (
    ArmVerification,
    ClosestApproach,
    Counterexample,
    Verification,
)

_MOST_BETWEEN: Final = 4_000
"""Rows that a smooth motion is drawn with, where it has not more itself."""


def obstacle_data(
    problem: AnyProblem,
    obstacles: Sequence[Obstacle],
    trajectory: AnyMotion,
    extent: float,
) -> dict[str, Any]:
    """Some obstacles, and where their frame is; base frame, [m].

    What moves is in its own frame, which stands where `moves` says.
    """
    fine = detail(len(obstacles))
    return {
        "pose": problem.T_world_base.ravel().tolist(),
        "obstacles": [
            {**_solid(solid_of(one), extent, fine), **moves(one, trajectory)}
            for one in obstacles
        ],
    }


def scene_data(
    problem: PlanningProblem, obstacles: Sequence[Obstacle], trajectory: Trajectory
) -> dict[str, Any]:
    """The arm, some obstacles and the desired path; base frame, [m]."""
    arm = problem.manipulator
    extent = arm.total_length
    return {
        **obstacle_data(problem, obstacles, trajectory, extent),
        "lengths": arm.link_lengths.tolist(),
        "radius": arm.link_radius,
        "axes": [
            [min(k + 1, arm.n_links) - 1, *span, radius]
            for k, (span, radius) in enumerate(
                zip(arm.axis_spans.tolist(), arm.axis_radii.tolist(), strict=True)
            )
        ],
        "colours": list(link_colours(arm.n_links)),
        "carried": [
            {"link": link, **_solid(solid, extent, FINE)} for link, solid in arm.carried
        ],
        "path": packed(() if problem.tip_path is None else problem.tip_path.corners),
    }


def _solid(solid: Solid, extent: float, fine: Detail) -> dict[str, Any]:
    """Triangles to draw a solid with."""
    skin = surface(solid, extent, fine)
    return {
        "name": solid.name,
        "vertices": packed(skin.vertices),
        "triangles": packed(skin.triangles, "<u4"),
        "round": skin.round,
        "creased": skin.creased,
        "count": len(skin.triangles),
    }


def row_data(trajectory: AnyMotion, shown: Thinned) -> dict[str, Any]:
    """Which rows are shown, and when they are."""
    times = {} if trajectory.times is None else {"times": trajectory.times[shown.rows]}
    return {
        "nSamples": trajectory.n_samples,
        **{name: packed(values, "<f8") for name, values in times.items()},
        "complete": shown.complete,
        "rows": packed(shown.rows, "<i4"),
    }


def motion_data(
    problem: PlanningProblem, trajectory: Trajectory, shown: Thinned
) -> dict[str, Any]:
    """The joint values of the rows shown; the page computes the poses from them."""
    rows = shown.rows
    on_path = () if problem.tip_path is None else trajectory.on_path[rows]
    return {
        **row_data(trajectory, shown),
        **({"smooth": _smooth(trajectory)} if trajectory.is_smooth else {}),
        "onPath": packed(on_path, "u1"),
        "pathM": packed(trajectory.path_m[rows]),
        "x0": packed(trajectory.x0[rows]),
        "alpha": packed(trajectory.alpha[rows]),
        "theta": packed(trajectory.theta[rows]),
    }


def _smooth(trajectory: Trajectory) -> dict[str, Any]:
    """Joint values between the rows of a smooth motion, for the picture alone."""
    count = trajectory.n_samples - 1
    parts = max(1, min(32, _MOST_BETWEEN // count))
    fine = trajectory.refined(parts)
    return {
        "moments": packed(np.arange(fine.n_samples) / parts, "<f8"),
        "x0": packed(fine.x0),
        "alpha": packed(fine.alpha),
        "theta": packed(fine.theta),
    }


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
    return {"moment": found.moment, "words": words, **_stance(verification, found)}


def _stance(verification: Verification, found: Counterexample) -> dict[str, Any]:
    joints = found.joints
    if not isinstance(verification, ArmVerification):
        from vdsm_pin.report.robot_page import robot_stance
        from vdsm_pin.robots.judgement import RobotVerification

        assert isinstance(verification, RobotVerification)
        return robot_stance(verification.problem.robot, joints)
    columns = joints[:1], joints[None, 1::2], joints[None, 2::2]
    centres = joint_centres(verification.problem.manipulator, *columns)[0]
    return {"centres": centres.tolist()}


@dataclass(frozen=True)
class PageData:
    """What a page is made of.

    Args:
        text: Everything its scripts read, as JSON that is safe inside HTML.
        charts: Identifier, title and note of every plot.
        complete: Whether every row of the motion is shown.
        triangles: How many are drawn of each obstacle drawn, by its name.
    """

    text: str
    charts: tuple[dict[str, Any], ...]
    complete: bool
    triangles: dict[str, int]


def _drawn(
    verification: Verification, obstacles: Sequence[Obstacle], shown: Thinned
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The scene and the motion of an arm, or of any other robot."""
    rows, lost = verification.trajectory, verification.counterexamples
    ghosts = {"ghosts": [ghost_data(verification, one) for one in lost]}
    if isinstance(verification, ArmVerification):
        problem = verification.problem
        scene = scene_data(problem, obstacles, verification.trajectory)
        return scene | ghosts, motion_data(problem, verification.trajectory, shown)
    from vdsm_pin.report.robot_page import robot_links, robot_motion
    from vdsm_pin.robots.judgement import RobotVerification

    assert isinstance(verification, RobotVerification)
    links = robot_links(verification)
    extent = 20.0 * links["radius"]
    scene = obstacle_data(verification.problem, obstacles, rows, extent) | links
    return scene | ghosts, row_data(rows, shown) | robot_motion(verification, shown)


def report_data(verification: Verification) -> PageData:
    """The data of a report."""
    lost = verification.counterexamples
    remarkable = [row.interval for row in verification.approaches]
    remarkable += [one.interval for one in lost]
    intervals = np.array(remarkable, dtype=np.int64)
    shown = thinned(verification.trajectory, np.concatenate([intervals, intervals + 1]))
    plots = charts(verification, shown)
    obstacles = verification.problem.scene.obstacles
    drawn = [obstacles[k] for k in nearest_obstacles(verification, MOST_DRAWN)]
    scene, motion = _drawn(verification, drawn, shown)
    marks = [
        {"name": one.name, "verdict": one.verdict.value, "moment": float(one.moment)}
        for one in failing(verification)
        if np.isfinite(one.moment)
    ]
    near = [closest_data(verification, row) for row in verification.approaches]
    text = embedded(_page(scene, motion, near) | {"marks": marks, "charts": plots})
    triangles = {solid["name"]: solid["count"] for solid in scene["obstacles"]}
    return PageData(text, tuple(plots), shown.complete, triangles)


def view_data(problem: PlanningProblem, trajectory: Trajectory) -> str:
    """The data of a 3D view; without a verification nothing is claimed."""
    shown = thinned(trajectory, np.zeros(0, dtype=np.int64))
    scene = scene_data(problem, problem.scene.obstacles[:MOST_DRAWN], trajectory)
    return embedded(_page(scene, motion_data(problem, trajectory, shown)))


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
    shown_scene = scene_data(problem, drawn, place.arm) | {"pins": pins}
    motion = motion_data(problem, place.arm, shown)
    return embedded(_page(shown_scene, motion, [near]))


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
