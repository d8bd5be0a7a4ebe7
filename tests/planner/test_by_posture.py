"""Paths of arms that cannot be fed: in joint space to where the path begins."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres, link_angles, row_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.solids import Box, Sphere
from vdsm_pin.planner.by_posture import with_postures
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.postures import brought_to, random_postures
from vdsm_pin.planner.records import LinkClearance, Plan
from vdsm_pin.planner.rrt_connect import connected
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

ARM = replace(built_in("hrm8"), base_range=(0.0, 0.0))
LENGTH = ARM.total_length
TIP = np.array([0.9 * LENGTH, 0.2 * LENGTH, 0.1 * LENGTH])
PILLAR = Box(
    "pillar",
    np.array([0.6, 0.09, -0.47]) * LENGTH,
    np.eye(3),
    np.array([0.05, 0.04, 0.5]) * LENGTH,
)


def task(*obstacles: Obstacle) -> PlanningProblem:
    start = np.array([LENGTH, 0.0, 0.0])
    path = DesiredPath(start, TIP + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]))
    return PlanningProblem(ARM, Scene(obstacles), path, 0.005)


@pytest.mark.parametrize("arm", [ARM, built_in("hrm8")], ids=["fixed", "rail"])
def test_tips_are_brought_to_their_place_within_all_limits(arm: Manipulator) -> None:
    rng = np.random.default_rng(1)
    rows, there = brought_to(arm, random_postures(arm, 200, rng), TIP)
    assert there.mean() > 0.5
    rows = rows[there]
    assert np.abs(row_centres(arm, rows)[:, -1] - TIP).max() <= 1e-12
    assert (link_angles(rows[:, 1::2], rows[:, 2::2]) <= arm.max_link_angle).all()
    assert (np.abs(rows[:, 1:]) <= arm.max_joint_angle).all()
    assert (rows[:, 0] >= arm.base_range[0]).all()
    assert (rows[:, 0] <= arm.base_range[1]).all()


def test_no_posture_brings_the_tip_out_of_reach() -> None:
    rows = random_postures(ARM, 50, np.random.default_rng(1))
    _, there = brought_to(ARM, rows, 1.01 * LENGTH * np.array([0.8, 0.6, 0.0]))
    assert not there.any()


def ends_of(problem: PlanningProblem, count: int = 3) -> np.ndarray:
    """Clear postures beyond the pillar."""
    rows, there = brought_to(
        ARM, random_postures(ARM, 400, np.random.default_rng(2)), TIP
    )
    spare = link_clearance(problem)(row_centres(ARM, rows)).min(axis=1) - 0.005
    return np.asarray(rows[there & (spare >= 0.0)][:count])


def test_a_connection_is_clear_everywhere_and_ends_as_asked() -> None:
    problem = task(PILLAR)
    ends, start = ends_of(problem), np.zeros(1 + 2 * ARM.n_links)
    assert len(ends) == 3
    rows = connected(problem, link_clearance(problem), start, ends, 0.005)
    assert rows is not None
    assert (rows[0] == start).all() and (rows[-1] == ends).all(axis=1).any()
    assert np.abs(np.diff(rows[:, 1:], axis=0)).max() <= problem.planned_row_change
    share = np.linspace(0.0, 1.0, 200)[:, None, None]
    between = ((1.0 - share) * rows[:-1] + share * rows[1:]).reshape(-1, rows.shape[1])
    assert link_clearance(problem)(row_centres(ARM, between)).min() >= 0.005
    angles = link_angles(between[:, 1::2], between[:, 2::2])
    assert angles.max() <= ARM.max_link_angle
    again = connected(problem, link_clearance(problem), start, ends, 0.005)
    np.testing.assert_array_equal(rows, again)


def test_nothing_leads_to_where_nobody_stands() -> None:
    problem = task(PILLAR)
    start = np.zeros(1 + 2 * ARM.n_links)
    assert (
        connected(problem, link_clearance(problem), start, start[None][:0], 0.005)
        is None
    )


def refusing_straight(asked: PlanningProblem, clearance: LinkClearance) -> Plan:
    """`fewest`, which gives up where the arm starts straight."""
    if asked.path.start_joints is None:
        message = "the arm starts straight"
        raise NoPlanFound(message)
    return plan_fewest(asked, clearance, 0.0)


def test_a_path_is_drawn_from_a_posture_where_it_is_not_from_the_start() -> None:
    problem = task(PILLAR)
    clearance = link_clearance(problem)
    plan = with_postures(problem, clearance, 0.005, refusing_straight)
    told = plan.trajectory
    assert not plan.undrawn and "joint space" in plan.notes[0]
    assert verify(problem, told).verdict is Verdict.CERTIFIED
    assert told.on_path.any() and not told.on_path[0]
    np.testing.assert_array_equal(told.joints[0], np.zeros(1 + 2 * ARM.n_links))
    np.testing.assert_array_equal(
        plan.centres, joint_centres(ARM, told.x0, told.alpha, told.theta)
    )


def test_why_there_is_no_plan_from_the_start_stays_the_answer() -> None:
    """The path begins in an obstacle: no posture is clear there."""
    problem = task(Sphere("ball", TIP, 0.2))
    with pytest.raises(NoPlanFound, match="starts straight"):
        with_postures(problem, link_clearance(problem), 0.005, refusing_straight)


@pytest.mark.parametrize(
    ("name", "arm", "through"),
    [
        ("fewest", ARM, True),
        ("follow-the-leader", ARM, False),
        ("fewest", built_in("hrm8"), False),
    ],
)
def test_only_arms_on_short_rails_and_free_ways_come_through_joint_space(
    name: str, arm: Manipulator, through: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []

    def noted(*_: object) -> Plan:
        asked.append(True)
        message = "none"
        raise NoPlanFound(message)

    monkeypatch.setattr("vdsm_pin.planner.goals.with_postures", noted)
    with suppress(NoPlanFound):
        plan_and_verify(replace(task(), manipulator=arm), name)
    assert bool(asked) is through
