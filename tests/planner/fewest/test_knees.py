"""Knees of a motion: how they are counted, and that few are looked for."""

from pathlib import Path

import numpy as np
import pytest
from scenes_for_fewest import problem

from benchmarks.hrm1000.generate import generate
from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest.explore import explore
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.smoothing import mean_knees, shortcut
from vdsm_pin.planner.fewest.strategy import FEWEST, plan_fewest
from vdsm_pin.report.motion_facts import motion_facts
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance


def test_knees_are_those_of_either_end_by_the_length_drawn() -> None:
    task = problem()
    arm = task.manipulator
    quick = broad_phase(task, link_clearance(task))
    judge = Judge(task, quick, 0.0, 1e-4, 1e-3)
    # Arms along the rail but for single joints moved aside: each such joint is bent,
    # and both of its neighbours are.
    offsets = np.zeros((4, arm.n_links + 1, 2))
    offsets[0, 3, 0] = offsets[1, 4, 0] = offsets[2, 3, 0] = 0.05
    tips = np.zeros((4, 3))
    stations, drawn = np.array([0.0, 3.0, 3.0, 4.0]), np.array([True, False, True])
    corners = Corners(tips, offsets, stations, drawn)
    # Joints 3 to 5 and 4 to 6 over 3 m, 3 to 5 and none over 1 m.
    assert mean_knees(judge, corners) == pytest.approx((3.0 * 4 + 1.0 * 3) / 4.0)
    resting = Corners(tips, offsets, stations, ~drawn & False)
    assert mean_knees(judge, resting) == pytest.approx((4 + 4 + 3) / 3.0)


def test_obs3_changes_two_link_angles_at_most() -> None:
    """Its knees change where psi_5 alone is bent, or where the arm is straight."""
    task = read_problem("paper/obs3")
    plan = plan_fewest(task, link_clearance(task), 0.0)
    angles = link_angles(plan.trajectory.alpha, plan.trajectory.theta)
    changed = (angles > TOLERANCES.changed_angle).sum(axis=1)[plan.trajectory.on_path]
    assert changed.max() == 2
    assert changed.mean() < 1.44
    facts = motion_facts(task, plan.trajectory)
    assert facts.changed_angles_mean_on_path == pytest.approx(1.4035, abs=5e-4)


@pytest.mark.parametrize("name", ["paper/obs1", "paper/obs2", "paper/obs3"])
def test_shortcuts_bend_no_more_joints_and_leave_no_larger_angle(name: str) -> None:
    """By the length drawn, between corners too, as `mean_knees` counts them."""
    task = read_problem(name)
    *_, outcome = explore(task, broad_phase(task, link_clearance(task)), 0.0, FEWEST)
    assert outcome.found is not None
    judge, before = outcome.judge, outcome.found.corners
    after = shortcut(judge, before, FEWEST)
    assert mean_knees(judge, after) <= mean_knees(judge, before) + 1e-3
    largest = [judge.bends(one.tips, one.offsets).max() for one in (after, before)]
    assert largest[0] <= max(largest[1], FEWEST.easy_bend)


def test_an_insertion_of_many_knees_leaves_the_roadmap_its_turn(tmp_path: Path) -> None:
    task = read_problem(generate(tmp_path, "prismatic_x", 24))
    plan = plan_fewest(task, link_clearance(task), 0.0)
    knees = motion_facts(task, plan.trajectory).changed_angles_mean_on_path
    assert not plan.undrawn
    # An insertion alone draws it with 4.
    assert knees < 1.5
