"""Plans every problem: python -m benchmarks.hrm1000.run --per-family K --time-limit S.

A problem counts as solved if the plan is certified, draws the whole path and was made
within the time limit (planning alone; the proof is timed beside it). A problem of the
family `infeasible` is right if it is answered with `Infeasible`.
"""

import argparse
import json
import platform
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import vdsm_pin
from benchmarks.hrm1000.families import FAMILIES
from benchmarks.hrm1000.generate import VERSION, generate
from vdsm_pin.errors import Infeasible, NoPlanFound
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.kinematics import link_angles
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.robot_model import load_robot
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance


@dataclass(frozen=True)
class Outcome:
    """One problem, one strategy."""

    problem: str
    family: str
    strategy: str
    answer: str
    reason: str
    plan_s: float
    total_s: float
    coverage: float
    changed: float
    psi_deg: float
    clearance_m: float


def attempt(problem: PlanningProblem, family: str, name: str) -> Outcome:
    """Plan and verify one problem."""
    robot, clearance = load_robot(problem.manipulator), link_clearance(problem)
    begin = time.perf_counter()
    nothing = (0.0, float("nan"), float("nan"), float("nan"))
    try:
        strategy(name)(problem, clearance, 0.0)
        plan_s = time.perf_counter() - begin
        result = plan_and_verify(problem, name, robot)
    except Infeasible as error:
        answer = "not found" if isinstance(error, NoPlanFound) else "infeasible"
        spent = time.perf_counter() - begin
        return Outcome(
            problem.name, family, name, answer, str(error), spent, spent, *nothing
        )
    trajectory, verification = result.plan.trajectory, result.verification
    angles = link_angles(trajectory.alpha, trajectory.theta)
    changed = (angles > TOLERANCES.changed_angle).sum(axis=1)[trajectory.on_path]
    near = [item.lower for item in verification.closest if item.pair.obstacle]
    return Outcome(
        problem.name, family, name, str(verification.verdict), "",
        plan_s, time.perf_counter() - begin - plan_s, verification.coverage,
        float(changed.mean()), float(np.rad2deg(angles.max())),
        min(near, default=np.inf),
    )  # fmt: skip


def solved(outcome: Outcome, limit: float) -> bool:
    """Certified, whole and in time; for the family `infeasible`, refused."""
    if outcome.family == "infeasible":
        return outcome.answer in ("infeasible", "not found")
    whole = outcome.coverage >= 1.0 - TOLERANCES.on_path_length
    return outcome.answer == "certified" and whole and outcome.plan_s <= limit


def table(outcomes: list[Outcome], limit: float) -> str:
    """The results family by family as Markdown."""
    lines = [
        "| family | strategy | problems | solved or rightly refused | not found "
        "| infeasible | changed angles | largest psi [deg] | least clearance [mm] "
        "| median [s] | p95 [s] |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for family, name in sorted({(o.family, o.strategy) for o in outcomes}):
        own = [o for o in outcomes if (o.family, o.strategy) == (family, name)]
        done = [o for o in own if solved(o, limit)]
        answers = Counter(o.answer for o in own)
        times = [o.plan_s for o in own]
        figures = ["-", "-", "-"]
        if done and family != "infeasible":
            figures = [
                f"{np.mean([o.changed for o in done]):.2f}",
                f"{max(o.psi_deg for o in done):.1f}",
                f"{1e3 * min(o.clearance_m for o in done):.2f}",
            ]
        cells = [
            family, name, len(own), f"{len(done)} ({100 * len(done) / len(own):.0f} %)",
            answers["not found"], answers["infeasible"], *figures,
            f"{np.median(times):.2f}", f"{np.percentile(times, 95):.2f}",
        ]  # fmt: skip
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--per-family", type=int, default=112)
    parser.add_argument("--time-limit", type=float, default=10.0)
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append")
    parser.add_argument("--strategy", action="append")
    parser.add_argument("--save", type=Path, help="base name of a .json and a .md file")
    options = parser.parse_args()
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory() as folder:
        for family in options.family or FAMILIES:
            for number in range(options.per_family):
                path = generate(Path(folder) / family, family, number)
                problem = read_problem(path).problem
                for name in options.strategy or ["fewest"]:
                    outcome = attempt(problem, family, name)
                    outcomes.append(outcome)
                    mark = "solved" if solved(outcome, options.time_limit) else ""
                    words = (outcome.problem, name, outcome.answer, mark)
                    spent = f"{outcome.plan_s:.2f} s"
                    print(*words, spent, outcome.reason[:120], flush=True)
    text = table(outcomes, options.time_limit)
    print(text)
    if options.save:
        machine = {
            "version": vdsm_pin.__version__, "benchmark": VERSION,
            "python": platform.python_version(), "machine": platform.machine(),
            "numpy": np.__version__, "time_limit_s": options.time_limit,
        }  # fmt: skip
        data = {"settings": machine, "outcomes": [asdict(o) for o in outcomes]}
        options.save.with_suffix(".json").write_text(json.dumps(data, indent=1) + "\n")
        options.save.with_suffix(".md").write_text(text + "\n")


if __name__ == "__main__":
    main()
