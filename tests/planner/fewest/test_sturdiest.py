"""Oracle: the verifier, which knows nothing of how a plan was made."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scenes_for_fewest import problem, random_problem, straight_arm

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.solids import Cylinder, Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.fewest.charts import Intervals
from vdsm_pin.planner.fewest.judge import Judge, levers, link_margins
from vdsm_pin.planner.fewest.roadmap import CostWeights, build_roadmap, link_by_link
from vdsm_pin.planner.fewest.route import tip_route
from vdsm_pin.planner.fewest.shapes import one_knee_shapes
from vdsm_pin.planner.fewest.strategy import (
    plan_clearest,
    plan_fewest,
    plan_sturdiest,
)
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.robust import largest_joint_error
from vdsm_pin.verification.verify import verify

ARM = built_in("hrm8")


def survived(task: PlanningProblem, plan: Plan) -> float:
    return largest_joint_error(task, plan.trajectory, ErrorBox())


def short(name: str) -> PlanningProblem:
    """A paper scene with a short piece of its path, to keep the test quick."""
    task = read_problem(f"paper/{name}")
    points = np.array([[3.126, 0.9, 0.9], [3.126, 1.0, 1.0]])
    return replace(task, tip_path=replace(task.path, points=points, closed=False))


def test_a_lever_is_how_far_the_end_of_a_link_moves_as_all_joints_turn() -> None:
    turn, still = 1e-6, np.zeros((1, ARM.n_links))
    moved = joint_centres(ARM, np.zeros(1), still, still + turn)[0]
    np.testing.assert_allclose(
        np.linalg.norm(moved[1:, 1:], axis=1), turn * levers(ARM), rtol=1e-9
    )
    kept = link_margins(ARM, 0.01)
    assert kept is not None
    np.testing.assert_array_equal(kept, 0.01 * levers(ARM))
    assert link_margins(ARM, 0.0) is None


@pytest.mark.parametrize("knees", [[], [3], [5, 5], [1, 7], [0, 4]])
def test_corners_give_back_every_joint(knees: list[int]) -> None:
    rng = np.random.default_rng(len(knees))
    alpha, theta = np.zeros((20, 8)), np.zeros((20, 8))
    for joint in (0, *knees):  # joint 1 turns the whole arm
        alpha[:, joint], theta[:, joint] = rng.uniform(-0.4, 0.4, (2, 20))
    centres = joint_centres(ARM, rng.uniform(-1.0, 1.0, 20), alpha, theta)
    corners = centres[:, [0, *knees, 8]]
    np.testing.assert_allclose(
        link_by_link(corners, ARM.stations), centres, rtol=0, atol=1e-14
    )


def test_each_link_keeps_its_own() -> None:
    """Judge and graph say what the clearance function says of whole arms, less that."""
    task = problem(
        Sphere("ball", np.array([2.0, 0.5, 0.3]), 0.2),
        Cylinder("bar", np.array([1.0, -0.6, 0.0]), np.array([0.0, 0, 1]), 2.0, 0.1),
    )
    clearance, weights = link_clearance(task), CostWeights(joint_error=0.01)
    kept = link_margins(ARM, weights.joint_error)
    rows = path_rows(task.path)
    route = tip_route(task, rows, np.zeros(len(rows.tips), dtype=np.bool_), 0.2, 0.0)
    shapes = one_knee_shapes(ARM, ARM.max_link_angle, 0.2, 8)
    judge = Judge(task, clearance, 0.0, 0.0, 2e-3, link_margins=kept)
    bare = Judge(task, clearance, 0.0, 0.0, 2e-3)
    made, free = (build_roadmap(one, weights, route, shapes) for one in (judge, bare))
    tip, shape = np.divmod(free.node, shapes.size)
    tips = route.tips[tip]
    offsets = shapes.offsets(ARM, tips, shape)
    place, share = np.arange(len(tips)), np.zeros(len(tips))
    centres = Intervals(tips, tips, offsets, offsets).centres(ARM, place, share)
    expected = (clearance(centres) - kept).min(axis=1)
    np.testing.assert_allclose(judge.look(tips, offsets)[0], expected, atol=1e-9)
    enough = expected >= judge.required
    assert 0.5 < enough.mean() < 0.99
    np.testing.assert_array_equal(made.node, free.node[enough])


@pytest.mark.parametrize(("seed", "clutter"), [(0, False), (0, True)])
def test_what_is_claimed_is_certified_and_no_less_than_the_others(
    seed: int, clutter: bool
) -> None:
    hold_to_account(random_problem(seed, clutter=clutter))


@pytest.mark.slow
@pytest.mark.parametrize("clutter", [False, True])
@pytest.mark.parametrize("seed", range(1, 12))
def test_the_same_on_many_scenes(seed: int, clutter: bool) -> None:
    hold_to_account(random_problem(seed, clutter=clutter))


def hold_to_account(task: PlanningProblem) -> None:
    clearance = link_clearance(task)
    plan = plan_and_verify(task, "sturdiest").plan
    error = survived(task, plan)
    for other in (plan_fewest, plan_clearest):
        assert error >= survived(task, other(task, clearance, 0.0))
    told = re.search(r"off by ±(\S+)° at once \(proved\)", plan.notes[-1])
    assert told is not None
    assert 0.0 <= np.rad2deg(error) - float(told[1]) < 1e-3, "rounded down"
    below = ErrorBox(joint=error - TOLERANCES.joint_error)
    result = verify(task.under(below), plan.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)
    above = verify(task.under(replace(below, joint=3.0 * error)), plan.trajectory)
    assert above.verdict is not Verdict.CERTIFIED
    lost = re.search(r"start itself does not survive ±(\S+)°", plan.notes[-1])
    if lost is not None:
        box = ErrorBox(joint=np.deg2rad(float(lost[1])))  # rounded up
        alone = verify(task.under(box), plan.trajectory.part(0, 1))
        assert alone.counterexamples  # a configuration within the box that is too near


@pytest.mark.slow
def test_room_that_grows_along_the_arm_is_worth_more_than_the_same_everywhere() -> None:
    task = random_problem(1, clutter=True)
    clearance = link_clearance(task)
    plan = plan_sturdiest(task, clearance, 0.0)
    most = max(survived(task, one) for one in (plan, *plan.rivals))
    assert most > 1.5 * survived(task, plan_clearest(task, clearance, 0.0))


def test_two_runs_give_the_same_plan_and_the_same_rivals() -> None:
    task = short("obs3")
    clearance = link_clearance(task)
    first, second = (plan_sturdiest(task, clearance, 0.0) for _ in range(2))
    assert len(first.rivals) == len(second.rivals) > 1
    for one, other in zip(
        (first, *first.rivals), (second, *second.rivals), strict=True
    ):
        np.testing.assert_array_equal(one.trajectory.joints, other.trajectory.joints)
        assert one.notes == other.notes


def test_without_obstacles_the_fewest_knees_will_do() -> None:
    task = problem()
    plan = plan_and_verify(task, "sturdiest").plan
    assert plan.strategy == "sturdiest"
    np.testing.assert_allclose(
        plan.centres[:1], straight_arm(task, task.path.start[None]), atol=1e-12
    )
