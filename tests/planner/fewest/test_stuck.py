"""What is said of an arm that does not come in: the passage, the stop, the advice."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scenes_for_fewest import problem

from vdsm_pin.arm.mounted import Tool
from vdsm_pin.errors import NoPlanFound, OutOfReach
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.feasibility import rail_distance
from vdsm_pin.planner.fewest.explain import how_far, refuse
from vdsm_pin.planner.fewest.explore import Explored, explore
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.levels import Effort, Insert
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.notes import minimal
from vdsm_pin.planner.fewest.roadmap import CostWeights
from vdsm_pin.planner.fewest.route import tip_route
from vdsm_pin.planner.fewest.search import Found
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.fewest.stuck import (
    Stuck,
    _least,
    at_reach,
    following,
    narrowest_passage,
    no_way_in,
    on_the_path,
    passage,
    too_narrow,
    where_stuck,
)
from vdsm_pin.planner.impossible.bounds import prove_tips
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.progress import shown
from vdsm_pin.time_limit import Deadline
from vdsm_pin.units import in_mm
from vdsm_pin.verification.link_clearance import link_clearance

HALF = 0.08
OVER = Deadline(1.0, 0.0)


def wall(x: float, half: float) -> list[Obstacle]:
    """A wall across the rail with a square window on it."""
    spans = [
        ((-3, -half), (-3, 3)), ((half, 3), (-3, 3)),
        ((-half, half), (-3, -half)), ((-half, half), (half, 3)),
    ]  # fmt: skip
    return [
        Box(
            f"wall{n}", np.array([x, sum(y) / 2, sum(z) / 2]), np.eye(3),
            np.array([0.04, y[1] - y[0], z[1] - z[0]]) / 2,
        )
        for n, (y, z) in enumerate(spans)
    ]  # fmt: skip


def behind(half: float) -> PlanningProblem:
    """A path behind the window."""
    points = np.array([[1.4, 0.0, 0.0], [1.4, 0.0, 0.1]])
    return problem(
        *wall(0.6, half), points=points, closed=False, start=(0.0, 0.0, 0.0),
        blocked=Blocked.FAIL,
    )  # fmt: skip


def straight(task: PlanningProblem, x: float) -> FloatArray:
    """Joint centres of the straight arm with its tip at x on the rail."""
    arm = task.manipulator
    return np.column_stack([x - arm.total_length + arm.stations, *np.zeros((2, 9))])


def test_the_passage_the_stop_and_the_advice_are_named() -> None:
    task = behind(HALF)
    way = np.column_stack([np.linspace(0.0, 1.4, 141), *np.zeros((2, 141))])
    words = where_stuck(task, Stuck(way, 51, straight(task, 0.5))).words
    # The tip's point is 80 mm from the frame at any place within the wall.
    assert "160.000 mm wide, for a body of 123.000 mm with 3.500 mm" in words
    assert "narrowest at (580.0, 0.0, 0.0) mm" in words
    assert "the arm came 500.000 mm of 1400.000 mm along it" in words
    # The tip is 80 mm from the wall's face, and 80 mm aside.
    room = np.hypot(0.08, 0.08) - task.manipulator.most_radius
    assert f"where link 8 has a clearance of {room * 1e3:.3f} mm to 'wall" in words
    assert "wider opening" not in words


def test_what_the_path_itself_lacks_is_named() -> None:
    """The path runs 70 mm below the upper edge of a window 160 mm high."""
    task = behind(HALF)
    tips = np.array([[0.5, 0.0, 0.01], [0.7, 0.0, 0.01]])
    room = 0.07 - task.manipulator.most_radius
    told = on_the_path(task, link_clearance(task), tips, room + 1e-4)
    assert told is not None
    assert f"leaves the tip itself {room * 1e3:.3f} mm to 'wall3'" in told.words
    assert (told.link, told.obstacle) == (8, "wall3")
    assert on_the_path(task, link_clearance(task), tips, room - 1e-4) is None
    assert at_reach(task, tips) is None
    short = replace(task.manipulator, base_range=(-5.0, 0.7 - 3.126))
    told = at_reach(replace(task, manipulator=short), tips)
    assert told is not None
    assert "longer rail" in told.words


def test_a_stop_is_told_with_the_station_where_it_was() -> None:
    """All of a path but its last stretch is drawn, and no cause is seen there."""
    task = behind(HALF)
    clearance, rows = broad_phase(task, link_clearance(task)), path_rows(task.path)
    proof = prove_tips(task, clearance, rows.tips)
    route = tip_route(task, rows, proof.undrawable, 0.02, 0.0)
    still = np.zeros((0, 9, 2))
    corners = Corners(np.zeros((0, 3)), still, np.zeros(0), proof.far[:0])
    found = Found(route, corners, (len(route.layers) - 1,))
    judge = Judge(task, clearance, 0.0, 0.0, 1e-3)
    late = replace(clearance, deadline=OVER)
    told = how_far(task, Explored(judge, found, rows, proof), late)
    assert told.station == route.stations[-2] > 0.0
    at = in_mm(told.station)
    assert told.words.startswith(
        f"drew {at} of 100.000 mm; the first stretch not drawn begins at {at} along "
        "the path, tip (1400.0, 0.0, 100.0) mm; link "
    )


def test_an_opening_too_narrow_for_the_tip_is_named() -> None:
    task = behind(0.06)
    told = no_way_in(task, np.array([0.6, 0.0, 0.0]))
    assert "120.000 mm wide, for a body of 123.000 mm with 3.500 mm" in told.words
    assert told.obstacle.startswith("wall")


@pytest.mark.parametrize("half", [0.03, 0.0645])
def test_the_narrowest_passage_is_measured_though_the_body_does_not_pass(
    half: float,
) -> None:
    """Any way in leads through the window; the tip's ball is as wide as it is high."""
    task = behind(half)
    clearance = broad_phase(task, link_clearance(task))
    tip = task.path.points[0]
    passed = narrowest_passage(task, clearance, tip)
    assert passed is not None
    place = passed.place
    room = link_clearance(task)(np.repeat(place[None, None], 2, axis=1))[0, 0]
    assert room == pytest.approx(half - task.manipulator.most_radius, abs=2e-5)
    assert too_narrow(task, place)
    assert narrowest_passage(task, replace(clearance, deadline=OVER), tip) is None


@pytest.mark.parametrize(
    ("half", "wider", "aside"),
    [
        (0.0589, 0.0609, (0.0, -0.11, -0.116)),
        (0.0618, 0.0632, (0.0, 0.014, -0.032)),
        (0.0559, 0.0615, (0.0, -0.054, -0.106)),
    ],
)
def test_the_narrowest_of_two_windows_is_that_of_their_middles(
    half: float, wider: float, aside: tuple[float, float, float]
) -> None:
    """The way passes the wider one by its edge, nearer than the middle of the other."""
    beside = [
        replace(o, name=f"{o.name} wide", centre=o.centre + aside)
        for o in wall(0.9, wider)
    ]
    task = replace(behind(half), scene=Scene((*wall(0.6, half), *beside)))
    clearance = broad_phase(task, link_clearance(task))
    passed = narrowest_passage(task, clearance, task.path.points[0])
    assert passed is not None
    np.testing.assert_allclose(passed.place[1:], 0.0, atol=2e-4)
    assert abs(passed.place[0] - 0.6) <= 0.025


def test_each_narrow_place_of_a_way_is_looked_at_the_worst_first() -> None:
    """A wide opening that is passed by its edge does not hide a narrower one."""
    spare = np.array([5.0, 3.0, 4.0, 2.0, 2.0, 6.0, 1.0])
    assert _least(spare).tolist() == [6, 3, 4, 1]
    assert _least(np.full(1, 2.0)).tolist() == [0]


def test_what_keeps_an_arm_from_following_its_tip_is_named() -> None:
    """Along the rail nothing does; round a right angle all that can, one by one."""
    task, arm = behind(HALF), behind(HALF).manipulator
    x = np.linspace(0.0, 1.4, 141)[:, None] * [1.0, 0.0, 0.0]
    assert following(task, x).advice == ""
    aside = np.linspace(0.0, 1.0, 101)[1:, None] * [0.0, 1.0, 0.0]
    told = following(task, np.vstack([x, x[-1] + aside]))
    # The last link turns by acos(1 - s / l) about once the tip is s aside.
    assert re.search(r"bend joint 8 by 4\d\.\d° of 42\.5° with the tip", told.words)
    assert "max_link_angle_deg" in told.advice
    told = following(replace(task, manipulator=replace(arm, base_range=(-5, -2.5))), x)
    assert "its base at x0 = −2496.000 mm, and the rail is" in told.words
    assert "with the tip at (630.0, 0.0, 0.0) mm" in told.words
    assert "rail" in told.advice
    told = following(task, x + np.clip(x[:, :1] - 0.3, 0.0, 0.05) * [0.0, 1.0, 0.0])
    assert re.search(
        r"leave link 8 a clearance of \S+ mm to 'wall1' with the tip", told.words
    )
    told = following(task, np.vstack([x, x[-1] + [0.0, 4.0, 0.0]]))
    assert (
        "not reach back to its rail with the tip at (1400.0, 4000.0, 0.0)" in told.words
    )


def test_limits_that_are_met_are_named_first() -> None:
    task = behind(0.067)
    arm = task.manipulator
    way, centres = np.zeros((2, 3)), straight(task, 0.5)
    way[1, 0] = 1.4
    turn = np.array([np.cos(arm.max_link_angle), np.sin(arm.max_link_angle), 0.0])
    centres[8] = centres[7] + arm.link_lengths[7] * turn
    words = where_stuck(task, Stuck(way, 2, centres)).words
    assert "joint 8 is at its own" in words
    assert "all the way in" in words
    short = replace(arm, base_range=(float(centres[0, 0]), 1.0))
    task = replace(task, manipulator=short)
    words = where_stuck(task, Stuck(way, 2, centres)).words
    assert "try a longer rail" in words


def test_a_search_in_vain_tells_where_it_ended(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Where the rail ends the straight arm is there, and too high for the window."""
    task = behind(HALF)
    arm = replace(task.manipulator, base_range=(-5.0, -1.724))
    task = replace(task, manipulator=arm)
    tip = task.path.points[-1]
    assert float(rail_distance(arm, tip[None])[0]) < arm.total_length
    clearance = broad_phase(task, link_clearance(task))
    effort = Insert(population=10, routes=1, backtracks=1, seed=0)
    with shown(quiet=0.0):
        *_, outcome = explore(
            task, clearance, 0.0, CostWeights(), Effort((effort,), False)
        )
    with pytest.raises(NoPlanFound) as ended:
        refuse(task, outcome)
    words = str(ended.value)
    assert "the best way in is narrowest at" in words
    assert "try a longer rail" in words
    assert "% of a way in" in capsys.readouterr().err


def test_what_the_rail_keeps_from_the_path_is_proved() -> None:
    task = behind(HALF)
    arm = replace(task.manipulator, base_range=(-5.0, 1.39 - 3.126))
    with pytest.raises(OutOfReach, match=r"the base at the end of its rail"):
        plan_fewest(replace(task, manipulator=arm), link_clearance(task), 0.0)


def test_a_number_of_angles_that_is_nowhere_proved_minimal_is_not_told() -> None:
    changed = np.array([2, 3, 1])
    assert minimal(changed, np.array([1, 1, 0])) == []
    assert "minimal at 1 of 3 waypoints" in minimal(changed, np.array([1, 3, 0]))[0]


def test_a_passage_is_held_against_the_tool_where_there_is_one() -> None:
    task, place = behind(0.03), np.array([0.6, 0.0, 0.0])
    assert too_narrow(task, place)
    arm = replace(task.manipulator, tool=Tool(0.2, 0.012))
    armed = replace(task, manipulator=arm)
    assert not too_narrow(armed, place)
    assert "60.000 mm wide, for a body of 24.000 mm" in passage(armed, place)
