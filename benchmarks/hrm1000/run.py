"""Plans every problem: python -m benchmarks.hrm1000.run --per-family K --time-limit S.

A problem counts as solved if the verifier certifies the motion, the whole path is drawn
and planning took no more processor time than the limit, at which it is stopped. A
problem of the family `infeasible` is right if it is answered with `Infeasible`; how
many of the answers are proofs stands beside it. Strategies of this package and the
references of `references/` get the same problems, the same limit and the same judge.
Results are saved after every problem; `--resume` goes on where a run was ended.
"""

import argparse
import json
import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.common import surroundings
from benchmarks.hrm1000.families import FAMILIES
from benchmarks.hrm1000.generate import VERSION, generate
from benchmarks.hrm1000.references import REFERENCES, reference
from benchmarks.hrm1000.summary import Outcome, document, solved
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.kinematics import link_angles
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.strategies import STRATEGIES, strategy
from vdsm_pin.problem import Blocked, PlanningProblem
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.robot_model import RobotModel, load_robot
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict, Verification
from vdsm_pin.verification.verify import verify

WALL: Final = 6.0
"""Wall clock over time limit at which a refinement is stopped."""


def within_processor_time(clearance: LinkClearance, seconds: float) -> LinkClearance:
    """The same clearance function for so much processor time from now.

    Every method asks for clearances all the time.

    Returns:
        A function that raises `OutOfTime` once the time is over.
    """
    end = time.process_time() + seconds

    def timed(centres: FloatArray) -> FloatArray:
        if time.process_time() > end:
            raise OutOfTime(seconds)
        return clearance(centres)

    return timed


@dataclass(frozen=True)
class Attempt:
    """A motion, what the judge said, and the processor time of planning [s]."""

    trajectory: Trajectory
    verification: Verification
    plan_s: float


def by_strategy(
    problem: PlanningProblem, robot: RobotModel, name: str, limit: float
) -> Attempt:
    """One of this package's strategies, refined where the first plan is not certified.

    The proof of the first plan is not counted as planning, later ones are.
    """
    begin = time.process_time()
    clearance = within_processor_time(link_clearance(problem), limit)
    plan = strategy(name)(problem, clearance, 0.0)
    plan_s = time.process_time() - begin
    verification = verify(problem, plan.trajectory, robot)
    if verification.verdict is not Verdict.CERTIFIED:
        begin = time.process_time()
        result = plan_and_verify(problem, name, robot, time_limit=WALL * limit)
        plan_s = time.process_time() - begin
        plan, verification = result.plan, result.verification
    return Attempt(plan.trajectory, verification, plan_s)


def by_reference(
    problem: PlanningProblem, robot: RobotModel, name: str, limit: float
) -> Attempt:
    """One of the references, judged as it comes."""
    follow = reference(name)
    begin = time.process_time()
    clearance = within_processor_time(link_clearance(problem), limit)
    trajectory = follow(problem, robot, clearance)
    plan_s = time.process_time() - begin
    return Attempt(trajectory, verify(problem, trajectory, robot), plan_s)


def attempt(problem: PlanningProblem, key: tuple[str, int], name: str, limit: float):
    """Plan and judge one problem; times are of the processor.

    Args:
        problem: What is asked.
        key: Its family and number.
        name: A strategy or a reference.
        limit: Processor time of planning; [s].
    """
    robot = load_robot(problem.manipulator)
    plan = by_reference if name in REFERENCES else by_strategy
    begin = time.process_time()
    try:
        done = plan(problem, robot, name, limit)
    except Infeasible as error:
        answer = "not found" if isinstance(error, NoPlanFound) else "infeasible"
        answer = "out of time" if isinstance(error, OutOfTime) else answer
        spent = time.process_time() - begin
        return Outcome(problem.name, *key, name, answer, str(error), spent, spent)
    trajectory, verification = done.trajectory, done.verification
    angles = link_angles(trajectory.alpha, trajectory.theta)
    changed = (angles > TOLERANCES.changed_angle).sum(axis=1)[trajectory.on_path]
    near = [item.lower for item in verification.approaches if item.pair.obstacle]
    failed = [c.name for c in verification.checks if c.verdict is not Verdict.CERTIFIED]
    return Outcome(
        problem.name, *key, name, str(verification.verdict), "; ".join(failed),
        done.plan_s, time.process_time() - begin, verification.coverage,
        float(changed.mean()) if changed.size else None,
        float(np.rad2deg(angles.max())), float(min(near)) if near else None,
    )  # fmt: skip


def whole_or_nothing(problem: PlanningProblem) -> PlanningProblem:
    """The same problem for which a part of the path is no answer."""
    return replace(problem, tip_path=replace(problem.path, blocked=Blocked.FAIL))


def one(task: tuple[str, int, tuple[str, ...]], limit: float) -> list[Outcome]:
    """One problem by every method named."""
    family, number, names = task
    with tempfile.TemporaryDirectory() as folder:
        path = generate(Path(folder), family, number)
        problem = whole_or_nothing(read_problem(path).problem)
        return [attempt(problem, (family, number), name, limit) for name in names]


def known(base: Path | None, limit: float) -> list[Outcome]:
    """What an earlier run with the same limit and version came to."""
    if base is None or not base.with_suffix(".json").exists():
        return []
    data = json.loads(base.with_suffix(".json").read_text(encoding="utf-8"))
    same = data["settings"]["benchmark"] == VERSION
    if not same or data["settings"]["time_limit_s"] != limit:
        return []
    return [Outcome(**row) for row in data["outcomes"]]


def save(base: Path, outcomes: list[Outcome], limit: float, jobs: int) -> None:
    """The results as JSON and as a Markdown page."""
    around = surroundings()
    settings = {
        "benchmark": VERSION, "time_limit_s": limit, "processes": jobs, **around,
    }  # fmt: skip
    ordered = sorted(outcomes, key=lambda o: (o.method, o.family, o.number))
    data = {"settings": settings, "outcomes": [asdict(o) for o in ordered]}
    text = json.dumps(data, indent=1) + "\n"
    base.parent.mkdir(parents=True, exist_ok=True)
    base.with_suffix(".json").write_text(text, encoding="utf-8")
    page = document(ordered, settings)
    base.with_suffix(".md").write_text(page, encoding="utf-8")


def main() -> None:
    """Command line."""
    methods = (*STRATEGIES, *REFERENCES)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--per-family", type=int, default=112)
    parser.add_argument("--time-limit", type=float, default=10.0)
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append")
    parser.add_argument("--method", choices=methods, action="append")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--resume", action="store_true", help="skip what --save holds")
    parser.add_argument("--save", type=Path, help="base name of a .json and a .md file")
    options = parser.parse_args()
    names, limit = tuple(options.method or ["fewest"]), options.time_limit
    outcomes = known(options.save, limit) if options.resume else []
    have = {(o.family, o.number, o.method) for o in outcomes}
    tasks = []
    for number in range(options.first, options.first + options.per_family):
        for family in options.family or FAMILIES:
            left = tuple(n for n in names if (family, number, n) not in have)
            if left:
                tasks.append((family, number, left))
    with ProcessPoolExecutor(options.jobs) as pool:
        for found in pool.map(partial(one, limit=limit), tasks):
            outcomes += found
            for o in found:
                mark = "solved" if solved(o, limit) else "-"
                words = (o.problem, o.method, o.answer, mark, f"{o.plan_s:.2f} s")
                print(*words, o.reason[:120], flush=True)
            if options.save:
                save(options.save, outcomes, limit, options.jobs)


if __name__ == "__main__":
    main()
