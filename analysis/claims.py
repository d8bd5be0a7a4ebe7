"""docs/claims.md: what the paper claims, and what was measured of it.

    python analysis/claims.py --per-family 40

The words are here, every number is measured by this script.
"""

import argparse
import gc
import math
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

import numpy as np
from paper_figures.runs import SCENES, Run, Runs
from paper_table import touching_error
from result_files import at_least, at_most, table_lines

from benchmarks.hrm1000.families import FAMILIES
from benchmarks.hrm1000.generate import VERSION, generate
from vdsm_pin.errors import Infeasible
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.impossible.bounds import least_changed
from vdsm_pin.planner.paper import joint_paths, pipeline
from vdsm_pin.planner.paper.online import OnlineRule
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.report import words
from vdsm_pin.report.motion_facts import changed_angles, motion_facts
from vdsm_pin.units import percent, quantity
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "claims.md"
BLOCKED: Final = tuple(scene for scene in SCENES if scene != "free")
CALLS: Final = 20_000
"""Calls of one step whose times are taken, scene by scene."""
ALLOWED_US: Final = 1_000.0
"""Time of one step in 999 of 1,000 calls that counts as real-time; [us]."""
EXPERIMENT_DEG: Final = 0.3
"""Joint error of the paper's experiment, most of the time (section 7); [deg]."""


@dataclass(frozen=True)
class Claim:
    """One claim of the paper.

    Args:
        words: What is claimed, and in which section.
        verdict: What came of it, in a word or two.
        number: What was measured.
        command: How to see it.
    """

    words: str
    verdict: str
    number: str
    command: str


def solvable(runs: Runs) -> Claim:
    """Every scene of the paper is planned and certified."""
    drawn = []
    for scene in SCENES:
        run = runs(scene, "paper")
        assert run.verification.verdict in (Verdict.CERTIFIED, Verdict.INCOMPLETE)
        drawn.append(f"{scene} {percent(run.verification.coverage)}")
    return Claim(
        "solvable (1)", "holds in its scenes",
        f"proved motions in all; drawn: {', '.join(drawn)}",
        "`vdsm plan paper/obs1 --strategy paper --out out/obs1`",
    )  # fmt: skip


def real_time(times: dict[str, FloatArray]) -> Claim:
    """Times of one step, tip position in, joint values and cable lengths out."""
    every = np.concatenate(list(times.values()))
    rare = {scene: np.percentile(rows, 99.9, axis=0) for scene, rows in times.items()}
    slowest = max(rare, key=lambda scene: float(rare[scene][0]))
    (own, wall), median = rare[slowest], float(np.median(every[:, 0]))
    return Claim(
        "real-time (1)",
        "holds on a core of its own" if own <= ALLOWED_US else "does not hold",
        "one `step(tip)` to 17 joint values and 24 cable lengths: median "
        f"{at_most(median)} µs ({at_least(1e3 / median)} kHz); in 999 of 1,000 calls "
        f"of the slowest scene ({slowest}) at most {at_most(own)} µs of processor "
        f"time, {at_most(wall)} µs by the clock with other work beside; "
        f"{len(every):,} calls",
        "`planner.paper.online.OnlineRule`",
    )


def step_times(runs: Runs) -> dict[str, FloatArray]:
    """Times of single steps, scene by scene; each answer is the plan's row.

    Returns:
        By the processor's clock and by the wall's, shape (CALLS, 2); [us].
    """
    found = {}
    for scene in SCENES:
        plan = runs(scene, "paper").plan
        assert plan.steps is not None
        rule, route = OnlineRule.of(plan), plan.steps.route
        tips, sides = route.tip_path.points, route.side.tolist()
        for k, side in enumerate(sides):
            told = rule.step(tips[k], side)
            assert np.array_equal(told.joints, plan.trajectory.joints[k])
            assert np.array_equal(told.cables, plan.cable_lengths[k])
        times = np.zeros((CALLS, 2))
        gc.collect()
        gc.freeze()  # what is there already is not looked through again
        for k in range(CALLS):
            row = k % len(sides)
            begin, own = time.perf_counter_ns(), time.thread_time_ns()
            rule.step(tips[row], sides[row])
            times[k, 0] = time.thread_time_ns() - own
            times[k, 1] = time.perf_counter_ns() - begin
        found[scene] = times / 1e3
    return found


def intuitive() -> Claim:
    """Not a matter of numbers."""
    return Claim(
        "intuitive, geometric (1)", "holds",
        "seven steps with a drawing each, on one page",
        "`vdsm explain paper/obs1 --waypoint 458 --out out/explain`",
    )  # fmt: skip


def avoidance(runs: Runs) -> tuple[Claim, Claim]:
    """The exact motion, and the motion with the errors of the experiment."""
    kept, lost, survived = [], [], []
    box = ErrorBox(joint=float(np.deg2rad(EXPERIMENT_DEG)))
    for scene in BLOCKED:
        run = runs(scene, "paper")
        kept.append(f"{scene} {words.at_least(run.verification.min_clearance)}")
        judged = verify(run.problem.under(box), run.trajectory)
        worst = min(judged.counterexamples, key=lambda one: one.clearance)
        lost.append(f"{scene} {words.at_most(worst.clearance, worst.deeper)}")
        error = touching_error(run.refinement)
        survived.append(f"{scene} {quantity(error, 'rad', math.floor)}")
    exact = Claim(
        "collision-free at every waypoint (6.3)", "holds, and between them",
        f"proved at every instant: {', '.join(kept)}",
        "`vdsm verify paper/obs1 --trajectory out/obs1/trajectory.csv --out out/obs1`",
    )  # fmt: skip
    never = Claim(
        '"collision will never happen" (6.3)',
        f"does not hold at ±{EXPERIMENT_DEG}°",
        f"a motion within ±{EXPERIMENT_DEG}° in every joint (the paper's experiment) "
        f"comes to: {', '.join(lost)}; no contact is proved up to "
        f"{', '.join(survived)}",
        f"`vdsm verify … --joint-error-deg {EXPERIMENT_DEG}`",
    )  # fmt: skip
    return exact, never


def dimensions(runs: Runs) -> Claim:
    """Lifting gives back the links and the rail."""
    worst = 0.0
    for scene in SCENES:
        run = runs(scene, "paper")
        spans = np.linalg.norm(np.diff(run.centres, axis=1), axis=2)
        off = np.abs(spans - run.problem.manipulator.link_lengths).max()
        rail = np.abs(run.centres[:, 0, 1:]).max()
        worst = max(worst, float(off), float(rail))
    return Claim(
        "variability of dimension, 3D-2D-3D (1)", "holds",
        f"links keep their length and the base its rail within {words.at_most(worst)}",
        "`vdsm explain …`, Steps 2 and 6",
    )  # fmt: skip


def constant_ratio(runs: Runs) -> Claim:
    """Where nothing is in the way every path is the tip's, scaled."""
    run = runs("free", "paper")
    planar = run.centres[..., 1:]
    scaled = run.problem.manipulator.ratios[:, None] * planar[:, -1:]
    worst = float(np.abs(planar - scaled).max())
    exactly = f"within {words.at_most(worst)}" if worst > 0.0 else "to the last bit"
    return Claim(
        "constant ratio (1)", "holds without obstacles",
        f"Pᵢ = kᵢ,₉ P₉ {exactly}; in Step 5 for joints outside the region",
        "`vdsm plan paper/free --strategy paper --out out/free`",
    )  # fmt: skip


def fewest(runs: Runs) -> Claim:
    """Changed link angles by length, and where they are proved minimal."""
    parts = []
    for scene in BLOCKED:
        means, minimal = [], []
        for strategy in ("paper", "fewest"):
            run = runs(scene, strategy)
            facts = motion_facts(run.problem, run.trajectory)
            means.append(f"{facts.changed_angles_mean_on_path:.2f}")
            minimal.append("{} of {}".format(*proved_minimal(run)))
        parts.append(f"{scene} {' / '.join(means)} ({' / '.join(minimal)})")
    return Claim(
        '"as few link angles as possible" (1, 4.1)', "does not hold",
        "mean over the length drawn, `paper` / `fewest` (waypoints where the number is "
        f"proved minimal): {'; '.join(parts)}",
        "`vdsm plan paper/obs1 --strategy fewest --out out/few`",
    )  # fmt: skip


def proved_minimal(run: Run) -> tuple[int, int]:
    """At how many waypoints on the path no posture with fewer changed angles exists."""
    rows = run.trajectory.on_path
    tips = run.plan.tip_path.points[rows]
    clearance = link_clearance(run.problem)
    least = least_changed(run.problem, clearance, np.ascontiguousarray(tips))
    changed = changed_angles(run.psi[rows])
    assert (changed >= least).all()
    return int((changed == least).sum()), len(changed)


def simplification(times: dict[str, FloatArray]) -> Claim:
    """What is left to choose after the projection."""
    free, blocked = (np.median(times[scene][:, 0]) for scene in ("free", "obs1"))
    return Claim(
        "simplification (1)", "holds",
        "17 unknowns and 3 equations become one choice for each joint in the region, "
        f"a point on its boundary; a step takes {at_most(free)} µs without obstacles "
        f"and {at_most(blocked)} µs round obs1",
        "`python analysis/claims.py`",
    )  # fmt: skip


@dataclass
class Counts:
    """How often a step was carried out in one plan."""

    solves: int = 0
    sections: int = 0
    rows: int = 0


@contextmanager
def counted() -> Iterator[Counts]:
    """Count rounds of Steps 2-7 and choices of line and region."""
    counts, solve, best = Counts(), pipeline.solve, joint_paths.best_rule

    def solving(*arguments: Any) -> Any:
        counts.solves += 1
        counts.rows += len(arguments[2])
        return solve(*arguments)

    def choosing(*arguments: Any) -> Any:
        counts.sections += len(arguments[1].numbers)
        return best(*arguments)

    with (
        patch.object(pipeline, "solve", solving),
        patch.object(joint_paths, "best_rule", choosing),
    ):
        yield counts


def iterations(runs: Runs) -> tuple[Claim, list[str]]:
    """Which step goes round in circles, and how often, scene by scene."""
    head = ("scene",
            "times Steps 2-7 are carried out (waypoints in all / in the plan)",
            "lines and regions tried for Step 5",
            "rounds of planning and proving")  # fmt: skip
    lines = []
    for scene in SCENES:
        problem = runs.problem(scene)
        with counted() as counts:
            found = plan_and_verify(problem, "paper")
        rows = found.plan.trajectory.n_samples
        solves = f"{counts.solves} ({counts.rows} / {rows})"
        lines.append((scene, solves, counts.sections, len(found.rounds)))
    claim = Claim(
        '"non-iterative", "at one time" (1)', "holds for Steps 1-3, 6 and 7",
        "these are closed forms; Steps 4 and 5 try lines and regions, across the rail "
        "the bend is found by 12 trials and 24 bisections a waypoint, twice where a "
        "joint's neighbours share in it, and waypoints are inserted (table below)",
        "`python analysis/claims.py`",
    )  # fmt: skip
    return claim, table_lines(head, lines)


def generality(per_family: int) -> tuple[Claim, list[str]]:
    """How many of HRM-1000's problems the paper's own method solves."""
    lines: list[tuple[str, str]] = []
    total = solved = 0
    with tempfile.TemporaryDirectory() as folder:
        for family in FAMILIES:
            if family == "infeasible":
                continue
            count = sum(
                draws_all(generate(Path(folder) / family, family, number))
                for number in range(per_family)
            )
            lines.append((family, f"{count} of {per_family}"))
            total, solved = total + per_family, solved + count
    claim = Claim(
        '"all kinds of obstacle environments" (1)', "does not hold",
        f"of {total} problems of HRM-1000's feasible families the rule draws {solved} "
        f"whole ({percent(solved / total)})",
        f"`python analysis/claims.py --per-family {per_family}`",
    )  # fmt: skip
    return claim, table_lines(("family", "solved by `paper`"), lines)


def draws_all(file: Path) -> bool:
    """Whether the paper's rule draws the whole path, certified."""
    problem = read_problem(file)
    try:
        found = plan_and_verify(problem, "paper")
    except Infeasible:
        return False
    return found.verification.verdict is Verdict.CERTIFIED


def page(claims: list[Claim], rounds: list[str], families: list[str]) -> str:
    """The page."""
    return "\n".join(
        [
            "# What the paper claims, measured",
            "",
            "Jia et al., *Variable Dimensional Scaling Method*, Machines 2022,",
            "10(11), 1030. Numbers in brackets are the paper's sections. Made by",
            "`make claims`, which measures every number; times depend on the machine.",
            "Departures from the text are in [paper.md](paper.md).",
            "",
            *table_lines(
                ("claim", "verdict", "measured", "how to see it"), map(astuple, claims)
            ),
            "",
            "## Which step iterates",
            "",
            *rounds,
            "",
            "A plan whose joints turn too fast between two waypoints gets more of",
            "them, and Steps 2 to 7 are carried out again for all. Along the rail",
            "(obs1, obs2) all combinations of auxiliary line and danger region are",
            "tried on the waypoints wanted on each side.",
            "",
            "## Generality, family by family",
            "",
            f"HRM-1000, version {VERSION}: seeded problems for the paper's arm and",
            "arms of 4, 12 and 20 links; the whole path is demanded.",
            "",
            *families,
            "",
        ]
    )


def main() -> None:
    """Measure everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--per-family", type=int, default=40)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    runs = Runs()
    times = step_times(runs)
    non_iterative, rounds = iterations(runs)
    general, families = generality(options.per_family)
    claims = [
        solvable(runs),
        real_time(times),
        intuitive(),
        *avoidance(runs),
        dimensions(runs),
        constant_ratio(runs),
        fewest(runs),
        simplification(times),
        non_iterative,
        general,
    ]
    options.out.write_text(page(claims, rounds, families), encoding="utf-8")
    print(options.out.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
