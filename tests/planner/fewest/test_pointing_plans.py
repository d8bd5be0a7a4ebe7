"""Plans whose last link looks somewhere: certified, and by plain sampling too."""

from dataclasses import replace

import numpy as np
import pytest
from scenes_for_fewest import problem

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box, Cylinder, Sphere
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest import insertion, strategy
from vdsm_pin.planner.fewest.charts import turned_towards
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.levels import Insert
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.route import tip_route
from vdsm_pin.planner.fewest.smoothing import sparser
from vdsm_pin.planner.fewest.tip_routes import TipSpace
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.problem.desired_path import Blocked, DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import AimError, Pointing, angles_between
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.refinement import Refinement, plan_and_verify
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.pointing import NAME
from vdsm_pin.verification.records import Verdict

ARM = built_in("hrm8")
WELD = np.array([[2.8, 0.2, 0.1], [2.8, 0.5, 0.1], [2.8, 0.5, 0.4]])
PILLAR = Cylinder("pillar", np.array([1.6, 0.5, 0.0]), np.array([0.0, 0, 1]), 2.0, 0.1)
BALL = Sphere("ball", np.array([2.2, -0.1, -0.2]), 0.15)


def looking(pointing: Pointing, *obstacles: Obstacle) -> PlanningProblem:
    """The weld, seen as asked."""
    task = problem(
        *obstacles, points=WELD, closed=False, start=(2.4, 0.0, 0.0),
        blocked=Blocked.FAIL,
    )  # fmt: skip
    return replace(task, tip_path=replace(task.path, pointing=pointing))


def planned(task: PlanningProblem) -> Refinement:
    return plan_and_verify(task, "fewest")


def largest_angle(task: PlanningProblem, found: Refinement) -> float:
    """Off the aim at many instants on the path, in plain arithmetic; [rad]."""
    told = found.plan.trajectory
    both = told.on_path[:-1] & told.on_path[1:]
    worst = 0.0
    for t in np.linspace(0.0, 1.0, 21):
        rows = ((1.0 - t) * told.joints[:-1] + t * told.joints[1:])[both]
        station = ((1.0 - t) * told.path_m[:-1] + t * told.path_m[1:])[both]
        centres = joint_centres(ARM, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
        aims = task.path.aims(centres[:, -1], station)
        off = angles_between(centres[:, -1] - centres[:, -2], aims)
        worst = max(worst, float(off.max()))
    return worst


AHEAD = np.array([[1.0, 0.0, 0.0]])
ASIDE = np.array([[0.8, 0.5, 0.3]])
EACH = np.array([[1.0, 0.0, 0.0], [0.9, 0.4, 0.0], [0.8, 0.4, 0.4]])


@pytest.mark.parametrize("obstacles", [(), (PILLAR, BALL)])
@pytest.mark.parametrize(
    ("target", "directions", "cone_deg"),
    [
        (np.array([3.3, 0.4, 0.2]), None, 5.0),
        (None, AHEAD, 2.0),
        (None, ASIDE, 5.0),
        (None, EACH, 5.0),
    ],
)
def test_the_last_link_looks_there_all_along_the_path(
    target: FloatArray | None,
    directions: FloatArray | None,
    cone_deg: float,
    obstacles: tuple[Obstacle, ...],
) -> None:
    pointing = Pointing(float(np.deg2rad(cone_deg)), target, directions)
    task = looking(pointing, *obstacles)
    found = planned(task)
    assert found.verification.verdict is Verdict.CERTIFIED
    (row,) = [check for check in found.verification.checks if check.name == NAME]
    assert row.verdict is Verdict.CERTIFIED
    assert largest_angle(task, found) <= row.worst <= pointing.cone
    assert found.verification.coverage == pytest.approx(1.0)


def test_no_knee_is_left_that_can_still_be_taken_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where the motion was pulled straight since."""
    finished = []

    def seen(judge: Judge, corners: Corners) -> Corners:
        finished.append((judge, corners))
        return corners

    monkeypatch.setattr(strategy, "straightened", seen)
    task = looking(Pointing(float(np.deg2rad(5.0)), None, EACH))
    strategy.plan_fewest(task, link_clearance(task), 0.0)
    ((judge, corners),) = finished
    counts = [
        judge.look(one.tips, one.offsets)[1].sum()
        for one in (corners, sparser(judge, corners))
    ]
    assert counts[0] == counts[1]


CAMERA = LinkBody(
    8,
    Box("camera", np.array([0.3, 0.0, 0.04]), np.eye(3), np.array([0.04, 0.02, 0.02])),
)
WINDOW = tuple(
    Box(f"w{k}", np.array([2.6, y, z]), np.eye(3), np.array([0.03, *half]))
    for k, (y, z, *half) in enumerate(
        [
            (-1.4, 0.2, 1.43, 3.0),
            (1.9, 0.2, 1.43, 3.0),
            (0.25, -1.6, 0.22, 1.62),
            (0.25, 1.95, 0.22, 1.63),
        ]
    )
)
"""A wall with a window of 440 by 300 mm, round y = 250 and z = 170."""


@pytest.mark.parametrize("joint_deg", [0.0, 0.1])
@pytest.mark.parametrize("target", [np.array([3.6, 0.3, 0.2]), None])
def test_a_camera_looks_through_a_window_within_the_errors(
    target: FloatArray | None, joint_deg: float
) -> None:
    directions = None if target is not None else AHEAD
    pointing = Pointing(float(np.deg2rad(4.0)), target, directions)
    arm = replace(ARM, bodies=(CAMERA,), ignore_pairs=(("camera", "link 7"),))
    path = DesiredPath(
        np.array([2.4, 0.0, 0.0]),
        np.array([[2.9, 0.2, 0.15], [2.9, 0.3, 0.15]]),
        pointing=pointing, blocked=Blocked.FAIL,
    )  # fmt: skip
    errors = ErrorBox(joint=float(np.deg2rad(joint_deg)))
    task = PlanningProblem(arm, Scene(WINDOW), path, 0.0035, name="look", errors=errors)
    found = planned(task)
    assert found.verification.verdict is Verdict.CERTIFIED
    (row,) = [check for check in found.verification.checks if check.name == NAME]
    reserve = AimError.of(pointing, arm, errors).axis
    assert largest_angle(task, found) <= pointing.cone - reserve
    assert row.worst <= pointing.cone


def test_a_cone_that_errors_use_up_is_refused_with_both_numbers() -> None:
    pointing = Pointing(float(np.deg2rad(3.0)), directions=AHEAD)
    task = replace(looking(pointing), errors=ErrorBox(joint=float(np.deg2rad(0.3))))
    with pytest.raises(NoPlanFound, match=r"by 3\.394° .* cone has 3\.000°"):
        planned(task)


def test_the_wish_makes_a_difference_and_the_same_plan_comes_again() -> None:
    """Without it the arm looks past the target by far more than the cone."""
    wide = Pointing(float(np.deg2rad(5.0)), directions=ASIDE)
    task = looking(wide)
    free = replace(task, tip_path=replace(task.path, pointing=None))
    assert largest_angle(task, planned(free)) > 2.0 * wide.cone
    one, two = planned(task).plan, planned(task).plan
    np.testing.assert_array_equal(one.trajectory.joints, two.trajectory.joints)


def test_links_share_a_turn_towards_an_aim() -> None:
    rng = np.random.default_rng(3)
    shapes = rng.normal(size=(500, 8, 3)) * 0.1 + np.array([1.0, 0.0, 0.0])
    shapes /= np.linalg.norm(shapes, axis=2, keepdims=True)
    aims = np.array([1.0, 0.3, 0.0]) + rng.normal(size=(500, 3)) * 0.1
    some = np.arange(500) % 2 == 0
    turned = turned_towards(shapes, aims, some, rng)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=2), 1.0, atol=1e-12)
    np.testing.assert_allclose(turned[~some], shapes[~some], atol=1e-12)
    assert np.median(angles_between(turned[some, -1], aims[some])) < 0.15


@pytest.mark.parametrize("seen", [True, False])
def test_the_second_way_in_ends_along_where_the_last_link_shall_look(
    seen: bool,
) -> None:
    task = looking(Pointing(np.deg2rad(3.0), directions=ASIDE))
    if not seen:
        task = replace(task, tip_path=replace(task.path, pointing=None))
    clearance = broad_phase(task, link_clearance(task))
    judge = Judge(task, clearance, 0.0, 3e-4, 2e-3)
    exact = replace(clearance, floor=-np.inf)
    space = TipSpace(task, exact, judge.required, 0.06, 60_000)
    rows = path_rows(task.path)
    route = tip_route(task, rows, np.zeros(len(rows.tips), np.bool_), 0.06, 0.0)
    level = Insert(population=10, routes=1, backtracks=2, seed=0, directed=True)
    search = insertion._Visits(judge, space, route, level)
    ways = list(search._routes(search.tips))
    aim = ASIDE[0] / np.linalg.norm(ASIDE[0])
    last = WELD[0] - np.linspace(0.0, ARM.link_lengths[-1], 5)[:, None] * aim
    along = [max(float(off_way(point, way)) for point in last) < 1e-9 for way in ways]
    assert along.count(True) == int(seen)
    assert along[1] == seen


def off_way(point: FloatArray, way: FloatArray) -> float:
    """Distance of a point from a polyline."""
    step = np.diff(way, axis=0)
    share = ((point - way[:-1]) * step).sum(axis=1) / (step**2).sum(axis=1)
    nearest = way[:-1] + share.clip(0.0, 1.0)[:, None] * step
    return float(np.linalg.norm(nearest - point, axis=1).min())
