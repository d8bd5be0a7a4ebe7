"""Coal steers the paper's rule: which joints slide on, by how much, and what grows."""

import json
from dataclasses import replace
from typing import Any

import made_up
import numpy as np
import pytest

from vdsm_pin import margins, refinement
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Cylinder
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.across_rail import AcrossRail
from vdsm_pin.planner.paper.along_rail import AlongRail
from vdsm_pin.planner.paper.joint_paths import slide_joints
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.planner.paper.sections import planned_gap
from vdsm_pin.planner.paper.steps import PaperSteps
from vdsm_pin.planner.records import (
    UNMEASURED,
    Adjustment,
    Margin,
    Miss,
    Plan,
    margin_table,
)
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.facts import plan_file
from vdsm_pin.verification.coal_arm import CoalArm, CoalDistances
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict


def short(name: str) -> PlanningProblem:
    """A paper scene with a short piece of its path."""
    problem = read_problem(f"paper/{name}")
    points = np.array([[3.126, 0.9, 0.9], [3.126, 1.0, 1.0]])
    return replace(problem, tip_path=replace(problem.path, points=points, closed=False))


def beside(name: str) -> PlanningProblem:
    """The same with a cylinder along the rail that the arm is clear of by itself."""
    problem = short(name)
    other = Cylinder("other", np.array([1.5, -0.9, 0.0]), np.eye(3)[0], 3.0, 0.1)
    return replace(problem, scene=Scene((*problem.scene.obstacles, other)))


class Telling:
    """Coal as it would be if one link missed an obstacle in one motion."""

    def __init__(self, motion: Trajectory, miss: Miss) -> None:
        self.motion, self.miss, self.lifts = motion, miss, list[Trajectory]()

    def __call__(self, motion: Trajectory, margin: Margin = 0.0) -> tuple[Miss, ...]:
        self.lifts.append(motion)
        same = np.array_equal(motion.joints, self.motion.joints)
        return (self.miss,) if same else ()


def plan(problem: PlanningProblem, measure: Any = UNMEASURED) -> tuple[Plan, Any]:
    made = plan_paper(problem, link_clearance(problem), 0.0, measure)
    assert isinstance(made.steps, PaperSteps)
    return made, made.steps


def missing(
    steps: PaperSteps, row: int, link: int, share: float, normal: FloatArray
) -> Telling:
    """Link `link` is 1.5 mm too near at a share of its length, along a normal."""
    begin, end = steps.centres[row, link - 1], steps.centres[row, link]
    point, problem = begin + share * (end - begin), steps.avoidance
    assert isinstance(problem, AlongRail | AcrossRail)
    distance = problem.problem.required_clearance - 0.0015
    told = Miss(row, link, 0, distance, point, point - distance * normal, normal)
    return Telling(steps.trajectory, told)


def passing_row(steps: PaperSteps) -> int:
    rows = np.flatnonzero(steps.route.side != 0)
    return int(rows[len(rows) // 2])


@pytest.mark.parametrize("share", [0.0, 0.4])
@pytest.mark.parametrize("turn", [0.0, 0.7, -0.7])
def test_the_last_joint_slides_by_what_the_normal_says(
    share: float, turn: float
) -> None:
    """Link 8 ends at the tip, which stays: (1 - share) s u.n is what was missing."""
    problem = short("obs1")
    before, steps = plan(problem)
    row = passing_row(steps)
    rule = steps.avoidance.rules[int(steps.route.side[row])]
    line = rule.direction
    assert line.any()
    cos, sin = np.cos(turn), np.sin(turn)
    normal = np.array([0.0, *(np.array([[cos, -sin], [sin, cos]]) @ line)])
    coal = missing(steps, row, 8, share, normal)
    after, moved = plan(problem, coal)
    ((one,),) = after.rounds
    wanted = planned_gap(problem) - problem.required_clearance + 0.0015
    way = wanted / ((1.0 - share) * cos)
    assert one.joints == (8,)
    assert one.moved == pytest.approx(way, rel=1e-5)
    assert (one.link, one.obstacle, one.moment) == (8, "pillar", row)
    # The tip's route keeps off the region of the last link, so that rows differ.
    side, tip = int(steps.route.side[row]), steps.planar[row, -1:]
    there = slide_joints(problem.manipulator, tip, moved.avoidance.rules[side])[0]
    slid = there[7] - steps.planar[row, 7]
    np.testing.assert_allclose(slid, one.moved * line, atol=1e-12)
    assert len(coal.lifts) == 2 and after.trajectory is coal.lifts[-1]
    assert before.rounds == ()


def test_both_joints_of_a_link_within_slide_and_no_other_region_grows() -> None:
    problem = beside("obs1")
    _, steps = plan(problem)
    row = passing_row(steps)
    rule = steps.avoidance.rules[int(steps.route.side[row])]
    normal = np.array([0.0, *rule.direction])
    coal = missing(steps, row, 7, 0.3, normal)
    after, moved = plan(problem, coal)
    ((one,),) = after.rounds
    assert one.joints == (7, 8)
    assert one.moved == pytest.approx(
        planned_gap(problem) - problem.required_clearance + 0.0015, rel=1e-5
    )
    assert np.flatnonzero(moved.avoidance.growths).tolist() == [6]
    assert moved.avoidance.growths[6] == one.margin
    assert moved.avoidance.obstacles == (0,)
    gaps = [
        np.linalg.norm(p.planar[row, [6, 7]] - rule.region.corners[0], axis=1)
        for p in (steps, moved)
    ]
    assert gaps[1].max() == pytest.approx(rule.region.radius + one.margin, abs=1e-9)
    assert (gaps[1] >= gaps[0] - 1e-12).all()
    # Joints nearer to the tip are led as before.
    np.testing.assert_array_equal(moved.planar[:, 8], steps.planar[:, 8])
    assert moved.avoidance.region.radius == steps.avoidance.region.radius


def test_across_the_rail_the_bends_move_by_what_the_normal_says() -> None:
    problem = beside("obs3")
    _, steps = plan(problem)
    way = steps.avoidance
    assert isinstance(way, AcrossRail)
    moves = np.abs(steps.planar - steps.reference).max(axis=(1, 2))
    row, link = int(np.argmax(moves)), way.bends[0]
    normal = np.zeros(3)
    normal[1 + way.axis] = way.side
    coal = missing(steps, row, link, 0.0, normal)
    after, moved = plan(problem, coal)
    ((one,),) = after.rounds
    assert one.joints == way.bends
    wanted = planned_gap(problem) - problem.required_clearance + 0.0015
    assert one.moved == pytest.approx(wanted, rel=1e-5)
    slid = moved.planar[row] - steps.planar[row]
    at = [bend - 1 for bend in way.bends]
    tip_x = steps.centres[[row], -1, 0]
    parts = way.side * one.moved * way.shares(steps.reference[[row]], tip_x)[0]
    assert np.abs(parts).max() == one.moved
    np.testing.assert_allclose(slid[at, way.axis], parts, atol=1e-6)
    assert not slid[:, 1 - way.axis].any()
    assert np.flatnonzero(moved.avoidance.growths).tolist() == [link - 1]


@pytest.mark.parametrize("case", ["other obstacle", "square to the line", "back"])
def test_what_joints_cannot_help_moves_nothing(case: str) -> None:
    problem = beside("obs1")
    _, steps = plan(problem)
    row = passing_row(steps)
    line = steps.avoidance.rules[int(steps.route.side[row])].direction
    normal = np.array([0.0, *line])
    if case == "square to the line":
        normal = np.array([0.0, -line[1], line[0]])
    if case == "back":
        normal = -normal
    coal = missing(steps, row, 7, 0.3, normal)
    if case == "other obstacle":
        coal.miss = coal.miss._replace(obstacle=1)
    after, moved = plan(problem, coal)
    assert after.rounds == ()
    np.testing.assert_array_equal(moved.centres, steps.centres)


def short_of(link: int, obstacle: int, error: float) -> type[CoalArm]:
    """Coal, which reports less for one link and one obstacle."""

    class Lying(CoalArm):
        def measured(self, *words: Any) -> CoalDistances:
            found = super().measured(*words)
            of = self.pairs.one[found.pair] == link - 1
            of &= self.pairs.other[found.pair] == self.pairs.n_own + obstacle
            return replace(found, distance=found.distance - np.where(of, error, 0.0))

    return Lying


@pytest.mark.parametrize("name", ["obs1", "obs3"])
def test_one_link_that_misses_one_obstacle_grows_that_region_alone(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = beside(name)
    honest = refinement.plan_and_verify(problem, "paper")
    assert honest.plan.rounds == ()
    link = 5
    monkeypatch.setattr(margins, "CoalArm", short_of(link, 0, 0.03))
    found = refinement.plan_and_verify(problem, "paper")
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.plan.rounds
    told = [one for ended in found.rounds for one in ended.adjustments]
    assert {(one.link, one.obstacle) for one in told} == {
        (link, problem.scene.obstacles[0].name)
    }
    steps: Any = found.plan.steps
    assert np.flatnonzero(steps.avoidance.growths).tolist() == [link - 1]


def test_the_rounds_of_plan_json_are_what_happened(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = replace(short("obs1"), required_clearance=0.010)
    asked = list[tuple[Miss, ...]]()

    class Watched(margins.CoalMeasure):
        def __call__(
            self, trajectory: Trajectory, margin: Margin = 0.0, /
        ) -> tuple[Miss, ...]:
            asked.append(super().__call__(trajectory, margin))
            return asked[-1]

    monkeypatch.setattr(refinement, "CoalMeasure", Watched)
    monkeypatch.setattr(margins, "CoalArm", short_of(5, 0, 0.03))
    found = refinement.plan_and_verify(problem, "paper")
    told = json.loads(plan_file(found, made_up.RECORD).text())
    happened = [miss for misses in asked for miss in misses]
    rows = told["adjustments"]
    assert len(rows) == len(happened) > 0
    assert told["rounds"] == len(found.rounds)
    number = [k for k, misses in enumerate(asked, start=1) for _ in misses]
    for row, miss, at in zip(rows, happened, number, strict=True):
        assert (row["round"], row["moment"], row["link"]) == (at, miss.row, miss.link)
        assert row["obstacle"] == "pillar" and row["measured_by"] == "Coal"
        assert row["distance_m"] == miss.distance
        np.testing.assert_allclose(row["normal"], miss.normal, atol=1e-12)
        assert row["joints"] and row["moved_m"] > 0.0 and row["region_m"] > 0.0
        assert row["margin_m"] is None
    moved: list[Adjustment] = [one for ended in found.plan.rounds for one in ended]
    assert [one.moved for one in moved] == [row["moved_m"] for row in rows]


@pytest.mark.parametrize("shape", [(8,), (8, 2), (1, 8)])
def test_margins_are_one_number_or_one_for_each_link_and_obstacle(
    shape: tuple[int, ...],
) -> None:
    problem = read_problem("paper/obs1")
    assert margin_table(problem, 0.5).tolist() == [[0.5]] * 8
    with pytest.raises(ValueError, match=r"expected one number or \(8, 1\)"):
        margin_table(problem, np.zeros(shape))
