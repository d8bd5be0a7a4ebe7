"""The paper's rule plans alike whatever the size of an arm and its scene."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.other_sizes import scaled

from vdsm_pin.app.problems import read_problem
from vdsm_pin.geometry.solids import Box, Cylinder
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.link_clearance import link_clearance

ALONG = np.array([1.0, 0.0, 0.0])


def cylinder(y: float, z: float, radius: float) -> Obstacle:
    return Cylinder("long", np.array([1.563, y, z]), ALONG, 4.5, radius)


def box(y: float, z: float, width: float, height: float) -> Obstacle:
    half = np.array([4.5, width, height])
    return Box("long", np.array([1.563, y, z]), np.eye(3), half)


# In metres, wider ways, rows and reserves were others for each of these.
SCENES = [
    box(-0.376, 0.749, 0.176, 0.159),
    box(0.5, 0.662, 0.25, 0.0985),
    box(0.67, 0.0887, 0.0684, 0.2645),
    cylinder(0.372, 0.785, 0.2227),
    box(0.036, 0.429, 0.1417, 0.2867),
]


@pytest.mark.parametrize("obstacle", SCENES)
@pytest.mark.parametrize("factor", [0.125, 8.0])
def test_a_scene_in_another_size_has_the_same_plan(
    obstacle: Obstacle, factor: float
) -> None:
    task = replace(read_problem("paper/obs1"), scene=Scene((obstacle,)))
    one, other = map(planned, (task, scaled(task, factor)))
    unit = np.array([factor, *np.ones(one.joints.shape[1] - 1)])
    # The 1e-6 m for rounding are eight times as much of the small one's lengths.
    np.testing.assert_allclose(other.joints / unit, one.joints, atol=1e-3)
    np.testing.assert_array_equal(other.on_path, one.on_path)


def planned(task: PlanningProblem) -> Trajectory:
    return plan_paper(task, link_clearance(task), 0.0).trajectory
