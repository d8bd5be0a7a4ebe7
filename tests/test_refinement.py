"""Refinement: what is missing is added, and nothing uncertified is handed out."""

import math
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

import vdsm_pin.refinement as refinement
from vdsm_pin import margins
from vdsm_pin.errors import Infeasible, InsideUnknown, InvalidInput, NoPlanFound
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.margins import CoalMeasure, by_coal, of_pairs, raised_margins
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.planner.records import LinkClearance, Margin, Plan
from vdsm_pin.problem.desired_path import Approach
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.scene import Scene
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import coal_check
from vdsm_pin.verification.coal_arm import CoalArm, CoalDistances
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.robust import largest_joint_error


def short(name: str) -> PlanningProblem:
    """A paper scene with a short piece of its path, to keep the test quick."""
    problem = read_problem(f"paper/{name}")
    points = np.array([[3.126, 0.9, 0.9], [3.126, 1.0, 1.0]])
    return replace(problem, tip_path=replace(problem.path, points=points, closed=False))


def test_missing_clearance_between_waypoints_is_added_to_the_margin(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without its reserve the planner comes too close between waypoints."""

    def close(
        problem: PlanningProblem, clearance: LinkClearance, margin: Margin, *_: Any
    ) -> Plan:
        reserve = TOLERANCES.planned_reserve * problem.manipulator.total_length
        return plan_paper(problem, clearance, margin - reserve)

    monkeypatch.setattr(refinement, "strategy", lambda name: close)
    problem = short("obs3")
    result = refinement.plan_and_verify(problem, "paper")
    assert result.verification.verdict is Verdict.CERTIFIED
    found_by = {one.measured_by for ended in result.rounds for one in ended.adjustments}
    assert "proof" in found_by
    assert all(one.adjustments for one in result.rounds[:-1])
    assert not result.rounds[-1].adjustments
    assert len(result.rounds) >= 2  # between waypoints the bent arm swings closer
    margins = [one.margin for one in result.rounds]
    assert margins == sorted(margins)
    assert "round 1" in result.plan.notes[-1]
    assert result.rounds[-1].clearance >= problem.required_clearance


def test_margins_reach_beyond_what_a_plan_keeps_unasked() -> None:
    """Errors take what it kept, so that a margin within that asks for nothing."""
    problem = read_problem("paper/obs1")
    problem = replace(problem, errors=ErrorBox(joint=np.deg2rad(0.1)))
    result = refinement.plan_and_verify(problem, "fewest")
    assert result.verification.verdict is Verdict.CERTIFIED
    assert result.verification.errors == problem.errors
    ended = result.rounds[0]
    assert ended.adjustments
    for one in ended.adjustments:
        assert one.margin > problem.required_clearance - one.distance
    assert len(result.rounds) <= 3


def test_a_plan_that_cannot_be_certified_is_not_handed_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A planner that ignores the obstacle and the margin never gets through."""

    def blind(problem: PlanningProblem, clearance: LinkClearance, *_: Any) -> Plan:
        free = replace(problem, scene=read_problem("paper/free").scene)
        return plan_paper(free, clearance, 0.0)

    monkeypatch.setattr(refinement, "strategy", lambda name: blind)
    problem = short("obs3")
    with pytest.raises(NoPlanFound, match="too near"):
        refinement.plan_and_verify(problem, "paper")


def test_reasons_of_the_planner_pass_through() -> None:
    problem = short("obs3")
    start = replace(problem.path, start=np.array([3.126, 0.0, 2.5]))
    problem = replace(problem, tip_path=start)
    with pytest.raises(Infeasible, match="beyond the reach"):
        refinement.plan_and_verify(problem, "paper")


def test_of_rivals_the_one_that_is_proved_to_survive_most_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whatever the planner thinks: here it puts a plan through the obstacle first."""
    task = short("obs3")
    free = replace(task, scene=read_problem("paper/free").scene)

    def boasting(problem: PlanningProblem, clearance: LinkClearance, *_: Any) -> Plan:
        lean, wide = (plan_fewest(problem, clearance, m) for m in (0.0, 0.03))
        blind = replace(plan_fewest(free, clearance, 0.0), problem=problem)
        return replace(blind, rivals=(lean, wide))

    monkeypatch.setattr(refinement, "strategy", lambda name: boasting)
    result = refinement.plan_and_verify(task, "any")
    errors = []
    for m in (0.0, 0.03):
        motion = plan_fewest(task, link_clearance(task), m).trajectory
        errors.append(largest_joint_error(task, motion, ErrorBox()))
    assert errors[1] > errors[0] > 0.0
    kept = largest_joint_error(task, result.plan.trajectory, ErrorBox())
    assert kept == errors[1]
    told = math.floor(1e3 * np.rad2deg(kept)) / 1e3
    assert f"off by ±{told:.3f}° at once" in result.plan.notes[-1]
    assert "of 3 plans" in result.plan.notes[-1]
    assert not result.plan.rivals
    assert result.verification.verdict is Verdict.CERTIFIED


def off_by(error: float) -> type[CoalArm]:
    """Coal, with an error on every distance to obstacles."""

    class Lying(CoalArm):
        def measured(self, *words: Any) -> CoalDistances:
            found = super().measured(*words)
            off = np.where(self.pairs.other[found.pair] >= self.pairs.n_own, error, 0.0)
            return replace(found, distance=found.distance + off)

    return Lying


@pytest.mark.parametrize("name", ["paper", "fewest"])
def test_with_a_coal_that_reports_less_the_plan_keeps_so_much_more(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = replace(short("obs3"), required_clearance=0.010)
    honest = refinement.plan_and_verify(problem, name)
    assert not honest.rounds[0].adjustments
    before = honest.verification.min_clearance
    error = 0.005 + before - problem.required_clearance
    monkeypatch.setattr(margins, "CoalArm", off_by(-error))
    careful = refinement.plan_and_verify(problem, name)
    assert careful.verification.min_clearance >= before + 0.005
    first = careful.rounds[0]
    assert first.verdict is None
    assert {one.measured_by for one in first.adjustments} == {"Coal"}
    assert "Coal measures" in careful.plan.notes[-1]


@pytest.mark.parametrize(
    ("name", "error", "again"),
    [("clearest", 0.005, False), ("sturdiest", 0.005, False), ("clearest", 0.2, True)],
)
def test_what_keeps_much_anyway_keeps_more_where_coal_finds_it_missing(
    name: str, error: float, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = replace(short("obs3"), required_clearance=0.010)
    monkeypatch.setattr(margins, "CoalArm", off_by(-error))
    careful = refinement.plan_and_verify(problem, name)
    assert careful.verification.min_clearance >= problem.required_clearance + error
    assert (len(careful.rounds) > 1) == again


STRATEGIES = ("paper", "fewest", "clearest", "sturdiest")


@pytest.mark.parametrize("name", STRATEGIES)
def test_with_a_coal_that_reports_more_no_plan_is_returned(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = short("obs3")
    for module in (margins, coal_check):
        monkeypatch.setattr(module, "CoalArm", off_by(0.005))
    with pytest.raises(NoPlanFound, match="Coal"):
        refinement.plan_and_verify(problem, name)


@pytest.mark.parametrize("name", STRATEGIES)
def test_without_coal_there_is_no_plan(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = short("obs3")
    monkeypatch.setitem(sys.modules, "coal", None)
    with pytest.raises(ImportError):
        refinement.plan_and_verify(problem, name)


def test_only_the_link_that_coal_names_gets_a_margin() -> None:
    """A blunder of the planner at one link: the others keep what they had."""
    problem = short("obs3")
    plan = plan_paper(problem, link_clearance(problem), 0.0)
    assert by_coal(plan, CoalMeasure(problem), {}) == ()
    tight = replace(problem, required_clearance=0.0037)
    found = by_coal(replace(plan, problem=tight), CoalMeasure(tight), {})
    links = {one.link for one in found}
    assert links
    assert links < set(range(1, 9))
    raised = of_pairs(raised_margins({}, found), tight)
    assert set(np.flatnonzero(raised) + 1) == links
    for one in found:
        assert one.margin > tight.required_clearance - one.distance > 0.0


def test_plans_keep_their_change_per_row_and_less_where_the_problem_says_so() -> None:
    problem = short("obs3")
    for limit, most in ((None, 5.0), (10.0, 5.0), (1.0, 1.0)):
        change = None if limit is None else np.deg2rad(limit)
        asked = replace(problem, max_row_change=change)
        result = refinement.plan_and_verify(asked, "fewest")
        (row,) = [c for c in result.verification.checks if "change of a" in c.name]
        assert row.verdict is Verdict.CERTIFIED
        assert row.limit == pytest.approx(np.deg2rad(most))
        steps = np.abs(np.diff(result.plan.trajectory.joints[:, 1:], axis=0))
        assert steps.max() <= np.deg2rad(most)


# ---- meshes whose inside cannot be told ----------------------------------------------


def with_open_box(
    centre: tuple[float, float, float], size: float, solid: bool | None = None
) -> PlanningProblem:
    """A box without one of its triangles; its upper corner is nearest to the arm."""
    made = trimesh.creation.box(np.full(3, size))
    corners, faces = np.asarray(made.vertices) + centre, np.asarray(made.faces)
    mesh = Mesh("crate", corners, faces[1:], solid)
    return replace(short("obs3"), scene=Scene((mesh,)))


def planned(problem: PlanningProblem, name: str = "fewest") -> refinement.Refinement:
    return refinement.plan_and_verify(problem, name)


@pytest.mark.parametrize("name", ["paper", "fewest"])
def test_an_open_mesh_is_planned_round_as_its_hull(name: str) -> None:
    found = planned(with_open_box((2.0, 0.4, -0.35), 0.3), name)
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.plan.problem.scene.obstacles[0].name == "crate"
    assert isinstance(found.plan.problem.scene.obstacles[0], Mesh)
    (note,) = (note for note in found.plan.notes if "crate" in note)
    assert "its convex hull stands for it: write `solid: false` under" in note
    surface = planned(with_open_box((2.0, 0.4, -0.35), 0.3, solid=False), name)
    assert not any("convex hull" in note for note in surface.plan.notes)


def test_within_the_hull_of_an_open_mesh_one_sentence_says_what_to_write() -> None:
    with pytest.raises(InsideUnknown, match="write `solid: false` under 'crate'"):
        planned(with_open_box((1.5, 0.0, 0.0), 1.0))


def test_no_plan_round_the_hull_names_the_hull_first() -> None:
    with pytest.raises(Infeasible, match=r"^the inside of 'crate' cannot be told"):
        planned(with_open_box((3.126, 0.9, 0.9), 0.3))


@pytest.mark.parametrize(
    ("name", "strategy", "why"),
    [
        ("free", "paper", "no obstacle along the rail is passed"),
        ("obs1", "paper", ""),
        ("free", "fewest", "strategy 'fewest' chooses its way by itself"),
    ],
)
def test_an_approach_that_is_not_read_is_told(
    name: str, strategy: str, why: str
) -> None:
    problem = read_problem(f"paper/{name}")
    for approach in Approach:
        path = replace(problem.path, approach=approach)
        asked = replace(problem, tip_path=path)
        notes = refinement.plan_and_verify(asked, strategy).plan.notes
        said = [note for note in notes if "is not read" in note]
        assert len(said) == bool(why and approach is not Approach.SHORTEST)
        assert all(why in note and repr(approach.value) in note for note in said)


def test_a_motion_that_was_clear_is_measured_again_where_more_is_asked() -> None:
    problem = short("obs3")
    measure = CoalMeasure(problem)
    motion = plan_paper(problem, link_clearance(problem), 0.0).trajectory
    assert measure(motion) == ()
    more = measure(motion, 0.010)
    assert more and all(one.distance < 0.0135 for one in more)
    assert measure(motion) == ()


@pytest.mark.parametrize(
    ("pointing", "fault"),
    [
        (Pointing(0.1, target=np.array([3.126, 0.95, 0.95])), "target on the path"),
        (Pointing(0.1, directions=np.array([[1.0, 0, 0], [-1.0, 0, 0]])), "opposite"),
    ],
)
def test_a_path_along_which_the_tip_looks_nowhere_is_refused(
    pointing: Pointing, fault: str
) -> None:
    """Files refuse it where they are read; a problem built in Python is planned."""
    problem = short("free")
    path = replace(problem.path, pointing=pointing)
    with pytest.raises(InvalidInput, match=fault):
        refinement.plan_and_verify(replace(problem, tip_path=path), "fewest")
