"""Plans every problem: python -m benchmarks.hrm1000.run --per-family K --time-limit S.

A problem counts as solved if the plan is certified, draws the whole path and was made
within the time limit (processor time of planning; the proof is timed beside it). A
problem of the family `infeasible` is right if it is answered with `Infeasible`; how
many of the answers are proofs stands beside it. Results are saved after every round of
one problem a family, so a run may be ended at any time.
"""

import argparse
import json
import platform
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import chain, repeat
from pathlib import Path
from typing import Any, Final

import numba
import numpy as np

import vdsm_pin
from benchmarks.hrm1000.families import FAMILIES
from benchmarks.hrm1000.generate import VERSION, generate
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.kinematics import link_angles
from vdsm_pin.planner.budget import within_time
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.robot_model import load_robot
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

WALL: Final = 4.0
"""Wall clock over time limit at which planning is stopped; the limit itself is held
against the processor's time, as the machine may have other work."""


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


def attempt(problem: PlanningProblem, family: str, name: str, wall_s: float) -> Outcome:
    """Plan and verify one problem; times are of the processor, not of the wall clock.

    Args:
        problem: What is asked.
        family: Its family.
        name: The strategy.
        wall_s: When planning is stopped by the wall clock; [s].
    """
    robot = load_robot(problem.manipulator)
    clearance = link_clearance(problem)
    begin = time.process_time()
    nothing = (0.0, float("nan"), float("nan"), float("nan"))
    try:
        plan = strategy(name)(problem, within_time(clearance, wall_s), 0.0)
        plan_s = time.process_time() - begin
        verification = verify(problem, plan.trajectory, robot)
        if verification.verdict is not Verdict.CERTIFIED:
            result = plan_and_verify(problem, name, robot, time_limit=wall_s)
            plan_s = time.process_time() - begin
            plan, verification = result.plan, result.verification
    except Infeasible as error:
        answer = "not found" if isinstance(error, NoPlanFound) else "infeasible"
        answer = "out of time" if isinstance(error, OutOfTime) else answer
        spent = time.process_time() - begin
        return Outcome(
            problem.name, family, name, answer, str(error), spent, spent, *nothing
        )
    trajectory = plan.trajectory
    angles = link_angles(trajectory.alpha, trajectory.theta)
    changed = (angles > TOLERANCES.changed_angle).sum(axis=1)[trajectory.on_path]
    near = [item.lower for item in verification.closest if item.pair.obstacle]
    return Outcome(
        problem.name, family, name, str(verification.verdict), "",
        plan_s, time.process_time() - begin, verification.coverage,
        float(changed.mean()), float(np.rad2deg(angles.max())),
        min(near, default=np.inf),
    )  # fmt: skip


def one(
    family: str, number: int, names: tuple[str, ...], limit: float
) -> list[Outcome]:
    """One problem by every strategy named."""
    with tempfile.TemporaryDirectory() as folder:
        path = generate(Path(folder), family, number)
        problem = read_problem(path).problem
        return [attempt(problem, family, name, WALL * limit) for name in names]


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


def processor() -> str:
    """Name of the processor where the system tells."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    named = [line.split(":", 1)[1].strip() for line in lines if "model name" in line]
    return named[0] if named else platform.processor()


def header(settings: dict[str, Any]) -> str:
    """What the table rests on, as Markdown."""
    one_line = ", ".join(f"{key} {value}" for key, value in settings.items())
    return (
        f"# HRM-1000, the first {settings['per_family']} of each family\n\n"
        f"{one_line}. Times are processor seconds of planning, without the proof; the "
        "machine had other work. Misses by name are in the JSON file.\n"
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--per-family", type=int, default=112)
    parser.add_argument("--time-limit", type=float, default=10.0)
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append")
    parser.add_argument("--strategy", action="append")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--save", type=Path, help="base name of a .json and a .md file")
    options = parser.parse_args()
    names, limit = tuple(options.strategy or ["fewest"]), options.time_limit
    families = tuple(options.family or FAMILIES)
    outcomes: list[Outcome] = []
    tasks = [
        (family, number) for number in range(options.per_family) for family in families
    ]
    with ProcessPoolExecutor(options.jobs) as pool:
        ended = pool.map(one, *zip(*tasks, strict=True), repeat(names), repeat(limit))
        for outcome in chain.from_iterable(ended):
            outcomes.append(outcome)
            mark = "solved" if solved(outcome, limit) else "-"
            spent = f"{outcome.plan_s:.2f} s"
            words = (outcome.problem, outcome.strategy, outcome.answer, mark, spent)
            print(*words, outcome.reason[:120], flush=True)
            if options.save and len(outcomes) % (len(families) * len(names)) == 0:
                save(options.save, outcomes, limit, options.jobs)
    print(table(outcomes, limit))


def save(base: Path, outcomes: list[Outcome], limit: float, jobs: int) -> None:
    """The results as JSON and as a Markdown table with its header."""
    settings = {
        "version": vdsm_pin.__version__, "benchmark": VERSION,
        "python": platform.python_version(), "machine": platform.machine(),
        "numpy": np.__version__, "numba": numba.__version__,
        "processor": processor(), "processes": jobs,
        "per_family": min(Counter(o.family for o in outcomes).values()),
        "time_limit_s": limit,
    }  # fmt: skip
    data = {"settings": settings, "outcomes": [asdict(o) for o in outcomes]}
    base.with_suffix(".json").write_text(json.dumps(data, indent=1) + "\n")
    text = f"{header(settings)}\n{table(outcomes, limit)}\n"
    base.with_suffix(".md").write_text(text)


if __name__ == "__main__":
    main()
