"""A problem ten times smaller or seven times larger has the same plan in its size."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from oracles.other_sizes import scaled
from scenes_for_fewest import problem

from benchmarks.hrm2000.solids import Opening, plate_with_hole
from vdsm_pin.geometry.solids import Box, Cylinder, HalfSpace, Sphere
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest.explore import explore
from vdsm_pin.planner.fewest.levels import QUICK, THOROUGH, Effort, Insert
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.roadmap import CostWeights
from vdsm_pin.planner.fewest.smoothing import shortcut
from vdsm_pin.planner.fewest.strategy import CLEAREST, FEWEST
from vdsm_pin.planner.fewest.unbend import unbend
from vdsm_pin.problem.desired_path import Order
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.verification.link_clearance import link_clearance

PILLAR = Cylinder("pillar", np.array([1.6, 0.45, 0.0]), np.array([0.0, 0, 1]), 2.0, 0.1)
OFF, HALF = np.array([-0.06, 0.05]), np.array([0.1, 0.1])
BENT = np.zeros(17)
BENT[[4, 6, 8, 10]] = 0.7


def found(task: PlanningProblem, weights: CostWeights, effort: Effort) -> Corners:
    """The motion of the last search, smoothed."""
    clearance = broad_phase(task, link_clearance(task))
    *_, outcome = explore(task, clearance, 0.0, weights, effort)
    assert outcome.found is not None
    return shortcut(outcome.judge, outcome.found.corners, weights)


def frame() -> list[Obstacle]:
    """A wall across the rail with a window off it."""
    spans = [((-3, -0.16), (-3, 3)), ((0.04, 3), (-3, 3)), ((-0.16, 0.04), (-3, -0.05))]
    spans.append(((-0.16, 0.04), (0.15, 3)))
    return [
        Box(
            f"wall{n}", np.array([0.65, sum(y) / 2, sum(z) / 2]), np.eye(3),
            np.array([0.03, y[1] - y[0], z[1] - z[0]]) / 2,
        )
        for n, (y, z) in enumerate(spans)
    ]  # fmt: skip


def of_one_knee() -> PlanningProblem:
    return problem(PILLAR)


def in_any_order() -> PlanningProblem:
    task = problem(PILLAR, Sphere("ball", np.array([2.2, 0.2, 1.1]), 0.2), closed=False)
    return replace(task, tip_path=replace(task.path, order=Order.FREE))


def through_a_window() -> PlanningProblem:
    points = np.array([[1.5, -0.2, 0.05], [1.5, -0.25, 0.15], [1.5, -0.2, 0.2]])
    return problem(*frame(), points=points, closed=False, start=(-0.3, 0.0, 0.0))


def through_a_port() -> PlanningProblem:
    plate = plate_with_hole("plate", Opening(0.65, 0.06, OFF, HALF), 16, 3.0)
    return replace(through_a_window(), scene=Scene((plate,)))


def round_a_core() -> PlanningProblem:
    """Ahead of a front, by 75 deg about a core that the arm's own bend goes round."""
    middle, turn = np.array([0.15, 0.78, 0.0]), np.deg2rad(75.0)
    end = middle + 0.78 * np.array([np.sin(turn), -np.cos(turn), 0.0])
    ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
    points = end + np.outer([0.2, 0.3], ahead)
    core = Cylinder("core", middle, np.array([0.0, 0.0, 1.0]), 2.0, 0.6)
    front = HalfSpace("front", np.array([1.25, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]))
    start = (-0.3, 0.0, 0.0)
    return problem(core, front, points=points, closed=False, start=start)


def looking_through_a_window() -> PlanningProblem:
    task = through_a_window()
    looks = Pointing(0.4, target=np.array([2.5, -0.2, 0.1]))
    return replace(task, tip_path=replace(task.path, pointing=looks))


ROADMAPS = Effort(THOROUGH[:2], proves=True)
INSERTED = tuple(one for one in THOROUGH if isinstance(one, Insert))
IN_BY_PROJECTIONS = Effort(INSERTED[:1], proves=False)
IN_BY_DIRECTIONS = Effort(INSERTED[1:2], proves=False)

CASES = [
    (of_one_knee, FEWEST, ROADMAPS, (0.1, 7.0)),
    (of_one_knee, CLEAREST, QUICK, (0.1, 7.0)),
    (in_any_order, FEWEST, ROADMAPS, (0.1, 7.0)),
    # Rounding decides between ways of one length, and chance goes on from there: by
    # powers of two there is none.
    (through_a_window, FEWEST, IN_BY_PROJECTIONS, (0.125, 8.0)),
    (through_a_window, FEWEST, IN_BY_DIRECTIONS, (0.125, 8.0)),
    (through_a_port, FEWEST, IN_BY_PROJECTIONS, (0.125, 8.0)),
    (round_a_core, FEWEST, IN_BY_DIRECTIONS, (0.125, 8.0)),
    (looking_through_a_window, FEWEST, IN_BY_DIRECTIONS, (0.125, 8.0)),
]


@pytest.mark.parametrize(("make", "weights", "effort", "factors"), CASES)
def test_a_problem_in_another_size_has_the_same_plan_in_that_size(
    make: Callable[[], PlanningProblem],
    weights: CostWeights,
    effort: Effort,
    factors: tuple[float, float],
) -> None:
    task = make()
    one = found(task, weights, effort)
    for factor in factors:
        other = found(scaled(task, factor), weights, effort)
        assert len(one.tips) == len(other.tips)
        np.testing.assert_array_equal(one.drawn, other.drawn)
        np.testing.assert_allclose(other.tips, one.tips * factor, atol=1e-7 * factor)
        # Directions have no size.
        unit = 1.0 if one.offsets.shape[2] == 3 else factor
        np.testing.assert_allclose(other.offsets, one.offsets * unit, atol=1e-7 * unit)
        np.testing.assert_allclose(
            other.stations, one.stations * factor, atol=1e-7 * factor
        )


@pytest.mark.parametrize("factor", [0.1, 7.0])
def test_an_arm_in_another_size_unbends_alike(factor: float) -> None:
    joints = BENT.copy()
    task = problem(Sphere("ball", np.array([1.0, 0.9, 0.3]), 0.1), start_joints=joints)
    large = scaled(task, factor)
    one, other = (unbend(each, link_clearance(each), 0.0) for each in (task, large))
    np.testing.assert_allclose(other[:, 1:], one[:, 1:], atol=1e-9)
    np.testing.assert_allclose(other[:, 0], one[:, 0] * factor, atol=1e-9 * factor)
