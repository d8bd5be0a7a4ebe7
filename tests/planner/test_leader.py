"""Nose following: joints on the tip's curve, limits told, verdicts by the verifier."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.planner.spacing import stepped
from vdsm_pin.planner.tip_curve import led_along
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.verification.records import Verdict

ARM = built_in("hrm8")
NAME = "follow-the-leader"


def arc(radius: float, degrees: float) -> FloatArray:
    """A turn to the left from the rail's end, after the start."""
    turn = np.deg2rad(np.linspace(0.0, degrees, 40))
    return np.column_stack(
        [1.0 + radius * np.sin(turn), radius * (1.0 - np.cos(turn)), np.zeros(40)]
    )


def task(insertion: FloatArray, points: FloatArray, *balls: Sphere) -> PlanningProblem:
    path = DesiredPath(np.zeros(3), points, insertion=insertion)
    return PlanningProblem(ARM, Scene(balls), path, 0.0035, name="nose")


def from_line(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Distance of points, shape (n, 3), from a polyline, shape (n,); [m]."""
    a, side = corners[:-1], np.diff(corners, axis=0)
    size = (side**2).sum(axis=1)
    part = ((points[:, None] - a) * side).sum(axis=2) / size
    near = a + np.clip(part, 0.0, 1.0)[..., None] * side
    return np.asarray(np.linalg.norm(points[:, None] - near, axis=2).min(axis=1))


def test_joints_lie_on_the_tips_curve_and_the_motion_is_certified() -> None:
    way = arc(1.2, 60.0)
    ahead = way[-1] + np.outer([0.1, 0.3], [0.5, np.sqrt(0.75), 0.0])
    problem = task(way, ahead)
    found = plan_and_verify(problem, NAME)
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.verification.coverage == pytest.approx(1.0)
    curve = np.vstack([[-9.0, 0.0, 0.0], np.zeros(3), way, ahead])
    joints = found.plan.centres[:, 1:].reshape(-1, 3)
    assert from_line(joints, curve).max() < 1e-9
    again = plan_and_verify(problem, NAME).plan
    np.testing.assert_array_equal(again.centres, found.plan.centres)


def test_a_way_that_is_gone_back_is_left_along_the_same_curve() -> None:
    """Both ways are cut into rows by themselves, which differ in their last digits."""
    way = np.vstack([[-0.3, 0.0, 0.0], arc(1.2, 50.0)])
    points, _ = stepped(np.vstack([way, way[-2::-1]]), 0.01)
    half, start = len(points) // 2, np.zeros((ARM.n_links + 1, 3))
    start[:, 0] = points[0, 0] - ARM.total_length
    start[1:, 0] += np.cumsum(ARM.link_lengths)
    arms = led_along(points, start, ARM.link_lengths)
    assert (points[:half] != points[:half:-1]).any()
    np.testing.assert_allclose(arms[:half], arms[:half:-1], atol=1e-9)


def test_a_corner_too_sharp_names_the_joint_and_the_tip() -> None:
    """Square round a corner: a short link behind a long one bends by 90 deg."""
    insertion = np.array([[1.0, 0.0, 0.0], [1.0, 1.2, 0.0]])
    with pytest.raises(NoPlanFound, match=r"joint \d would bend by \d+\.\d°"):
        plan_and_verify(task(insertion, np.array([[1.0, 1.4, 0.0]])), NAME)


def test_a_rail_too_short_is_said() -> None:
    problem = task(np.zeros((0, 3)), np.array([[1.0, 0.0, 0.0]]))
    short = replace(ARM, base_range=(-4.0, -3.0))
    with pytest.raises(NoPlanFound, match="leave its rail"):
        plan_and_verify(replace(problem, manipulator=short), NAME)


def test_what_is_in_the_way_is_refused_not_handed_out() -> None:
    way = arc(1.2, 60.0)
    ball = Sphere("ball", way[20], 0.05)
    with pytest.raises(NoPlanFound, match="in one way alone") as refused:
        plan_and_verify(task(way[:-1], way[-1:], ball), NAME)
    (before,) = refused.value.more
    # There is no other motion: margins that grow lead to the same one.
    assert "round 1" in before and "round 2" not in before


def test_a_bent_start_is_left_along_its_own_curve() -> None:
    way = arc(1.2, 60.0)
    first = plan_and_verify(task(way[:-1], way[-1:]), NAME).plan
    row = first.trajectory.n_samples // 2
    joints, tip = first.trajectory.joints[row], first.centres[row, -1]
    rest = [p for p in way if p[0] > tip[0] + 0.05]
    path = DesiredPath(
        tip, np.array(rest[-1:]), start_joints=joints, insertion=np.array(rest[:-1])
    )
    problem = PlanningProblem(ARM, Scene(()), path, 0.0035, name="bent")
    found = plan_and_verify(problem, NAME)
    assert found.verification.verdict is Verdict.CERTIFIED
    np.testing.assert_allclose(found.plan.trajectory.joints[0], joints, atol=1e-12)
