"""What has been found is handed out when the time is over, wherever that happens.

The clock is replaced by a count: the n-th question about a clearance finds the time
over, as do all that follow.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any

import numpy as np
import pytest

from vdsm_pin.errors import NoPlanFound, OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.fewest import explore
from vdsm_pin.planner.fewest.insertion import insert
from vdsm_pin.planner.fewest.levels import (
    FIRST,
    FULL,
    QUICK,
    Effort,
    Insert,
    Search,
    later_levels,
    leaning,
    pointed,
)
from vdsm_pin.planner.fewest.strategy import (
    CLEAREST,
    FEWEST,
    _Search,
    plan_clearest,
    plan_fewest,
    plan_sturdiest,
)
from vdsm_pin.planner.largest_margin import drawn_length, widest
from vdsm_pin.planner.paper.clearest import plan_paper_clearest
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.planner.records import LinkClearance, Plan
from vdsm_pin.planner.time_limit import within_time
from vdsm_pin.problem.held import Axes
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

Planner = Callable[[PlanningProblem, LinkClearance, float], Plan]
NO_MARGIN = 0.0


@dataclass
class Counted:
    """A clearance function whose time is over at a question."""

    clearance: LinkClearance
    last: float = np.inf
    asked: int = field(default=0)

    def __call__(self, centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        self.asked += 1
        if self.asked >= self.last:
            raise OutOfTime(0.5)
        return self.clearance(centres, axes)


def corner(name: str) -> PlanningProblem:
    """A paper scene with a short piece of its path, to keep the test quick."""
    task = read_problem(f"paper/{name}")
    points = np.array([[3.126, 0.9, 0.9], [3.126, 1.0, 1.0]])
    return replace(task, tip_path=replace(task.path, points=points, closed=False))


def planned(planner: Planner, task: PlanningProblem, last: float) -> Plan | None:
    try:
        return planner(task, Counted(link_clearance(task), last), NO_MARGIN)
    except OutOfTime:
        return None


def plan_paper_measured(
    problem: PlanningProblem, clearance: LinkClearance, margin: float
) -> Plan:
    """With a measure that finds nothing missing: the widest is made once more."""
    return plan_paper_clearest(problem, clearance, margin, lambda *_: ())


@pytest.mark.parametrize(
    "planner", [plan_fewest, plan_clearest, plan_paper_clearest, plan_paper_measured]
)
def test_more_time_never_loses_a_plan(planner: Planner) -> None:
    task = corner("obs1")
    counted = Counted(link_clearance(task))
    whole = planner(task, counted, NO_MARGIN)
    lasts = np.unique(np.linspace(1, counted.asked, 6).astype(int))
    plans = [planned(planner, task, float(last)) for last in lasts]
    there = [plan is not None for plan in plans]
    assert there[-1] and there == sorted(there), there
    # Of whoever goes on to look for a better one most of the time is after the first.
    assert planner is plan_fewest or there.count(False) < len(there) / 2
    for plan in filter(None, plans):
        assert drawn_length(plan) == pytest.approx(drawn_length(whole), abs=1e-9)
        assert verify(task, plan.trajectory).verdict is Verdict.CERTIFIED


def test_a_first_plan_of_the_papers_rule_stays_at_every_question_after_it() -> None:
    task = corner("obs1")
    counted = Counted(link_clearance(task))
    plan_paper(task, counted, NO_MARGIN)
    for last in range(counted.asked + 1, counted.asked + 5):
        assert planned(plan_paper_clearest, task, float(last)) is not None, last


def test_an_improvement_that_takes_too_long_leaves_what_there_was() -> None:
    task = corner("obs1")
    first = plan_fewest(task, link_clearance(task), NO_MARGIN)
    asked: list[float] = []

    def plan_with(reserve: float) -> Plan:
        asked.append(reserve)
        if len(asked) == 2:
            raise OutOfTime(0.5)
        return first

    found = widest(plan_with, first, 0.0, 0.008)
    assert asked == [0.004, 0.006]
    assert found.plans == [first, first] and not found.in_time
    assert "time was over before all plans that keep more" in found.told(0.004)


def test_what_is_told_is_what_was_tried() -> None:
    task = corner("free")
    first = plan_fewest(task, link_clearance(task), NO_MARGIN)

    def has(most: float) -> Callable[[float], Plan]:
        def plan_with(reserve: float) -> Plan:
            if reserve > most:
                raise NoPlanFound(str(most))
            return first

        return plan_with

    refused = widest(has(0.003), first, 0.0, 0.008, rounds=1)
    assert refused.told(0.001) == (
        "of the plans that were to keep 5.000 mm none draws as much"
    )
    for found in (
        widest(has(1.0), first, 0.0, 0.008),
        widest(has(0.0), first, 0.008, 0.008),
    ):
        assert "no plan keeps more than 9.000 mm" in found.told(0.001)


@pytest.mark.parametrize("planner", [plan_clearest, plan_sturdiest])
@pytest.mark.parametrize("after", [1, 2, 3])
def test_time_that_ends_behind_the_first_plan_leaves_it(
    planner: Planner, after: int
) -> None:
    """What better plans could have at most is asked before any of them is planned."""
    task = corner("obs1")
    first = Counted(link_clearance(task))
    plan = _Search.of(task, first, NO_MARGIN, "clearest", CLEAREST).plan()
    found = planned(planner, task, float(first.asked + after))
    assert found is not None
    np.testing.assert_array_equal(found.centres, plan.centres)


def test_a_better_plan_is_looked_for_by_roadmaps_alone() -> None:
    """To point, a margin that no arm has was looked for by every insertion there is."""
    assert all(isinstance(level, Search) for level in pointed(QUICK).levels)
    assert len(leaning(QUICK).levels) == 1
    assert not pointed(QUICK).proves and not leaning(QUICK).proves
    for effort in (pointed(FULL), leaning(FULL)):
        inserts = [one for one in effort.levels if isinstance(one, Insert)]
        assert inserts and all(one.directed for one in inserts) and effort.proves


@pytest.mark.parametrize("limit", [None, 60.0])
def test_a_search_goes_on_until_its_time_is_over(
    limit: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The insertions of an effort fail here: the ones after them are of the time."""
    task, levels, tried = read_problem("paper/free"), (FIRST[0],), []

    def failing(*asked: Any) -> Any:
        tried.append(asked[4])
        return (None, None) if asked[4] in levels else insert(*asked)

    monkeypatch.setattr(explore, "insert", failing)
    within = within_time(link_clearance(task), Deadline.after(limit))
    searched = _Search.of(task, within, NO_MARGIN, "fewest", FEWEST)
    if limit is None:
        with pytest.raises(NoPlanFound):
            searched.plan(Effort(levels, proves=True))
        assert set(tried) == set(levels)
    else:
        plan = searched.plan(Effort(levels, proves=True))
        assert drawn_length(plan) == pytest.approx(task.path.length)
        assert [level.seed for level in tried if level not in levels] == [1]


def test_later_insertions_differ_from_each_other_and_from_all_before() -> None:
    for effort in (FULL, pointed(FULL), leaning(FULL)):
        later = list(islice(later_levels(effort.levels), 30))
        assert len({*later, *effort.levels}) == 30 + len(effort.levels)
        assert later == list(islice(later_levels(effort.levels), 30))
        if not any(isinstance(one, Search) for one in effort.levels):
            assert all(isinstance(one, Insert) and one.directed for one in later)
    assert not list(later_levels(QUICK.levels))


def test_a_search_that_compiles_ends_after_its_patience() -> None:
    task = read_problem("paper/free")
    hurried = replace(Deadline.after(600.0), patience=0.0)
    within = within_time(link_clearance(task), hurried)
    nothing = Effort((replace(FIRST[0], cells=1),), proves=True)
    with pytest.raises(NoPlanFound):
        _Search.of(task, within, NO_MARGIN, "fewest", FEWEST).plan(nothing)
