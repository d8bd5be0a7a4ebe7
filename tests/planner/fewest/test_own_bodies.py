"""Arms whose own bodies can meet are planned so that they do not."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box
from vdsm_pin.planner.fewest.charts import OFFSETS, Intervals
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.joint_lines import clear_line
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.verification.records import Verdict

HRM8 = built_in("hrm8")
WALL = Box("wall", np.array([2.0, 0.55, 0.0]), np.eye(3), np.array([0.4, 0.2, 0.4]))


def with_cameras(side: float) -> Manipulator:
    """A camera beside the end of each link, which the next one must not bend into."""
    ends = [np.array([x - 0.06, side * 0.1, 0.0]) for x in HRM8.link_lengths[:7]]
    size = np.array([0.05, 0.03, 0.03])
    boxes = [Box(f"camera {k}", end, np.eye(3), size) for k, end in enumerate(ends, 1)]
    bodies = tuple(LinkBody(k, box) for k, box in enumerate(boxes, 1))
    return replace(HRM8, bodies=bodies)


def asked(side: float, y: float, errors: ErrorBox) -> PlanningProblem:
    points = np.array([[3.0, y, 0.0], [3.0, y + 0.1, 0.2]])
    path = DesiredPath(np.array([2.6, 0.0, 0.0]), points)
    arm, scene = with_cameras(side), Scene((WALL,))
    return PlanningProblem(arm, scene, path, 0.004, name="cameras", errors=errors)


@pytest.mark.parametrize(("side", "y"), [(1.0, 0.6), (1.0, 0.8), (-1.0, 1.0)])
@pytest.mark.parametrize("joint", [0.0, 1e-3])
def test_cameras_keep_off_the_next_link(side: float, y: float, joint: float) -> None:
    found = plan_and_verify(asked(side, y, ErrorBox(joint)), "fewest")
    assert found.verification.verdict is Verdict.CERTIFIED


def chart_lines(
    arm: Manipulator, begin: FloatArray, end: FloatArray
) -> tuple[Intervals, FloatArray]:
    """The straight line in the chart between joint values, and its ends' centres."""
    rows = np.stack([begin, end])
    centres = joint_centres(arm, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
    offsets, tips = OFFSETS.coordinates(arm, centres), centres[:, -1]
    return Intervals(tips[:1], tips[1:], offsets[:1], offsets[1:]), centres


def far_off(centres: FloatArray, _axes: object = None, /) -> FloatArray:
    return np.full((len(centres), centres.shape[1] - 1), 1.0)


def test_a_start_near_a_wall_gives_own_bodies_nothing() -> None:
    """What ways may lack towards obstacles, own bodies must keep all the same."""
    problem = asked(1.0, 0.6, ErrorBox())
    judge = Judge(problem, far_off, 0.0, 3e-4, 2e-3)
    bent = np.zeros(17)
    bent[7] = 0.72
    into, _ = chart_lines(problem.manipulator, np.zeros(17), bent)
    away, _ = chart_lines(problem.manipulator, np.zeros(17), -bent)
    for lacking in (0.0, 0.01):
        need = np.array([judge.required - lacking])
        assert not judge.clear(into, need)[0]
        assert judge.clear(away, need)[0]
    assert judge.look(into.next_tips, into.next_offsets).clearances[0] == -np.inf
    assert judge.look(away.next_tips, away.next_offsets).clearances[0] == 1.0


def test_a_start_whose_own_bodies_lack_something_is_left() -> None:
    """It stands as far apart as required, and not as far as errors may take."""
    problem = asked(1.0, 0.6, ErrorBox())
    arm, begin, nearer = problem.manipulator, np.zeros(17), np.zeros(17)
    begin[7], nearer[7] = 0.6, 0.62
    spare = problem.own_pairs.spare(begin[None, 1::2], begin[None, 2::2]).min()
    assert 0.0 < spare < 0.01
    path = replace(problem.path, start_joints=begin)
    needs = spare + 1e-3
    near = replace(problem, tip_path=path, required_self_clearance=needs)
    judge = Judge(near, far_off, 0.0, 3e-4, 2e-3)
    need = np.array([judge.required])
    out, _ = chart_lines(arm, begin, np.zeros(17))
    assert judge.clear(out, need)[0]
    assert judge.look(out.tips, out.offsets).clearances[0] == 1.0
    assert not judge.clear(chart_lines(arm, begin, nearer)[0], need)[0]
    assert not judge.clear(chart_lines(arm, 0.99 * begin, np.zeros(17))[0], need)[0]


def test_a_line_in_joint_space_is_clear_of_own_bodies() -> None:
    problem = asked(1.0, 0.6, ErrorBox())
    straight, bent = np.zeros(17), np.zeros(17)
    bent[7] = 0.72  # link 4 turns about z towards the camera on link 3
    assert clear_line(problem, far_off, straight, bent, 0.0) is None
    assert clear_line(problem, far_off, straight, -bent, 0.0) is not None
