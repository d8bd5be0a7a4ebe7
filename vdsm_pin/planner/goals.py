"""Plans to a goal where nothing is drawn, and plans that come home.

A goal for the tip is a path of one point. Joint values as a goal are planned towards
from both ends: a straight line in joint space where that is clear; else from the goal
to where the tip starts, run backwards, with such a line to or from the start; else from
the start to the goal's tip with such a line at its end. Where the arm is confined it
draws back along its own curve and goes in along that of the other end.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import row_centres
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.by_posture import is_short, with_postures
from vdsm_pin.planner.joint_lines import clear_line
from vdsm_pin.planner.records import (
    UNMEASURED,
    LinkClearance,
    Margin,
    Measure,
    Plan,
)
from vdsm_pin.planner.start import start_joints
from vdsm_pin.planner.strategies import Strategy
from vdsm_pin.planner.time_limit import with_share
from vdsm_pin.planner.tip_curve import way_back
from vdsm_pin.problem.desired_path import Blocked, DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem, Posture
from vdsm_pin.problem.trajectory import Trajectory

JOINS: Final = 8
"""Rows of a motion from which a line to its other end is tried, evenly spread."""

FIRST_SHARE: Final = 0.5
"""Part of the time for the way back from joint values; the way there has the rest; [-].
"""

SPACING: Final = 0.0032
"""Largest distance of the tip between two rows over the arm's length; [-]."""


def with_path(problem: PlanningProblem) -> PlanningProblem:
    """The problem, with a path of one point where it has a start and a goal alone."""
    if problem.tip_path is not None or problem.start is None or problem.goal is None:
        return problem
    return _from(problem, problem.start, problem.goal.tip)


def _from(
    problem: PlanningProblem,
    start: Posture,
    tip: FloatArray,
    end: Posture | None = None,
) -> PlanningProblem:
    """The problem to bring the tip from a start to a place.

    Args:
        problem: Arm and scene.
        start: Where the arm stands.
        tip: Where the tip shall be, shape (3,); [m].
        end: With joints: how the arm shall stand there at best. It is followed in.
    """
    path = DesiredPath(
        start.tip, tip[None], spacing=SPACING * problem.manipulator.total_length,
        blocked=Blocked.FAIL, start_joints=start.joints,
    )  # fmt: skip
    if end is not None and end.joints is not None:
        centres = row_centres(problem.manipulator, end.joints[None])[0]
        path = replace(path, insertion=way_back(centres)[::-1])
    return replace(problem, tip_path=path, start=None, goal=None)


def with_ends(
    problem: PlanningProblem, plan_with: Strategy, *, any_way: bool = False
) -> Strategy:
    """A strategy that also does what a problem asks besides drawing.

    Args:
        problem: As it is asked, maybe without a path.
        plan_with: Plans problems that have one.
        any_way: Whether the arm may come to the path through joint space.
    """

    def planned(
        known: PlanningProblem,
        clearance: LinkClearance,
        margin: Margin,
        measure: Measure = UNMEASURED,
    ) -> Plan:
        def plan(asked: PlanningProblem, within: LinkClearance) -> Plan:
            return plan_with(asked, within, margin, measure)

        need = known.required_clearance + float(np.max(margin, initial=0.0))
        if problem.goal is None:
            if any_way and is_short(known.manipulator):
                found = with_postures(known, clearance, need, plan)
            else:
                found = plan(known, clearance)
            return with_return(found) if known.path.home else found
        if problem.goal.joints is None:
            return undrawing(plan(known, clearance))
        return _to_joints(known, problem.goal, clearance, need, plan)

    return planned


def with_return(plan: Plan) -> Plan:
    """A plan and its rivals, each with its own way back behind it, drawing nothing."""
    told = plan.trajectory
    back = told.joints[-2::-1]
    on = np.concatenate([told.on_path, np.zeros(len(back), np.bool_)])
    stations = np.concatenate([told.path_m, np.full(len(back), told.path_m[-1])])
    rows = np.concatenate([told.joints, back])
    whole = plan.with_rows(Trajectory.of_joints(rows, on, stations))
    note = f"behind the path the arm goes home the way it came, in {len(back)} rows"
    return replace(
        whole,
        notes=(*plan.notes, note),
        rivals=tuple(with_return(rival) for rival in plan.rivals),
    )


def undrawing(plan: Plan) -> Plan:
    """A plan and its rivals that draw nothing: the path was a way to say the goal."""
    rows = plan.trajectory.joints
    rivals = tuple(undrawing(rival) for rival in plan.rivals)
    return replace(_off_path(plan, rows), rivals=rivals)


def _off_path(plan: Plan, rows: FloatArray) -> Plan:
    """A plan of other rows, none of which draws."""
    nothing = np.zeros(len(rows), dtype=np.bool_)
    plan = replace(plan, notes=(), undrawn=(), rivals=())
    return plan.with_rows(Trajectory.of_joints(rows, nothing, np.zeros(len(rows))))


def _to_joints(
    known: PlanningProblem,
    goal: Posture,
    clearance: LinkClearance,
    need: float,
    plan_with: Callable[[PlanningProblem, LinkClearance], Plan],
) -> Plan:
    """A plan to joint values.

    Args:
        known: From the start to the goal's tip.
        goal: With joint values.
        clearance: Clearance of links at given joint centres.
        need: Clearance to keep; [m].
        plan_with: The strategy, told all but the problem and its clearance.

    Raises:
        Infeasible: If there is none that way; where it is proved, from one end.
        OutOfTime: If none was found in time.
    """
    assert goal.joints is not None
    start = start_joints(known)
    begin = Posture(known.path.start, start)
    back = _from(known, goal, begin.tip, begin)
    there = _from(known, begin, goal.tip, goal)
    reasons = []
    for asked, end, turned in ((back, start, True), (there, goal.joints, False)):
        within = with_share(clearance, FIRST_SHARE) if turned else clearance
        try:
            plan = plan_with(asked, within)
        except (Infeasible, OutOfTime) as error:
            if isinstance(error, OutOfTime) and not turned:
                raise
            side = "back from the goal" if turned else "from the start"
            why: object = error
            if isinstance(error, OutOfTime):
                side += ", with half of the time"
                why = error.reached or "nothing was found"
            reasons.append(f"planned {side}: {why}")
            continue
        rows = _joined(known, clearance, plan.trajectory.joints, end, need)
        if rows is None:
            reasons.append("the tip comes there, and the joints were not brought there")
            continue
        return _off_path(plan, rows[::-1] if turned else rows)
    raise NoPlanFound("; ".join(reasons))


def _joined(
    problem: PlanningProblem,
    clearance: LinkClearance,
    rows: FloatArray,
    end: FloatArray,
    need: float,
) -> FloatArray | None:
    """Rows of a motion up to one of them and a straight line on to an end."""
    for k in _spread(len(rows)):
        line = clear_line(problem, clearance, rows[k], end, need)
        if line is not None:
            return np.concatenate([rows[:k], line])
    return None


def _spread(count: int) -> Iterator[int]:
    """The first of some rows, which is nearest to its own end, then the last ones."""
    yield 0
    yield from range(count - 1, 0, -max(1, count // JOINS))
