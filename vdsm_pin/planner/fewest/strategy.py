"""The strategies `fewest`, `clearest`, `sturdiest`: search, smooth, write, explain."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_angles
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.broad_phase import BroadPhase, broad_phase
from vdsm_pin.planner.fewest.explain import (
    how_far,
    refuse,
    refuse_proved,
    say_drawn,
)
from vdsm_pin.planner.fewest.explore import Explored, explore
from vdsm_pin.planner.fewest.judge import check_cone, levers
from vdsm_pin.planner.fewest.levels import FULL, QUICK, Effort, leaning, pointed
from vdsm_pin.planner.fewest.motion import Corners, Rows, dense_rows
from vdsm_pin.planner.fewest.notes import notes_of, undrawn
from vdsm_pin.planner.fewest.roadmap import CostWeights
from vdsm_pin.planner.fewest.search import Searched
from vdsm_pin.planner.fewest.smoothing import lifted, shortcut, sparser, straightened
from vdsm_pin.planner.fewest.unbend import (
    from_there,
    leans_ahead,
    unbend,
    with_unbending,
)
from vdsm_pin.planner.largest_margin import IMPROVE_SHARE, Widest, drawn_length, widest
from vdsm_pin.planner.records import (
    UNMEASURED,
    LinkClearance,
    Margin,
    Measure,
    Plan,
    margin_table,
)
from vdsm_pin.planner.start import check_start, start_centres
from vdsm_pin.planner.time_limit import with_share
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.held import TIP, Axes
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES

SEARCH_SHARE: Final = 0.6
"""Part of the time after which a search ends that has found something; [-]."""
EXPLAIN_SHARE: Final = 0.1
"""Part of the time that is left to tell what stopped a search; [-]."""
EXPLAIN_MOST: Final = 4.0
"""The longest time left for that; [s]."""
BETTER_BY: Final = 0.004
"""Plans are made better until this part of what is best at most is left; [-]."""
FEWEST: Final = CostWeights()
CLEAREST: Final = CostWeights(angle=0.2, clearance=0.064, clearance_cost=8.0)


def plan_fewest(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margin: Margin,
    measure: Measure = UNMEASURED,
) -> Plan:
    """A plan that draws all it can with as few changed link angles as it finds.

    Args:
        problem: What is asked.
        clearance: Clearance of links at given joint centres.
        margin: Kept beyond the required clearance; [m].
        measure: Not read: Coal measures the finished motion.

    Raises:
        Infeasible: With the proof where there is one, else `NoPlanFound`.
    """
    return _Search.of(problem, clearance, margin, "fewest", FEWEST).plan()


def plan_clearest(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margin: Margin,
    measure: Measure = UNMEASURED,
) -> Plan:
    """The plan with the largest clearance found, at the price of straight joints.

    Arguments and errors are those of `plan_fewest`.
    """
    search = _Search.of(problem, clearance, margin, "clearest", CLEAREST)
    first = search.plan()
    found = _in_time(first, lambda: search.clearer(first))
    plan = found.plans[-1]
    if not problem.scene.obstacles or search.margins is not None:
        return plan  # a clearance less margins is not what the report shows
    return replace(plan, notes=(*plan.notes, found.told(search.clearance_kept)))


def plan_sturdiest(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margin: Margin,
    measure: Measure = UNMEASURED,
) -> Plan:
    """The plan thought to survive the largest error of all joints, and its rivals.

    Among them are the plans of `fewest` and `clearest`, but for those that draw less:
    who can prove what a motion survives has the choice. Arguments and errors are those
    of `plan_fewest`.
    """
    lean = _Search.of(problem, clearance, margin, "sturdiest", FEWEST)
    wide = replace(lean, weights=CLEAREST)
    try:
        first = wide.plan()
    except Infeasible:
        return lean.plan()
    clearer = _in_time(first, lambda: wide.clearer(first)).plans
    sturdier = _in_time(first, lambda: wide.sturdier(first)).plans
    plans = [*_if_found(lean.hurried.plan), *clearer, *sturdier[1:]]
    whole = max(map(drawn_length, plans)) - TOLERANCES.joint_centre
    plans = _different([plan for plan in plans if drawn_length(plan) >= whole])
    try:
        # The start often tells what all survive: then the clearest is the best.
        clearest = sorted(plans, key=lambda plan: -float(wide.kept(plan.centres).min()))
        survived = [wide.survived(plan.centres) for plan in clearest]
        enough = max(survived) - TOLERANCES.joint_error
        best = clearest[next(k for k, error in enumerate(survived) if error >= enough)]
    except OutOfTime:
        return plans[-1]
    return replace(best, rivals=tuple(plan for plan in clearest if plan is not best))


def _different(plans: list[Plan]) -> list[Plan]:
    """The plans without those that move as one before them does."""
    moves = [plan.trajectory.joints for plan in plans]
    return [
        plan
        for k, plan in enumerate(plans)
        if not any(np.array_equal(moves[k], before) for before in moves[:k])
    ]


def _in_time(first: Plan, better: Callable[[], Widest]) -> Widest:
    """Better plans, the first alone where the time is over before any is looked for."""
    try:
        return better()
    except OutOfTime:
        return Widest([first], np.inf, in_time=False)


def _if_found(plan: Callable[[], Plan]) -> list[Plan]:
    """The plan, nothing where there is none, or none in time."""
    try:
        return [plan()]
    except (Infeasible, OutOfTime):
        return []


@dataclass(frozen=True)
class _Search:
    """Plans of one problem with more and more in reserve.

    Args:
        problem: What is asked.
        clearance: Clearance of links.
        margin: Kept by every link beyond the required clearance; [m].
        name: Of the strategy.
        weights: What it prefers.
        margins: What links keep from obstacles besides, shape (N, n_obstacles); None
            for nothing; [m].
    """

    problem: PlanningProblem
    clearance: LinkClearance
    margin: float
    name: str
    weights: CostWeights
    margins: FloatArray | None = None

    @classmethod
    def of(
        cls,
        problem: PlanningProblem,
        clearance: LinkClearance,
        margin: Margin,
        name: str,
        weights: CostWeights,
    ) -> "_Search":
        """With a margin for each link and obstacle where the start keeps all of them.

        From another start the way out is judged by how near it is itself: there the
        largest margin is kept by every link.
        """
        table, start = margin_table(problem, margin), start_centres(problem)
        largest = float(table.max(initial=0.0))
        each = cls(problem, clearance, 0.0, name, weights, table)
        if (
            table.min(initial=largest) < largest
            and leans_ahead(problem)
            and np.isfinite(start).all()
            and each.kept(start[None]).min() >= problem.required_clearance
        ):
            return each
        return cls(problem, clearance, largest, name, weights)

    def kept(self, centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        """The clearance of links, less by `margins`; [m]."""
        if self.margins is None:
            return self.clearance(centres, axes)
        each = broad_phase(self.problem, self.clearance, self.margins)
        return each.up_to(np.inf)(centres, axes)

    @property
    def clearance_kept(self) -> float:
        """Clearance that every plan keeps; [m]."""
        return self.problem.required_clearance + self.margin

    @property
    def hurried(self) -> "_Search":
        """The same, with a part of the time that is left."""
        return replace(self, clearance=with_share(self.clearance, IMPROVE_SHARE))

    def plan(self, effort: Effort = FULL) -> Plan:
        """What is found with an effort.

        Raises:
            Infeasible: If nothing is.
        """
        problem, clearance = self.problem, self.clearance
        check_start(problem, clearance)
        check_cone(problem)
        if not leans_ahead(problem):
            try:
                rows = unbend(problem, clearance, self.margin)
                there = replace(self, problem=from_there(problem, rows[-1]))
                return with_unbending(problem, rows, there.plan(effort))
            except NoPlanFound:
                # It does not unbend, or there is no plan from there: by directions.
                return self._explored(leaning(effort))
        if problem.path.pointing is not None:
            effort = pointed(effort)
        return self._explored(effort)

    def _explored(self, effort: Effort) -> Plan:
        """`plan` of a problem whose start the chart holds, or by directions."""
        problem, reach = self.problem, float(levers(self.problem.manipulator)[-1])
        # What is kept is judged exactly, however much it is.
        most = self.margin + self.weights.joint_error * reach
        quick = broad_phase(problem, self.clearance, self.margins)
        quick = quick.up_to(quick.far + most)
        early = replace(quick, deadline=_early(quick.deadline))
        soon = _soon(problem, quick.deadline)
        best: Explored | None = None
        try:
            for outcome in explore(
                problem, early, self.margin, self.weights, effort, soon
            ):
                best = outcome
                say_drawn(problem, best)
                refuse_proved(problem, best)
        except OutOfTime as ended:
            if best is None or not best.will_do:
                reached = "" if best is None else how_far(problem, best, quick)
                raise OutOfTime(ended.limit, reached) from None
        assert best is not None
        refuse(problem, best)
        return self._written(quick, best)

    def _written(self, clearance: BroadPhase, outcome: Explored) -> Plan:
        """What was found, smoothed and row by row."""
        assert outcome.found is not None
        problem, judge = self.problem, outcome.judge
        try:
            corners = self._smoothed(clearance, outcome)
            rows = self._rows(corners, judge.slack)
        except NoPlanFound:  # of what is shorter; what was found may have rows
            corners = outcome.found.corners
            rows = self._rows(corners, judge.slack)
        alpha, theta = joint_angles(problem.manipulator, rows.centres)
        # Proofs of what is needed ask no more than whether there is the clearance
        # required.
        enough = clearance.bare.up_to(problem.required_clearance)
        enough = enough.hurried(IMPROVE_SHARE)
        stations, on_path = _stations(corners, rows)
        trajectory = Trajectory(on_path, stations, rows.centres[:, 0, 0], alpha, theta)
        return Plan(
            problem,
            self.name,
            rows.centres,
            trajectory,
            undrawn(problem, outcome),
            notes_of(problem, enough, outcome, trajectory, rows.centres),
        )

    def _rows(self, corners: Corners, slack: float) -> Rows:
        """A motion row by row; joint centres stray by no more than the slack; [m]."""
        problem, turn = self.problem, self.problem.planned_row_change
        spacing = problem.path.spacing
        return dense_rows(problem.manipulator, corners, spacing, turn, slack)

    def _smoothed(self, clearance: BroadPhase, outcome: Explored) -> Corners:
        """What was found, shorter and with fewer knees, as far as there is time."""
        assert outcome.found is not None
        judge = outcome.judge.until(clearance.deadline.share(IMPROVE_SHARE))
        corners = outcome.found.corners
        grown = not isinstance(outcome.found, Searched)
        # What is straighter has more knees to spare. A roadmap has few but for an aim.
        pointing = self.problem.path.pointing is not None
        again = self.weights == FEWEST and (grown or pointing)
        with suppress(OutOfTime):
            corners = sparser(judge, corners) if grown else corners
            corners = shortcut(judge, corners, self.weights)
            corners = sparser(judge, corners) if again else corners
            corners = lifted(judge, straightened(judge, corners))
        return corners

    def with_reserve(self, reserve: float) -> Plan:
        """One that keeps so much more clearance; [m]."""
        return replace(self, margin=self.margin + reserve).plan(QUICK)

    def with_joint_error(self, error: float) -> Plan:
        """One whose links keep what such an error of all joints uses up; [rad]."""
        weights = replace(self.weights, joint_error=error)
        return replace(self, weights=weights).plan(QUICK)

    def clearer(self, first: Plan) -> Widest:
        """Plans with more and more clearance; [m]."""
        low = float(self.kept(first.centres).min()) - self.clearance_kept
        start = float(self.kept(first.centres[:1]).min())
        high = min(self._clearance_at_tips(first), start) - self.clearance_kept
        return widest(
            self.hurried.with_reserve, first, low, high, until=BETTER_BY * high
        )

    def sturdier(self, first: Plan) -> Widest:
        """Plans whose links keep what larger and larger joint errors use up; [rad]."""
        reach = float(levers(self.problem.manipulator)[-1])
        low, high = self.survived(first.centres), self.survived(first.centres[:1])
        most = self._clearance_at_tips(first) - self.clearance_kept
        high = min(most / reach, high)
        better = self.hurried.with_joint_error
        return widest(better, first, low, high, until=BETTER_BY * high)

    def survived(self, centres: FloatArray) -> float:
        """Error of all joints that configurations have room for, roughly; [rad]."""
        clearances = self.kept(centres) - self.clearance_kept
        return float((clearances / levers(self.problem.manipulator)).min())

    def _clearance_at_tips(self, plan: Plan) -> float:
        """Least clearance of the tip alone where it draws: no plan has more; [m]."""
        tips = plan.tip_path.points[plan.tip_path.on_path]
        clearances = self.kept(np.stack([tips, tips], axis=1), TIP)
        return float(clearances.min(initial=np.inf))


def _early(deadline: Deadline) -> Deadline:
    """When the search ends, so that there is time to tell what stopped it."""
    return deadline.earlier(min(EXPLAIN_MOST, EXPLAIN_SHARE * deadline.limit))


def _soon(problem: PlanningProblem, deadline: Deadline) -> Deadline:
    """From when on a part of the path will do, so that its proof is in time."""
    if problem.path.blocked is Blocked.FAIL:
        return NO_LIMIT
    return deadline.share(SEARCH_SHARE)


def _stations(corners: Corners, rows: Rows) -> tuple[FloatArray, BoolArray]:
    """Arc length along the desired path and whether the tip draws, row by row."""
    a, t = rows.interval, rows.share
    stations = (1.0 - t) * corners.stations[a] + t * corners.stations[a + 1]
    on_path = corners.drawn[a].copy()
    begins = t == 0.0
    on_path[begins] |= corners.drawn[np.maximum(a[begins] - 1, 0)]
    return np.where(corners.drawn[a], stations, corners.stations[a]), on_path
