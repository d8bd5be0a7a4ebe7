"""Judge OMPL's plans: python -m benchmarks.foreign_plans.run --per-set K --save FILE.

Where a problem's own ends collide with a hull for each mesh, several hulls stand for
it. Needs the extra `ompl`, and VDSM_MOTION_BENCH_MAKER in the environment (see
docs/robots.md). OMPL's random numbers begin anew with each plan: the same versions
give the same plan where the time suffices. `--plans` keeps them, `--again` judges
them.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.foreign_plans.judges import Judged, Plan, judge
from benchmarks.foreign_plans.problems import ARMS, ROBOTS, Problem, problems, source
from benchmarks.foreign_plans.sampled import LinkHulls, Sampled
from benchmarks.foreign_plans.summary import document
from vdsm_pin.app.stated_problem import problem_text
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.problem.scene import Scene
from vdsm_pin.robots.cell import Cell, read_cell
from vdsm_pin.robots.files import MeshCover, RobotFiles
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.urdf import read_robot

RESOLUTIONS: Final = (0.01, 0.005)
"""OMPL's default, and the one that the benchmark's authors use; [-]."""

PARTS: Final = 8
"""Hulls of a mesh where the problem's own ends collide as one hull of each."""


@dataclass(frozen=True)
class Links:
    """A robot with one or several hulls for each mesh of its links.

    Args:
        name: Of the robot.
        parts: So many.
    """

    name: str
    parts: int

    @cached_property
    def files(self) -> RobotFiles:
        """Its files and what is asked of them."""
        folder, name = source(self.name), self.name
        files = folder / f"{name}.urdf", folder / f"{name}.srdf"
        cover = MeshCover("parts", self.parts) if self.parts > 1 else MeshCover()
        return RobotFiles(*files, group=ARMS[name], solids=cover)

    @cached_property
    def robot(self) -> Robot:
        """As the proof reads it."""
        return read_robot(self.files)

    @cached_property
    def _hulls(self) -> LinkHulls | None:
        """What stands for the links; None where their meshes say it."""
        if self.parts == 1:
            return None
        found: dict[str, list[FloatArray]] = {}
        for body in self.robot.bodies:
            hulls = [one.points for one in body.pieces if isinstance(one, Hull)]
            if len(hulls) < len(body.pieces):
                message = f"link {body.name!r} has a solid that is no hull"
                raise InvalidInput(message)
            found[body.name] = hulls
        return found

    def sampled(self, problem: Problem) -> Sampled:
        """The oracle of a problem.

        Raises:
            InvalidInput: If Pinocchio orders the joints otherwise than the proof.
        """
        sampled = Sampled(self.name, problem.scene, self._hulls)
        if tuple(joint.name for joint in self.robot.joints) != sampled.joints:
            message = f"{self.name}: Pinocchio orders the joints otherwise"
            raise InvalidInput(message)
        return sampled

    def cell(self, problem: Problem, aside: Path) -> Cell:
        """The problem as the proof reads it, from a file."""
        cell = Cell(self.robot, Scene())
        text = problem_text(cell, self.files, problem.scene, aside)
        file = aside / "cell.yaml"
        file.write_text(text, encoding="utf-8")
        return read_cell(file)


def outcomes(
    name: str, per_set: int, stored: dict[tuple[str, str, int], list[Plan]]
) -> Iterator[tuple[Problem, list[Judged]]]:
    """Every problem of a robot and its plans, judged.

    Args:
        name: Of the robot.
        per_set: How many problems of each set.
        stored: Plans by robot, set and number; empty to plan.
    """
    coarse, fine = Links(name, 1), Links(name, PARTS)
    with tempfile.TemporaryDirectory() as aside:
        for problem in problems(name, per_set, Path(aside)):
            links, sampled = coarse, coarse.sampled(problem)
            if any(sampled.collides(q) for q in problem.ends(sampled.joints)):
                links, sampled = fine, fine.sampled(problem)
            key = name, problem.family, problem.number
            if stored:
                plans = [one for one in stored.get(key, []) if one.parts == links.parts]
            else:
                plans = _planned(problem, sampled, links.parts)
            asked = links.cell(problem, Path(aside))
            yield problem, [judge(plan, sampled, asked) for plan in plans]


def _planned(problem: Problem, sampled: Sampled, parts: int) -> list[Plan]:
    """OMPL's plans at each resolution; none where it finds none."""
    from benchmarks.foreign_plans.planner import Planner

    ends, found = problem.ends(sampled.joints), []
    for resolution in RESOLUTIONS:
        rows = Planner(sampled, resolution).plan(*ends)
        if rows is not None:
            named = problem.robot, problem.family, problem.number, resolution
            found.append(Plan(*named, rows.tolist(), parts))
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
