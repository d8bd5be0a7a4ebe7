"""Sentences of the paper that hold, each as a test of plans or of the arm."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.along_rail import AlongRail
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.verification.link_clearance import link_clearance

FREE = read_problem("paper/free")


def free_plan(*corners: tuple[float, float, float]) -> Plan:
    path = DesiredPath(FREE.path.start, np.array(corners), spacing=0.01, retreat=0.0)
    problem = replace(FREE, tip_path=path)
    return plan_paper(problem, link_clearance(problem), 0.0)


def test_the_base_changes_before_the_first_joint_and_this_before_all_others() -> None:
    """Section 3.5: "the previous degrees of freedom are changed in priority"."""
    along = free_plan((3.4, 0.0, 0.0)).trajectory
    assert np.ptp(along.x0) == pytest.approx(0.274)
    assert np.abs([along.alpha, along.theta]).max() < 1e-12
    across = free_plan((3.1, 0.8, -0.7)).trajectory
    psi = link_angles(across.alpha, across.theta)
    assert psi[:, 0].max() > 0.3
    assert psi[:, 1:].max() < 1e-7


def test_27_less_3i_cables_run_through_link_i() -> None:
    """Section 5.2: three for each link from i on, of which three drive link i."""
    arm, rng = built_in("hrm8"), np.random.default_rng(3)
    still = np.zeros((1, 8))
    rest = cable_lengths(arm, still, still)
    for i in range(1, 9):
        bent = still.copy()
        bent[0, i - 1] = rng.uniform(0.1, 0.5)
        moved = cable_lengths(arm, bent, still) - rest
        assert np.count_nonzero(np.abs(moved) > 1e-9) == 27 - 3 * i


def test_the_tip_leaves_and_joins_the_path_where_the_region_crosses_it() -> None:
    """Section 4.2.3: A4 and A5 of obs1, with a region that reaches the path."""
    problem = read_problem("paper/obs1")
    problem = replace(problem, required_clearance=0.010)
    plan = plan_paper(problem, link_clearance(problem), 0.0)
    assert plan.steps is not None
    assert isinstance(plan.steps.avoidance, AlongRail)
    region = plan.steps.avoidance.region
    drawn = plan.trajectory.on_path.astype(int)
    leaves = int(np.argmin(np.diff(drawn)))
    joins = leaves + 1 + int(np.argmax(np.diff(drawn)[leaves:]))
    for row in (leaves, joins):
        _, y, z = plan.centres[row, -1]
        assert y == pytest.approx(1.0)
        assert np.hypot(y - 0.7, z - 0.6) == pytest.approx(region.radius, abs=1e-6)
    psi = np.rad2deg(link_angles(plan.trajectory.alpha, plan.trajectory.theta))
    # In whole degrees, as printed.
    assert set(np.flatnonzero(np.rint(psi[leaves])) + 1) == {1, 7, 8}
    assert set(np.flatnonzero(np.rint(psi[joins])) + 1) == {1, 4, 5, 6, 7, 8}
