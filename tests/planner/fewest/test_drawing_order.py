"""Pieces of the path in another order, against trying every order."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from scenes_for_fewest import problem

from vdsm_pin.errors import Infeasible
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.fewest.search import shortest_tour, tour_length
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.desired_path import Blocked, Order
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify


def planned(task: PlanningProblem, order: Order) -> tuple[PlanningProblem, Plan]:
    task = replace(task, tip_path=replace(task.path, order=order))
    return task, plan_fewest(task, link_clearance(task), 0.0)


def way_off_the_path(plan: Plan) -> float:
    step = np.linalg.norm(np.diff(plan.tip_path.points, axis=0), axis=1)
    on = plan.trajectory.on_path
    return float(step[~(on[:-1] & on[1:])].sum())


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_shortest_tour_is_the_best_of_all_orders_and_directions(count: int) -> None:
    rng = np.random.default_rng(count)
    for _ in range(20):
        first = rng.uniform(0.0, 1.0, (count, 2))
        between = rng.uniform(0.0, 1.0, (count, 2, count, 2))
        lengths = [
            tour_length(first, between, tuple(zip(order, backs, strict=True)))
            for order in itertools.permutations(range(count))
            for backs in itertools.product((False, True), repeat=count)
        ]
        tour = shortest_tour(first, between)
        assert sorted(number for number, _ in tour) == list(range(count))
        assert tour_length(first, between, tour) == pytest.approx(min(lengths))


@pytest.mark.parametrize("name", ["obs1", "obs2-small"])
def test_a_free_order_shortens_the_detours_and_still_draws_all(name: str) -> None:
    task = read_problem(f"paper/{name}")
    _, given = planned(task, Order.AS_GIVEN)
    task, free = planned(task, Order.FREE)
    assert way_off_the_path(free) < 0.7 * way_off_the_path(given)
    assert any("another order" in note for note in free.notes)
    assert not any("another order" in note for note in given.notes)
    result = verify(task, free.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)


def test_an_open_path_is_drawn_from_its_nearer_end_only_if_allowed() -> None:
    points = np.array([[3.126, 1.2, 0.9], [3.126, 0.6, 0.5], [3.126, 0.0, 0.1]])
    task = problem(points=points, closed=False)
    _, given = planned(task, Order.AS_GIVEN)
    _, free = planned(task, Order.FREE)
    drawn = free.trajectory.path_m[free.trajectory.on_path]
    assert (np.diff(drawn) <= 0.0).all()
    assert drawn[0] == pytest.approx(task.path.length)
    assert way_off_the_path(free) < 0.2 < way_off_the_path(given)
    assert (np.diff(given.trajectory.path_m[given.trajectory.on_path]) >= 0.0).all()


def test_places_on_a_closed_path_are_told_within_it() -> None:
    """Rows of a path that is entered at 1.4 m count on to 3.8 m, of 2.4 m."""
    square = np.full((4, 3), 3.126)
    square[:, 1:] = (0.3, 0.3), (0.3, -0.3), (0.9, -0.3), (0.9, 0.3)
    task = problem(points=square, start=(3.126, 0.9, -0.1))
    assert task.path.entry == pytest.approx(1.4)
    ball = Sphere("ball", np.array([3.126, 0.3, 0.0]), 0.1)
    task = replace(task, scene=Scene((ball,)))
    plan = plan_fewest(task, link_clearance(task), 0.0)
    told = [float(x) for x in re.findall(r"([\d.]+) mm", "".join(plan.undrawn))]
    places = np.array(told) / 1e3
    # The ball and what is kept of it: from 0.3 - r to 0.3 + r along the first side.
    assert plan.undrawn and places.max() < 0.6
    with pytest.raises(Infeasible, match=r"at 1\d\d\.\d+ mm along the path the tip"):
        plan_fewest(
            replace(task, tip_path=replace(task.path, blocked=Blocked.FAIL)),
            link_clearance(task), 0.0,
        )  # fmt: skip
