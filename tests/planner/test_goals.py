"""Goals without a path, and ways home: planned, and proved by the verification."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some_slow import few_of

from benchmarks.hrm2000.passages import Hook
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidFile, NoPlanFound, OutOfTime, UnknownName
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box, Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.goals import with_ends, with_path
from vdsm_pin.planner.joint_lines import clear_line
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem, Posture
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.refinement import Refinement, plan_and_verify
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict

ARM = built_in("hrm8")
START = Posture(np.array([0.0, 0.0, 0.0]))


def wall(half: float) -> list[Obstacle]:
    """A wall across the rail with a square window on it."""
    spans = [
        ((-3, -half), (-3, 3)), ((half, 3), (-3, 3)),
        ((-half, half), (-3, -half)), ((-half, half), (half, 3)),
    ]  # fmt: skip
    return [
        Box(
            f"wall{n}", np.array([0.6, sum(y) / 2, sum(z) / 2]), np.eye(3),
            np.array([0.04, y[1] - y[0], z[1] - z[0]]) / 2,
        )
        for n, (y, z) in enumerate(spans)
    ]  # fmt: skip


def posture(joints: np.ndarray) -> Posture:
    """Where the arm stands at joint values."""
    row = joints[None]
    tip = joint_centres(ARM, row[:, 0], row[:, 1::2], row[:, 2::2])[0, -1]
    return Posture(tip, joints)


def to(goal: Posture, *obstacles: Obstacle, start: Posture = START) -> PlanningProblem:
    scene = Scene(tuple(obstacles))
    return PlanningProblem(
        ARM, scene, None, 0.0035, name="goal", start=start, goal=goal
    )


def planned(task: PlanningProblem, name: str = "fewest") -> Refinement:
    found = plan_and_verify(task, name)
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.plan.problem is task
    assert not found.plan.trajectory.on_path.any()
    return found


def bent(*turns: float) -> np.ndarray:
    """Joint values with the last joints turned, behind the wall."""
    joints = np.zeros(1 + 2 * ARM.n_links)
    joints[0] = 1.5 - ARM.total_length
    joints[-len(turns) :] = turns
    return joints


@pytest.mark.parametrize("strategy", few_of(["fewest", "clearest", "sturdiest"], 2))
def test_the_tip_is_brought_through_a_window_to_its_goal(strategy: str) -> None:
    goal = np.array([1.4, 0.1, 0.15])
    told = planned(to(Posture(goal), *wall(0.12)), strategy).plan.trajectory
    last = told.joints[-1:]
    tip = joint_centres(ARM, last[:, 0], last[:, 1::2], last[:, 2::2])[0, -1]
    np.testing.assert_allclose(tip, goal, atol=1e-6)


@pytest.mark.parametrize(
    "turns",
    [
        (0.4, 0.0, 0.3, 0.2),
        pytest.param((0.1, -0.5, 0.0, 0.5, 0.5, 0.0), marks=pytest.mark.slow),
    ],
)
def test_joint_values_are_come_to_from_straight_and_back(
    turns: tuple[float, ...],
) -> None:
    """In and, with the same goal as a start, out again to joint values of zero."""
    goal = posture(bent(*turns))
    into = planned(to(goal, *wall(0.12))).plan.trajectory
    np.testing.assert_allclose(into.joints[-1], goal.joints, atol=1e-9)
    zero = np.zeros(1 + 2 * ARM.n_links)
    zero[0] = -ARM.total_length
    out = planned(to(posture(zero), *wall(0.12), start=goal)).plan.trajectory
    np.testing.assert_allclose(out.joints[0], goal.joints, atol=1e-9)
    np.testing.assert_allclose(out.joints[-1], zero, atol=1e-9)


def test_joint_values_behind_a_core_are_come_to_as_their_own_curve_leads() -> None:
    """All joints bent by 105 deg in sum, and little room; again the same plan."""
    made = Hook(105.0)(np.random.default_rng(3), ARM)
    motion, centres = made.witness.motion, made.witness.centres
    start, goal = Posture(centres[0, -1]), Posture(centres[-1, -1], motion.joints[-1])
    told, again = (
        planned(to(goal, *made.obstacles, start=start)).plan.trajectory
        for _ in range(2)
    )
    np.testing.assert_allclose(told.joints[-1], motion.joints[-1], atol=1e-9)
    np.testing.assert_array_equal(told.joints, again.joints)


def test_the_way_there_has_time_where_the_way_back_had_too_little() -> None:
    goal = posture(bent(0.4, 0.0, 0.3, 0.2))
    task, tried = to(goal, *wall(0.12)), list[FloatArray]()

    def plan_with(asked: PlanningProblem, *given: Any) -> Plan:
        tried.append(asked.path.start)
        if len(tried) == 1:
            raise OutOfTime(0.5)
        return plan_fewest(asked, *given)

    found = with_ends(task, plan_with)(with_path(task), link_clearance(task), 0.0)
    np.testing.assert_allclose(tried, [goal.tip, START.tip])
    np.testing.assert_allclose(found.trajectory.joints[-1], goal.joints, atol=1e-9)


def test_a_goal_in_an_obstacle_is_refused_and_says_from_which_end() -> None:
    goal = posture(bent(0.4, 0.3))
    ball = Sphere("ball", goal.tip, 0.1)
    with pytest.raises(NoPlanFound) as refused:
        plan_and_verify(to(goal, ball), "fewest")
    assert "planned back from the goal" in str(refused.value)
    assert "'ball'" in str(refused.value)


def test_the_arm_goes_home_the_way_it_came() -> None:
    points = np.array([[1.4, 0.0, 0.0], [1.4, 0.1, 0.1]])
    path = DesiredPath(START.tip, points, home=True)
    scene = Scene(tuple(wall(0.12)))
    task = PlanningProblem(ARM, scene, path, 0.0035, name="home")
    found = plan_and_verify(task, "fewest")
    there = plan_and_verify(replace(task, tip_path=replace(path, home=False)), "fewest")
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.verification.coverage == pytest.approx(1.0)
    rows, first = found.plan.trajectory, there.plan.trajectory
    count = first.n_samples
    np.testing.assert_array_equal(rows.joints[:count], first.joints)
    np.testing.assert_array_equal(rows.joints[count - 1 :], first.joints[::-1])
    assert not rows.on_path[count:].any()
    assert any("goes home" in note for note in found.plan.notes)


def test_a_line_in_joint_space_is_clear_all_along_or_none() -> None:
    task = to(START, Sphere("ball", np.array([-1.0, 0.25, 0.0]), 0.1))
    rng = np.random.default_rng(0)
    clearance, found = link_clearance(task), 0
    for _ in range(60):
        ends = rng.uniform(-0.15, 0.15, (2, 1 + 2 * ARM.n_links))
        ends[:, 0] -= ARM.total_length
        rows = clear_line(task, clearance, *ends, 0.0035)
        share = np.linspace(0.0, 1.0, 2001)[:, None]
        every = (1.0 - share) * ends[0] + share * ends[1]
        centres = joint_centres(ARM, every[:, 0], every[:, 1::2], every[:, 2::2])
        least = float(clearance(centres).min())
        if rows is None:
            assert least < 0.0045
            continue
        found += 1
        assert least >= 0.0035 - 1e-9
        np.testing.assert_array_equal(rows[[0, -1]], ends)
        assert np.abs(np.diff(rows[:, 1:], axis=0)).max() <= task.planned_row_change
    assert 5 < found < 55


FILE = """
vdsm_problem: 1
length_unit: mm
manipulator: hrm8
tip_path:
  start: [0, 0, 0]
  points: [[1400, 0, 0]]
  retreat: {retreat}
required_clearance: 3.5
"""


def test_home_is_a_word_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(FILE.format(retreat="home"))
    path = read_problem(file).path
    assert (path.home, path.retreat) == (True, 0.0)
    file.write_text(FILE.format(retreat="100"))
    path = read_problem(file).path
    assert (path.home, path.retreat) == (False, pytest.approx(0.1))
    file.write_text(FILE.format(retreat="house"))
    with pytest.raises(InvalidFile, match="home"):
        read_problem(file)


def test_an_unknown_strategy_is_refused_for_a_goal_too() -> None:
    with pytest.raises(UnknownName):
        plan_and_verify(to(START), "luck")
