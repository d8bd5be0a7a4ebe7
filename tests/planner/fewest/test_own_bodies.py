"""Arms whose own bodies can meet are planned so that they do not."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.geometry.solids import Box
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
    return PlanningProblem("cameras", arm, scene, path, 0.004, np.eye(4), errors=errors)


@pytest.mark.parametrize(("side", "y"), [(1.0, 0.6), (1.0, 0.8), (-1.0, 1.0)])
@pytest.mark.parametrize("joint", [0.0, 1e-3])
def test_cameras_keep_off_the_next_link(side: float, y: float, joint: float) -> None:
    found = plan_and_verify(asked(side, y, ErrorBox(joint)), "fewest")
    assert found.verification.verdict is Verdict.CERTIFIED


def test_a_line_in_joint_space_is_clear_of_own_bodies() -> None:
    problem = asked(1.0, 0.6, ErrorBox())
    far = lambda centres, _axes=None: np.full((len(centres), 8), 1.0)  # noqa: E731
    straight, bent = np.zeros(17), np.zeros(17)
    bent[7] = 0.72  # link 4 turns about z towards the camera on link 3
    assert clear_line(problem, far, straight, bent, 0.0) is None
    assert clear_line(problem, far, straight, -bent, 0.0) is not None
