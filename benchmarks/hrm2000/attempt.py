"""One problem, one method: plan, judge, look again densely."""

import time
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.hrm2000.references import REFERENCES, reference
from benchmarks.hrm2000.sampling import sample
from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.planner.time_limit import within_time
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.report.motion_facts import changed_angles, motion_facts
from vdsm_pin.time_limit import Deadline
from vdsm_pin.units import in_mm
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import ArmVerification, Verdict
from vdsm_pin.verification.verify import verify

WALL: Final = 60.0
"""Time on the wall over processor time at which work is ended all the same."""


@dataclass(frozen=True)
class Outcome:
    """One problem, one method; None where there is no motion to measure.

    Args:
        problem: Name of the problem.
        family: Its family.
        number: Its number.
        method: A strategy or a reference.
        answer: A verdict; or "infeasible", "not found", "out of time", "error".
        reason: In words.
        plan_s: Processor time of planning; [s].
        total_s: With the proof; [s].
        coverage: Part of the path that is drawn.
        knees: Mean number of changed angles by path length.
        most_knees: The largest one.
        psi_deg: Largest link angle.
        clearance_m: Least clearance proved.
        faults: What is wrong with a plan that the verifier certified, as seen by
            dense sampling; must be empty.
    """

    problem: str
    family: str
    number: int
    method: str
    answer: str
    reason: str
    plan_s: float
    total_s: float
    coverage: float = 0.0
    knees: float | None = None
    most_knees: int | None = None
    psi_deg: float | None = None
    clearance_m: float | None = None
    faults: str = ""


@dataclass(frozen=True)
class Judged:
    """A motion, what the judge said, and the processor time of planning [s]."""

    trajectory: Trajectory
    verification: ArmVerification
    plan_s: float


@dataclass(frozen=True)
class ProcessorTime(Deadline):
    """A deadline by the processor's clock; compiled loops go by the wall's, far off.

    Args:
        spent: Processor time at which work must have ended; [s].
    """

    spent: float = inf

    @classmethod
    def after(cls, seconds: float) -> "ProcessorTime":
        """So many seconds of this process from now."""
        end, spent = time.monotonic() + WALL * seconds, time.process_time() + seconds
        return cls(seconds, end, spent=spent)

    @property
    def passed(self) -> bool:
        """Whether the time is over."""
        return time.process_time() > self.spent or time.monotonic() > self.end

    @property
    def left(self) -> float:
        """The time until then; [s]."""
        return self.spent - time.process_time()

    def earlier(self, seconds: float) -> "ProcessorTime":
        """The same limit, which ends so much before."""
        return replace(self, end=self.end - seconds, spent=self.spent - seconds)


def by_strategy(problem: PlanningProblem, name: str, limit: float) -> Judged:
    """One of this package's strategies, refined where the first plan is not certified.

    The proof of the first plan is not counted as planning, later ones are.
    """
    begin = time.process_time()
    clearance = within_time(link_clearance(problem), ProcessorTime.after(limit))
    plan = strategy(name)(problem, clearance, 0.0)
    plan_s = time.process_time() - begin
    verification = verify(problem, plan.trajectory)
    if verification.verdict is not Verdict.CERTIFIED:
        begin = time.process_time()
        deadline = ProcessorTime.after(limit)
        result = plan_and_verify(problem, name, deadline=deadline)
        plan_s = time.process_time() - begin
        plan, verification = result.plan, result.verification
    return Judged(plan.trajectory, verification, plan_s)


def by_reference(problem: PlanningProblem, name: str, limit: float) -> Judged:
    """One of the references, judged as it comes."""
    follow = reference(name)
    begin = time.process_time()
    clearance = within_time(link_clearance(problem), ProcessorTime.after(limit))
    trajectory = follow(problem, load_arm(problem.manipulator), clearance)
    plan_s = time.process_time() - begin
    return Judged(trajectory, verify(problem, trajectory), plan_s)


def whole_or_nothing(problem: PlanningProblem) -> PlanningProblem:
    """The same problem for which a part of the path is no answer."""
    return replace(problem, tip_path=replace(problem.path, blocked=Blocked.FAIL))


def attempt(file: Path, key: tuple[str, int], name: str, limit: float) -> Outcome:
    """Plan and judge one problem; times are of the processor.

    Args:
        file: What is asked.
        key: Its family and number.
        name: A strategy or a reference.
        limit: Processor time of planning; [s].
    """
    problem = whole_or_nothing(read_problem(file))
    plan = by_reference if name in REFERENCES else by_strategy
    begin = time.process_time()
    try:
        judged = plan(problem, name, limit)
    except Exception as error:  # noqa: BLE001 - a crash is an outcome to be counted
        spent = time.process_time() - begin
        reason = str(error) or type(error).__name__
        return Outcome(problem.name, *key, name, answer_of(error), reason, spent, spent)
    total_s = time.process_time() - begin
    outcome = measured(problem, judged)
    return replace(outcome, family=key[0], number=key[1], method=name, total_s=total_s)


def answer_of(error: Exception) -> str:
    """A word for how a planner ended without a plan."""
    if isinstance(error, OutOfTime):
        return "out of time"
    if isinstance(error, NoPlanFound):
        return "not found"
    return "infeasible" if isinstance(error, Infeasible) else "error"


def measured(problem: PlanningProblem, judged: Judged) -> Outcome:
    """A motion in numbers; one that is certified is sampled densely besides."""
    trajectory, verification = judged.trajectory, judged.verification
    angles = link_angles(trajectory.alpha, trajectory.theta)
    facts = motion_facts(problem, trajectory)
    changed = changed_angles(angles)[trajectory.on_path]
    near = [item.lower for item in verification.approaches if item.pair.obstacle]
    failed = [
        f"{c.name} ({in_mm(c.worst)})" if c.unit == "m" and c.worst > 0.0 else c.name
        for c in verification.checks
        if c.verdict is not Verdict.CERTIFIED
    ]
    faults: tuple[str, ...] = ()
    if verification.verdict is Verdict.CERTIFIED:
        faults = sample(problem, trajectory).faults
    return Outcome(
        problem.name, "", 0, "", str(verification.verdict), "; ".join(failed),
        judged.plan_s, judged.plan_s, verification.coverage,
        facts.changed_angles_mean_on_path,
        int(changed.max()) if changed.size else None,
        float(np.rad2deg(angles.max())), float(min(near)) if near else None,
        "; ".join(faults),
    )  # fmt: skip
