"""The plot of where the last link looks, against plain arithmetic."""

import base64
from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.arm_drawing import ArmDrawing
from vdsm_pin.report.thinning import Thinned

ARM = built_in("hrm8")
LENGTH = ARM.total_length


def drawing(pointing: Pointing | None) -> ArmDrawing:
    """A straight arm that slides 1 m along the rail and draws its last 0.8 m."""
    x0 = np.linspace(0.0, 1.0, 11)
    flat = np.zeros((11, ARM.n_links))
    on_path = x0 >= 0.19
    motion = Trajectory(on_path, np.where(on_path, x0 - 0.2, 0.0), x0, flat, flat)
    corners = np.array([[LENGTH + 0.2, 0.0, 0.0], [LENGTH + 1.0, 0.0, 0.0]])
    path = DesiredPath(np.array([LENGTH, 0.0, 0.0]), corners, pointing=pointing)
    return ArmDrawing(PlanningProblem(ARM, Scene(()), path, 0.0), motion)


def plotted(pointing: Pointing | None, rows: list[int]) -> list[dict[str, object]]:
    shown = Thinned(np.array(rows), 11)
    plots = drawing(pointing).charts(shown, [])
    return [plot for plot in plots if plot["id"] == "looking"]


@pytest.mark.parametrize("rows", [list(range(11)), [0, 2, 5, 10]])
def test_the_angle_to_a_target_is_shown_on_the_path_alone(rows: list[int]) -> None:
    target = np.array([LENGTH + 2.0, 0.0, 0.5])
    (plot,) = plotted(Pointing(np.deg2rad(30.0), target=target), rows)
    data = plot["series"][0]["values"]  # type: ignore[index]
    found = np.frombuffer(base64.b64decode(data), "<f4")
    slid = np.array(rows) / 10.0
    expected = np.degrees(np.arctan2(0.5, 2.0 - slid))
    expected[slid < 0.19] = np.nan
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert plot["limits"] == [{"label": "cone 30°", "value": pytest.approx(30.0)}]


def test_directions_that_change_are_followed_along_their_chord() -> None:
    turned = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    (plot,) = plotted(Pointing(0.2, directions=turned), [2, 6, 10])
    data = plot["series"][0]["values"]  # type: ignore[index]
    found = np.frombuffer(base64.b64decode(data), "<f4")
    np.testing.assert_allclose(found, [0.0, 45.0, 90.0], atol=1e-4)


def test_a_path_that_does_not_say_where_to_look_has_no_such_plot() -> None:
    assert not plotted(None, [0, 10])
    free = drawing(None)
    without = replace(free, problem=replace(free.problem, tip_path=None))
    ids = [plot["id"] for plot in without.charts(Thinned(np.array([0, 10]), 11), [])]
    assert "looking" not in ids
