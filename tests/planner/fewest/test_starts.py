"""Starts in any direction, arms of 2 to 40 links, bases anywhere."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scenes_for_fewest import problem

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres, link_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.errors import Infeasible, NoPlanFound, NoWayOut
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.io.problem_file import built_in_text, read_problem
from vdsm_pin.planner.fewest import explore
from vdsm_pin.planner.fewest.added_nodes import checked_start, with_start
from vdsm_pin.planner.fewest.charts import OFFSETS, Intervals, standing
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.roadmap import CostWeights, Roadmap
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.fewest.unbend import leans_ahead, unbend
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.planner.start import start_centres
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict, Verification
from vdsm_pin.verification.verify import verify

LENGTH = 3.126
POINTS = np.array([[3.126, 0.3, -0.2], [3.126, 0.8, -0.2], [3.126, 0.8, 0.6]])


def equal_links(count: int) -> Manipulator:
    limit = float(np.deg2rad(42.5))
    cables = CableLayout(0.01, 0.005, paper_hole_angles(count))
    lengths = np.full(count, LENGTH / count)
    radius = min(0.05, 0.3 * LENGTH / count)
    return Manipulator("equal", lengths, radius, limit, limit, (-5.0, 5.0), cables)


def starting(
    arm: Manipulator, alpha: FloatArray, theta: FloatArray, *obstacles: Obstacle
) -> PlanningProblem:
    centres = joint_centres(arm, np.array([0.2]), alpha[None], theta[None])[0]
    joints = np.concatenate([[0.2], np.stack([alpha, theta], axis=1).ravel()])
    task = problem(*obstacles, points=POINTS)
    path = replace(task.path, start=centres[-1], start_joints=joints)
    return replace(task, manipulator=arm, tip_path=path)


def judged(task: PlanningProblem) -> Verification:
    plan = plan_fewest(task, link_clearance(task), 0.0)
    start = plan.trajectory.joints[0]
    np.testing.assert_allclose(start, task.path.start_joints, atol=1e-9)
    return verify(task, plan.trajectory)


@pytest.mark.parametrize("count", [2, 3, 5, 13, 40])
def test_an_arm_of_any_number_of_links_starts_in_any_direction(count: int) -> None:
    rng = np.random.default_rng(count)
    arm, size = equal_links(count), min(0.5, 1.5 / np.sqrt(count))
    ball = Sphere("ball", np.array([1.9, -0.9, 0.6]), 0.2)
    for _ in range(2):
        alpha, theta = rng.uniform(-size, size, (2, count))
        task = starting(arm, alpha, theta, ball)
        result = judged(task)
        assert result.verdict is Verdict.CERTIFIED
        assert result.coverage == pytest.approx(1.0, abs=1e-9)


def test_a_start_bent_nearly_to_the_limit_is_not_taken_for_a_blocked_one() -> None:
    arm = equal_links(8)
    alpha = np.zeros(8)
    alpha[3] = 0.999 * arm.max_link_angle
    result = judged(starting(arm, alpha, np.zeros(8)))
    assert result.verdict is Verdict.CERTIFIED


@pytest.mark.parametrize("seed", range(3))
def test_an_arm_curled_backwards_unbends_and_draws(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm, turn = equal_links(8), rng.uniform(0.0, 2.0 * np.pi)
    alpha, theta = np.full(8, 0.5 * np.cos(turn)), np.full(8, 0.5 * np.sin(turn))
    task = starting(arm, alpha, theta)
    centres = joint_centres(arm, np.array([0.2]), alpha[None], theta[None])[0]
    assert (np.diff(centres[:, 0]) < 0.0).any()
    assert not leans_ahead(task)
    result = judged(task)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)


def test_unbending_keeps_limits_and_clearance_and_gives_up_where_it_cannot() -> None:
    arm = equal_links(8)
    alpha = np.full(8, 0.5)
    ahead = Sphere("ball", np.array([2.3, 0.8, 0.0]), 0.25)
    task = starting(arm, alpha, np.zeros(8), ahead)
    clearance = link_clearance(task)
    rows = unbend(task, clearance, 0.0)
    fine = np.concatenate([
        a + np.linspace(0.0, 1.0, 9)[:, None] * (b - a)
        for a, b in itertools.pairwise(rows)
    ])  # fmt: skip
    centres = joint_centres(arm, fine[:, 0], fine[:, 1::2], fine[:, 2::2])
    assert clearance(centres).min() >= task.required_clearance
    psi = link_angles(fine[:, 1::2], fine[:, 2::2])
    assert psi.max() <= arm.max_link_angle
    assert leans_ahead(
        replace(task, tip_path=replace(task.path, start_joints=rows[-1]))
    )

    def never(centres: FloatArray) -> FloatArray:
        clearances = np.full(centres[:, 1:, 0].shape, -1.0)
        clearances[(centres == joint_centres(arm, rows[:1, 0], rows[:1, 1::2],
              rows[:1, 2::2])).all(axis=(1, 2))] = 1.0  # fmt: skip
        return clearances

    with pytest.raises(NoPlanFound, match="backwards"):
        unbend(task, never, 0.0)


def test_a_problem_moved_as_a_whole_has_the_same_plan(tmp_path: Path) -> None:
    text = built_in_text("paper/obs3")
    data = yaml.safe_load(text)
    rpy, shift = np.array([20.0, -35.0, 110.0]), np.array([500.0, -300.0, 1200.0])
    R = rotation_from_rpy(np.deg2rad(rpy))
    moved = dict(data, base={"position": shift.tolist(), "rpy_deg": rpy.tolist()})
    moved["tip_path"] = dict(data["tip_path"])
    for key in ("start", "points"):
        values = np.array(data["tip_path"][key], dtype=float)
        moved["tip_path"][key] = (values @ R.T + shift).tolist()
    here = read_problem("paper/obs3")
    given = dict(data["obstacles"][0])
    given["center"] = (R @ np.array(given["center"], float) + shift).tolist()
    given["axis"] = R[:, 2].tolist()
    moved["obstacles"] = [given]
    path = tmp_path / "moved.yaml"
    path.write_text(yaml.safe_dump(moved), encoding="utf-8")
    there = read_problem(path)
    plans = [plan_fewest(task, link_clearance(task), 0.0) for task in (here, there)]
    one, other = (plan.trajectory for plan in plans)
    # Rounding may put one row more into a turn.
    assert abs(one.n_samples - other.n_samples) <= 3
    np.testing.assert_allclose(one.joints[-1], other.joints[-1], atol=1e-6)
    result = verify(there, other)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)


def test_a_start_that_is_left_by_a_finer_search_alone_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried: list[Judge] = []

    def seldom(
        judge: Judge, roadmap: Roadmap, weights: CostWeights
    ) -> tuple[Roadmap, int]:
        tried.append(judge)
        if len(tried) < needed:
            raise NoWayOut
        return with_start(judge, roadmap, weights)

    monkeypatch.setattr(explore, "with_start", seldom)
    task, needed = problem(), 2
    plan = plan_fewest(task, link_clearance(task), 0.0)
    assert plan.trajectory.on_path.any()
    assert len(tried) == 2
    needed = 1000
    monkeypatch.setattr(explore, "insert", lambda *_: (None, None))
    with pytest.raises(NoWayOut, match="out of the start"):
        plan_fewest(task, link_clearance(task), 0.0)


def test_the_papers_rule_starts_with_a_straight_arm_only() -> None:
    arm, alpha, theta = equal_links(4), np.zeros(4), np.zeros(4)
    theta[0] = 0.1
    leaning = starting(arm, alpha, theta)
    plan = plan_paper(leaning, link_clearance(leaning), 0.0)
    verified = verify(leaning, plan.trajectory)
    assert verified.verdict is Verdict.CERTIFIED
    theta[2] = 0.1
    bent = starting(arm, alpha, theta)
    with pytest.raises(NoPlanFound, match="starts bent"):
        plan_paper(bent, link_clearance(bent), 0.0)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_short_arm_with_every_way_blocked_is_refused_in_words(count: int) -> None:
    arm = equal_links(count)
    ball = Sphere("ball", np.array([1.5, 0.0, 0.0]), 0.6)
    task = replace(problem(ball, points=POINTS), manipulator=arm)
    with pytest.raises(Infeasible, match="ball"):
        plan_fewest(task, link_clearance(task), 0.0)


@pytest.mark.parametrize("axis", ["alpha", "theta"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("joint", range(0, 8, 3))
def test_a_start_bent_as_far_as_may_be_moves_no_less_judged(
    axis: str, sign: float, joint: int
) -> None:
    """In most of these the limit is passed by 1e-16 rad, and nothing was asked then."""
    angles = {"alpha": np.zeros(8), "theta": np.zeros(8)}
    angles[axis][joint] = sign * built_in("hrm8").max_link_angle
    task = starting(built_in("hrm8"), angles["alpha"], angles["theta"])
    centres = start_centres(task)
    straight = np.zeros((1, 9, 2))
    middle = (centres[-1] + centres[0] + [task.manipulator.total_length, 0, 0]) / 2.0
    ball = Sphere("ball", middle, 0.05)
    for blocked in (False, True):
        held = replace(task, scene=Scene((ball,) if blocked else ()))
        judge = Judge(held, link_clearance(held), 0.0, 1e-4, 1e-3)
        tip = centres[None, -1]
        offsets = checked_start(judge, tip, OFFSETS)[None]
        clearances = judge.look(tip, offsets).clearances
        assert (clearances > 0.01).all()
        there = middle[None] + (middle - tip[0])
        swing = Intervals(tip, there, offsets, straight)
        assert judge.clear(swing, judge.needed_from(clearances)).all() == (not blocked)


def test_no_start_that_breaks_a_limit_is_asked_for_less() -> None:
    task = problem()
    judge = Judge(task, link_clearance(task), 0.0, 0.0, 1e-3)
    needed = judge.needed_from(np.array([-np.inf, -0.01, 0.001, 1.0]))
    np.testing.assert_array_equal(needed, [0.0035, -0.01, 0.001, 0.0035])


def test_a_start_at_the_end_of_the_rail_is_on_it() -> None:
    """From the tip x0 comes out as -4e-16: the roadmap lost its first node."""
    arm = replace(built_in("hrm8"), base_range=(0.0, 5.0))
    for tip in ([3.126, 0.0, 0.0], [np.sqrt(3.126**2 - 0.13), 0.3, -0.2]):
        task = replace(problem(points=POINTS, start=tuple(tip)), manipulator=arm)
        far = Sphere("ball", np.array([2.0, -2.0, 0.0]), 0.1)
        task = replace(task, scene=Scene((far,)))
        plan = plan_fewest(task, link_clearance(task), 0.0)
        assert verify(task, plan.trajectory).verdict is Verdict.CERTIFIED
        assert abs(plan.trajectory.x0[0]) < 1e-9


@pytest.mark.parametrize("start", [(20.0, 0.0, 0.0), (3.126, 3.2, 0.0)])
def test_a_start_beyond_rail_or_reach_is_named(start: tuple[float, ...]) -> None:
    task = problem(start=start)
    expected = (
        r"x0 is 16\.8740 m, the limit is" if start[0] > 10 else "beyond the reach"
    )
    with pytest.raises(Infeasible, match=expected):
        plan_fewest(task, link_clearance(task), 0.0)


@pytest.mark.parametrize("past", [-4.7e-10, 4.7e-10])
def test_a_straight_arm_stands_a_rounding_past_the_end_of_its_rail(past: float) -> None:
    """No turn of its links would bring it back; more than a rounding is refused."""
    arm = replace(built_in("hrm8"), base_range=(0.0, 0.0))
    straight = np.tile([1.0, 0.0, 0.0], (1, arm.n_links, 1))
    tip = np.array([[arm.total_length + past, 0.0, 0.0]])
    centres = standing(arm, tip, straight)
    assert (centres[0, 0] == 0.0).all()
    np.testing.assert_allclose(centres[0, 1:, 0], arm.stations[1:], atol=1e-9)
    beyond = np.array([[arm.total_length + 1e-8, 0.0, 0.0]])
    assert np.isnan(standing(arm, beyond, straight)).all()
