"""The strategies `fewest` and `clearest`: search, smooth, write down, explain."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.cables import cable_lengths
from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.kinematics import joint_angles
from vdsm_pin.planner.fewest.explain import (
    how_far,
    notes_of,
    refuse,
    refuse_proved,
)
from vdsm_pin.planner.fewest.explore import LEVELS, QUICK, Level, Outcome, explore
from vdsm_pin.planner.fewest.motion import Knots, Rows, dense_rows
from vdsm_pin.planner.fewest.nearby import FAR, Nearby, nearby
from vdsm_pin.planner.fewest.roadmap import Taste
from vdsm_pin.planner.fewest.smooth import lifted, smooth, straightened
from vdsm_pin.planner.fewest.unbend import (
    from_there,
    leans_ahead,
    unbend,
    with_unbending,
)
from vdsm_pin.planner.fewest.widest import widest
from vdsm_pin.planner.records import LinkClearance, Plan, TipPath
from vdsm_pin.planner.start import check_start
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory

FEWEST: Final = Taste()
CLEAREST: Final = Taste(angle=0.2, room=0.2, room_cost=8.0)


def plan_fewest(
    problem: PlanningProblem, clearance: LinkClearance, margin: float
) -> Plan:
    """A plan that draws all it can with as few changed link angles as it finds.

    Args:
        problem: What is asked.
        clearance: Clearance of links at given joint centres.
        margin: Kept beyond the required clearance; [m].

    Raises:
        Infeasible: With the proof where there is one, else `NoPlanFound`.
    """
    return _plan(problem, clearance, margin, "fewest", FEWEST)


def plan_clearest(
    problem: PlanningProblem, clearance: LinkClearance, margin: float
) -> Plan:
    """The plan with the largest clearance found, at the price of straight joints.

    Arguments and errors are those of `plan_fewest`.
    """
    search = _Search(problem, clearance, margin, "clearest", CLEAREST)
    plan, reserve = _clearest(search)
    if not problem.scene.obstacles:
        return plan
    most = problem.required_clearance + margin + reserve
    note = (
        f"of the plans tried none with a clearance above {most * 1e3:.1f} mm draws as "
        "much"
    )
    return replace(plan, notes=(*plan.notes, note))


def _clearest(search: "_Search") -> tuple[Plan, float]:
    """The plan with the largest clearance found, and what it has in reserve; [m]."""
    first, clearance = search.plan(), search.clearance
    kept = search.problem.required_clearance + search.margin
    low = float(clearance(first.centres).min()) - kept
    start = float(clearance(first.centres[:1]).min())
    high = min(_room_at_tips(clearance, first), start) - kept
    return widest(search.with_reserve, first, low, high)


def _room_at_tips(clearance: LinkClearance, plan: Plan) -> float:
    """Least clearance of the tip alone where it draws: no plan has more; [m]."""
    tips = plan.tip_path.points[plan.tip_path.on_path]
    return float(clearance(np.stack([tips, tips], axis=1)).min(initial=np.inf))


@dataclass(frozen=True)
class _Search:
    """Plans of one problem with more and more in reserve."""

    problem: PlanningProblem
    clearance: LinkClearance
    margin: float
    name: str
    taste: Taste

    def plan(self) -> Plan:
        return _plan(self.problem, self.clearance, self.margin, self.name, self.taste)

    def with_reserve(self, reserve: float) -> Plan:
        return _plan(
            self.problem, self.clearance, self.margin + reserve, self.name,
            self.taste, levels=QUICK,
        )  # fmt: skip


def _plan(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margin: float,
    name: str,
    taste: Taste,
    levels: tuple[Level, ...] = LEVELS,
) -> Plan:
    check_start(problem, clearance)
    if not leans_ahead(problem):
        rows = unbend(problem, clearance, margin)
        there = from_there(problem, rows[-1])
        rest = _plan(there, clearance, margin, name, taste, levels)
        return with_unbending(problem, rows, rest)
    # What is kept is judged exactly, however much it is.
    quick = nearby(problem, clearance).up_to(FAR + margin)
    best: Outcome | None = None
    try:
        for outcome in explore(problem, quick, margin, taste, levels):
            best = outcome
            refuse_proved(problem, best)
        assert best is not None
        refuse(problem, best)
        return _written(problem, quick, name, taste, best)
    except OutOfTime as ended:
        reached = "" if best is None else how_far(problem, best)
        raise OutOfTime(ended.limit, reached) from None


def _written(
    problem: PlanningProblem,
    clearance: Nearby,
    name: str,
    taste: Taste,
    outcome: Outcome,
) -> Plan:
    """What was found, smoothed and row by row."""
    assert outcome.found is not None
    judge, arm = outcome.judge, problem.manipulator
    knots = smooth(judge, outcome.found.knots, taste)
    knots = lifted(judge, straightened(knots))
    turn = TOLERANCES.planned_step
    rows = dense_rows(arm, knots, problem.path.spacing, turn, judge.slack)
    alpha, theta = joint_angles(arm, rows.centres)
    # Proofs of what is needed ask no more than whether there is the clearance required.
    enough = clearance.up_to(problem.required_clearance)
    stations, on_path = _stations(knots, rows)
    trajectory = Trajectory(on_path, stations, rows.centres[:, 0, 0], alpha, theta)
    return Plan(
        problem,
        name,
        TipPath(rows.centres[:, -1], on_path, stations),
        rows.centres,
        trajectory,
        cable_lengths(arm, alpha, theta),
        notes_of(problem, enough, outcome, trajectory, rows.centres),
    )


def _stations(knots: Knots, rows: Rows) -> tuple[FloatArray, BoolArray]:
    """Arc length along the desired path and whether the tip draws, row by row."""
    a, t = rows.interval, rows.share
    stations = (1.0 - t) * knots.stations[a] + t * knots.stations[a + 1]
    on_path = knots.drawn[a].copy()
    begins = t == 0.0
    on_path[begins] |= knots.drawn[np.maximum(a[begins] - 1, 0)]
    return np.where(knots.drawn[a], stations, knots.stations[a]), on_path
