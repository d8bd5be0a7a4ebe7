"""A start too close to an obstacle: every strategy refuses it in the same words."""

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import StartBlocked
from vdsm_pin.geometry.solids import Cylinder
from vdsm_pin.planner.start import start_centres
from vdsm_pin.planner.strategies import STRATEGIES, strategy
from vdsm_pin.problem.planning_problem import DesiredPath, PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.verification.link_clearance import link_clearance

ARM = built_in("hrm8")
POINTS = np.array([[3.126, 0.3, -0.2], [3.126, 0.5, -0.2]])


def starting(gap: float, joints: np.ndarray | None = None) -> PlanningProblem:
    """A post beside link 3 of the straight arm, which it misses by the gap [m]."""
    aside = 0.05 + ARM.link_radius + gap
    axis = np.array([0.0, 0.0, 1.0])
    post = Cylinder("post", np.array([1.2, -aside, 0.0]), axis, 2.0, 0.05)
    tip = np.array([3.126, 0.0, 0.0])
    if joints is not None:
        tip = joint_centres(ARM, joints[:1], joints[None, 1::2], joints[None, 2::2])
        tip = tip[0, -1]
    path = DesiredPath(tip, POINTS, False, start_joints=joints)
    return PlanningProblem("start", ARM, Scene((post,)), path, 0.0035, np.eye(4))


def refusal(task: PlanningProblem, name: str) -> StartBlocked:
    with pytest.raises(StartBlocked) as caught:
        strategy(name)(task, link_clearance(task), 0.0)
    return caught.value


def test_every_strategy_refuses_a_blocked_start_in_the_same_words() -> None:
    task = starting(0.0034)
    refusals = [refusal(task, name) for name in STRATEGIES]
    assert len({str(one) for one in refusals}) == 1
    assert (refusals[0].link, refusals[0].obstacle) == (3, "post")
    assert refusals[0].clearance == pytest.approx(0.0034, abs=1e-8)
    assert "straight arm" in str(refusals[0])


# An arm that follows its leader has no way round the corner of this path.
@pytest.mark.parametrize("name", [n for n in STRATEGIES if n != "follow-the-leader"])
def test_a_start_with_a_hair_more_than_required_is_taken(name: str) -> None:
    task = starting(0.0036)
    plan = strategy(name)(task, link_clearance(task), 0.0)
    np.testing.assert_allclose(plan.centres[0], start_centres(task), atol=1e-12)


def test_a_start_stated_by_its_joints_is_judged_as_it_is_bent() -> None:
    joints = np.zeros(17)
    joints[[3, 5]] = -0.3, 0.3
    assert "straight" not in str(refusal(starting(0.1, joints), "fewest"))
    joints[[3, 5]] = 0.3, -0.3
    task = starting(0.0, joints)
    assert strategy("fewest")(task, link_clearance(task), 0.0).trajectory.n_samples
