"""How far a feed lets the rail go. Oracle: closed forms of balls beside it."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import Feed
from vdsm_pin.geometry.solids import Box, Sphere
from vdsm_pin.planner.feed import within_feed
from vdsm_pin.planner.records import Prepared
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene

FEED = Feed(0.8, 0.06)
REQUIRED = 0.005


def asked(arm: Manipulator, balls: tuple[Box | Sphere, ...]) -> PlanningProblem:
    """To draw something, from where the straight arm has x0 = 0."""
    tip = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None] + 0.1, False)
    return PlanningProblem(arm, Scene(balls), path, REQUIRED, name="feed")


def too_near(ball: Sphere, error: float) -> tuple[float, float]:
    """Between which x0 the feed is; of no length where it passes."""
    reach = ball.radius + FEED.radius + REQUIRED + error
    across = np.linalg.norm(ball.centre[1:])
    half = float(np.sqrt(max(reach**2 - across**2, 0.0)))
    if not half:
        return np.inf, np.inf
    return ball.centre[0] - half, ball.centre[0] + FEED.length + half


@pytest.mark.parametrize("seed", range(20))
def test_the_rail_ends_where_the_feed_is_too_near(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm = replace(built_in("hrm8"), feed=FEED, base_range=(-3.0, 3.0))
    errors = ErrorBox(base=0.002, obstacle=0.001) if seed % 2 else ErrorBox()
    error, balls = errors.base + errors.obstacle, []
    for k in range(6):
        radius = rng.uniform(0.01, 0.1)
        ball = Sphere(f"ball {k}", rng.uniform((-4, 0, 0), (3, 0.2, 0.05)), radius)
        low, high = too_near(ball, error)
        if not low < 0.0 < high:
            balls.append(ball)
    spans = [too_near(ball, error) for ball in balls]
    low = max([-3.0, *(b for a, b in spans if b < 0.0)])
    high = min([3.0, *(a for a, b in spans if 0.0 < a < np.inf)])
    task = replace(asked(arm, tuple(balls)), errors=errors)
    found = within_feed(Prepared(task))
    ends = found.problem.manipulator.base_range
    assert low - 2e-6 < ends[0] <= low
    assert high <= ends[1] < high + 2e-6
    assert len(found.notes) == int(low > -3.0) + int(high < 3.0)


def test_without_a_feed_or_with_one_that_is_ignored_the_rail_stays() -> None:
    ball = Sphere("ball", np.array([0.3, 0.0, 0.0]), 0.1)
    bare = built_in("hrm8")
    ignoring = replace(bare, feed=FEED, ignore_pairs=(("ball", "feed"),))
    for arm in (bare, ignoring):
        found = within_feed(Prepared(asked(arm, (ball,))))
        assert found.problem.manipulator.base_range == arm.base_range
        assert not found.notes


@pytest.mark.parametrize("room", [0.0005, 0.002, 0.02])
def test_a_guide_along_the_feed_hides_no_wall(room: float) -> None:
    """Steps as long as the clearance allows never came past a guide of 0.5 mm."""
    arm = replace(built_in("hrm8"), feed=FEED, base_range=(-5.0, 5.0))
    half = np.array([10.0, 0.1, 0.05])
    low = -FEED.radius - REQUIRED - room - half[2]
    guide = Box("guide", np.array([0.0, 0.0, low]), np.eye(3), half)
    wall = Box(
        "wall", np.array([2.05, 0.0, 0.5]), np.eye(3), np.array([0.05, 1.0, 1.0])
    )
    ignoring = replace(
        arm, ignore_pairs=tuple(("guide", f"link {k}") for k in range(1, 9))
    )
    found = within_feed(Prepared(asked(ignoring, (guide, wall))))
    end = 2.0 - FEED.radius - REQUIRED
    assert found.problem.manipulator.base_range[0] == -5.0
    assert end <= found.problem.manipulator.base_range[1] < end + 2e-6
