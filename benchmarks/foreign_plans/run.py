"""Judge OMPL's plans: python -m benchmarks.foreign_plans.run --per-set K --save FILE.

Needs the extra `ompl`, and VDSM_MOTION_BENCH_MAKER in the environment (see
docs/robots.md). OMPL's random numbers begin anew with each plan: the same versions
give the same plan where the time suffices. `--plans` keeps them, `--again` judges
them.
"""

import argparse
import json
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Final

from benchmarks.foreign_plans.judges import Judged, Plan, judge
from benchmarks.foreign_plans.problems import ARMS, ROBOTS, Problem, problems, source
from benchmarks.foreign_plans.sampled import Sampled
from benchmarks.foreign_plans.summary import document
from vdsm_pin.app.stated_problem import problem_text
from vdsm_pin.errors import InvalidInput
from vdsm_pin.problem.scene import Scene
from vdsm_pin.robots.cell import Cell, read_cell
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.urdf import read_robot

RESOLUTIONS: Final = (0.01, 0.005)
"""OMPL's default, and the one that the benchmark's authors use; [-]."""


def outcomes(
    name: str, per_set: int, stored: dict[tuple[str, str, int], list[Plan]]
) -> Iterator[tuple[Problem, list[Judged]]]:
    """Every problem of a robot and its plans, judged.

    Args:
        name: Of the robot.
        per_set: How many problems of each set.
        stored: Plans by robot, set and number; empty to plan.
    """
    folder = source(name)
    urdf, srdf = folder / f"{name}.urdf", folder / f"{name}.srdf"
    files = RobotFiles(urdf, srdf, group=ARMS[name])
    robot = read_robot(files)
    with tempfile.TemporaryDirectory() as aside:
        for problem in problems(name, per_set, Path(aside)):
            sampled = Sampled(name, problem.scene)
            if tuple(joint.name for joint in robot.joints) != sampled.joints:
                message = f"{name}: Pinocchio orders the joints otherwise"
                raise InvalidInput(message)
            key = name, problem.family, problem.number
            plans = stored.get(key, []) if stored else _planned(problem, sampled)
            text = problem_text(Cell(robot, Scene()), files, problem.scene, Path(aside))
            file = Path(aside) / "cell.yaml"
            file.write_text(text, encoding="utf-8")
            asked = read_cell(file)
            yield problem, [judge(plan, sampled, asked) for plan in plans]


def _planned(problem: Problem, sampled: Sampled) -> list[Plan]:
    """OMPL's plans at each resolution; none where it finds none."""
    from benchmarks.foreign_plans.planner import Planner

    ends, found = problem.ends(sampled.joints), []
    for resolution in RESOLUTIONS:
        rows = Planner(sampled, resolution).plan(*ends)
        if rows is not None:
            named = problem.robot, problem.family, problem.number, resolution
            found.append(Plan(*named, rows.tolist()))
    return found


def _stored(path: Path | None) -> dict[tuple[str, str, int], list[Plan]]:
    """Plans that `--plans` kept."""
    found: dict[tuple[str, str, int], list[Plan]] = {}
    if path is not None:
        for fields in json.loads(path.read_text(encoding="utf-8")):
            plan = Plan(**fields)
            key = plan.robot, plan.family, plan.number
            found.setdefault(key, []).append(plan)
    return found


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", choices=ROBOTS, action="append")
    parser.add_argument("--per-set", type=int, default=20)
    parser.add_argument("--save", type=Path, help="a Markdown page")
    parser.add_argument("--plans", type=Path, help="a JSON file to keep plans in")
    parser.add_argument("--again", type=Path, help="judge the plans of such a file")
    return parser.parse_args()


def main() -> None:
    """Plan and judge, and write the page."""
    asked = options()
    stored = _stored(asked.again)
    judged, unplanned = list[Judged](), list[Problem]()
    for name in asked.robot or ROBOTS:
        for problem, found in outcomes(name, asked.per_set, stored):
            judged += found
            unplanned += [problem] * (len(RESOLUTIONS) - len(found))
            for one in found:
                words = name, problem.family, problem.number, one.plan.resolution
                spent = f"{one.milliseconds:.1f} ms"
                print(*words, one.verdict, spent, one.fault, flush=True)
            if asked.plans:
                text = json.dumps([asdict(one.plan) for one in judged])
                asked.plans.write_text(text, encoding="utf-8")
    page = document(judged, unplanned)
    print(page)
    if asked.save:
        asked.save.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
