"""The methods that the paper compares itself with, on its scenes, by one judge.

    PYTHONPATH=. python analysis/baselines.py --out DIR [--sample K] [--log FILE]

Writes `baselines.json` and `baselines.md`: for each method and scene whether the motion
is certified, and what it is like; with `--sample K` also the first K problems of each
feasible family of HRM-1000, for the slow methods no more than `--slow`; as many as
begin within `--minutes`. With `--log` each answer is kept as it comes, and a run that
was ended goes on from there. Methods are those of `benchmarks/hrm2000/references`.
"""

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from itertools import product
from math import inf
from pathlib import Path
from statistics import median
from typing import Final

# Two threads would wait for each other at the network's small matrices, for seven times
# the processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import yaml
from result_files import REPORTS, at_least, at_most, table_lines, write_table

from benchmarks.hrm1000.families import FAMILIES
from benchmarks.hrm1000.generate import generate
from benchmarks.hrm2000.attempt import Outcome, attempt
from benchmarks.hrm2000.references import REFERENCES
from benchmarks.hrm2000.references.intelligent import GENERATIONS, MEMBERS
from vdsm_pin.io.problem_file import built_in_text
from vdsm_pin.units import MM_PER_M

SCENES: Final = ("free", "obs1", "obs2", "obs3")
METHODS: Final = {
    "paper": "this package: the paper's seven steps",
    "fewest": "this package: as few changed link angles as it finds",
    "pseudo-inverse": "[1]",
    "damped-least-squares": "[2,3], with a push off obstacles in the null space",
    "gradient-projection": "[4,5]",
    "differential-evolution": "[11,12]; evolution and swarms go waypoint by waypoint, "
    "near the one before",
    "vlv-de": "[25], evolution of vectors of any length: how many links turn",
    "particle-swarm": "[9,10]",
    "genetic": "[13]",
    "simulated-annealing": "[14]",
    "fireflies": "[15-17]",
    "bee-colony": "[18]",
    "neural-network": "[6-8], two layers, trained on 40,000 postures of the arm, once "
    "for each arm",
    "follow-the-leader": '[21-23], "repeated path"',
    "spiral": '[24], "ridge line": all joints on a spiral through the tip',
    "mda-rrt": "[23]: the tip's way to the path by a tree, the arm on its trail",
    "pink-barriers": "not in the paper: a quadratic programme a row, clearances as its "
    "barriers",
    "ompl-rrt-connect": "not in the paper: OMPL's tree to the path, then the path",
}
"""Methods by name, with the number of the paper's reference."""

LIBRARIES: Final = ("pink", "daqp", "ompl", "scipy")
"""What the methods are made with."""

LIMIT: Final = 60.0
"""Processor time for one plan of a paper's scene; [s]."""
SAMPLE_LIMIT: Final = 5.0
"""The same for a problem of the sample; [s]."""
S_PER_HOUR: Final = 3600.0
PER_FAMILY: Final = 112
"""Problems of HRM-1000 in a family."""
INTELLIGENT: Final = tuple(
    name for name, where in REFERENCES.items() if where.startswith("intelligent:")
)
SLOW: Final = (*INTELLIGENT, "neural-network")
"""What takes nine tenths of the time of all."""
COARSE_MM: Final = 20.0
"""Spacing of waypoints for these; [mm]. Problems of HRM-1000 have it from the start."""


@dataclass(frozen=True)
class Line:
    """One method on one scene; numbers are None where there is no motion."""

    method: str
    scene: str
    answer: str
    reason: str
    seconds: float
    drawn: float
    psi_deg: float | None
    changed: float | None
    clearance_mm: float | None


Ask = Callable[[str, str], Line]
"""The answer of a method for a problem, both by name."""


def kept(ask: Ask, log: Path | None) -> Ask:
    """Answers that stand in a file already, or are added to it."""
    if log is None:
        return ask
    old = log.read_text("utf-8").splitlines() if log.exists() else []
    answers = [Line(**json.loads(text)) for text in old]
    known = {(answer.method, answer.scene): answer for answer in answers}

    def answered(method: str, scene: str) -> Line:
        if (method, scene) in known:
            return known[method, scene]
        answer = ask(method, scene)
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(answer)) + "\n")
        return answer

    return answered


def asked(folder: Path, method: str, scene: str) -> Line:
    """One method on one scene of the paper, or on one problem of HRM-1000."""
    family, _, number = scene.rpartition("-")
    if scene not in SCENES:
        file = generate(folder / family, family, int(number))
        return line(scene, attempt(file, (family, int(number)), method, SAMPLE_LIMIT))
    file = folder / f"{scene}-{method}.yaml"
    data = yaml.safe_load(built_in_text(f"paper/{scene}"))
    if method in INTELLIGENT:
        data["tip_path"]["spacing"] = COARSE_MM
    file.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return line(scene, attempt(file, ("paper", 0), method, LIMIT))


def line(scene: str, found: Outcome) -> Line:
    """An outcome in the units of the table."""
    clearance = found.clearance_m
    return Line(
        found.method, scene, found.answer, found.reason, found.plan_s, found.coverage,
        found.psi_deg, found.knees,
        None if clearance is None else clearance * MM_PER_M,
    )  # fmt: skip


def sample(ask: Ask, per_family: int, slow: int, minutes: float) -> Iterator[Line]:
    """The methods on the first problems of HRM-1000's feasible families."""
    families = [family for family in FAMILIES if family != "infeasible"]
    end = time.monotonic() + 60.0 * minutes
    for number in range(per_family):
        if time.monotonic() > end:
            return
        methods = [name for name in METHODS if number < slow or name not in SLOW]
        for family, method in product(families, methods):
            yield ask(method, f"{family}-{number:04d}")


PROVED: Final = "proved"
"""In place of the form of a number: rounded down, to a tenth."""
MEASURED: Final = {
    "ψ max [°]": ("psi_deg", ".1f"),
    "changed angles, mean": ("changed", ".2f"),
    "clearance [mm]": ("clearance_mm", PROVED),
    "time [s]": ("seconds", ".2f"),
}
"""Columns of numbers, with what stands in them."""


def own(method: str, lines: list[Line]) -> list[Line]:
    """The lines of one method."""
    return [one for one in lines if one.method == method]


def drawn(method: str, lines: list[Line]) -> list[str]:
    """How many problems a method draws whole, and medians over these."""
    mine = own(method, lines)
    whole = [one for one in mine if one.answer == "certified"]
    refuted = sum(one.answer in ("refuted", "undecided") for one in mine)
    late = sum(one.answer == "out of time" for one in mine)
    failed = sum(one.answer == "error" for one in mine)
    lost = len(mine) - len(whole) - refuted - late - failed
    words = f"{lost}, and {failed} failed" if failed else str(lost)
    cells = [method, f"{len(whole)} of {len(mine)}", str(refuted), words, str(late)]
    for key, form in MEASURED.values():
        values = [v for one in whole if (v := getattr(one, key)) is not None]
        cells.append(cell(median(values) if values else None, form))
    return cells


def numbers(one: Line) -> list[str]:
    """What was measured of one plan."""
    return [cell(getattr(one, key), form) for key, form in MEASURED.values()]


def cell(value: float | None, form: str) -> str:
    """A number, or a dash."""
    if value is None:
        return "–"
    text = at_least(value, 1) if form == PROVED else format(value, form)
    return text.replace("-", "−")


def markdown(lines: list[Line], sampled: list[Line]) -> str:
    """The tables for reading."""
    head = [
        "# The methods the paper compares itself with",
        "",
        "Made by `python analysis/baselines.py`. The whole path is demanded; every",
        "motion goes to the same judge, which proves limits, tip and clearance over",
        f"continuous time. Planning may take {LIMIT:.0f} s of processor time. Numbers",
        "in brackets are the paper's references; what each method is stands in its",
        "file under `benchmarks/hrm2000/references`. Training a network counts as",
        "planning where an arm is met for the first time. Clearances of refuted",
        "motions are of their worst place, as deep as is measured.",
        "",
        *table_lines(("method", "what it is"), METHODS.items()),
        "",
    ]
    names = ("method", "scene", "answer", *MEASURED, "why")
    cells = [
        (one.method, one.scene, one.answer, *numbers(one), one.reason) for one in lines
    ]
    rows = table_lines(names, cells)
    if not sampled:
        return "\n".join([*head, *rows, ""])
    counts = {name: len(own(name, sampled)) for name in METHODS}
    most, few, families = max(counts.values()), min(counts.values()), len(FAMILIES) - 1
    every = families * PER_FAMILY
    each = sum(one.seconds / counts[one.method] for one in sampled)
    slow = "the same for every method."
    if few < most:
        late = ", ".join(name for name in METHODS if counts[name] < most)
        slow = f"but for the slowest ({late}) the first {few} only."
    words = [
        "",
        "## A sample of HRM-1000",
        "",
        f"The first {most // families} of the {PER_FAMILY} problems of each of the",
        f"{families} feasible families, {SAMPLE_LIMIT:.0f} s of processor time for",
        f"each plan: {most} of {every}, {slow} All together plan",
        f"one in {at_most(each)} s of processor time, and would all {every} in",
        f"{at_most(each * every / S_PER_HOUR, 1)} hours, the judge not counted.",
        "",
        f"Those that evolve or swarm have {GENERATIONS} generations of",
        f"{MEMBERS} members for each unknown at a waypoint, and go on to the next as",
        "soon as their best, brought onto the path, is valid. Motions that the judge",
        "cannot decide count as refuted; not found are those that ended by",
        "themselves, out of time those that the limit ended. Medians are",
        "over the paths that are drawn whole and certified.",
        "",
    ]
    names = ("method", "certified", "refuted", "not found", "out of time", *MEASURED)
    table = table_lines(names, [drawn(name, sampled) for name in METHODS])
    return "\n".join([*head, *rows, *words, *table, ""])


def shortened(one: Line) -> dict[str, object]:
    """A line for the file, its numbers to six digits: there are 1,416 of them."""
    return {
        key: float(f"{value:.6g}") if isinstance(value, float) else value
        for key, value in asdict(one).items()
    }


def main() -> None:
    """Run everything and write both files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=REPORTS)
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--slow", type=int, default=4)
    parser.add_argument("--minutes", type=float, default=inf)
    parser.add_argument("--log", type=Path)
    options = parser.parse_args()
    missing = [name for name in LIBRARIES if find_spec(name) is None]
    if missing:
        parser.error(
            f"{', '.join(missing)} missing: pip install 'vdsm-pin[references]'"
        )
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in product(("paper", "fewest"), SCENES):
            asked(Path(folder), name, scene)  # machine code is loaded once
        ask = kept(partial(asked, Path(folder)), options.log)
        lines = [ask(*one) for one in product(METHODS, SCENES)]
        some = (options.sample, options.slow, options.minutes)
        sampled = list(sample(ask, *some))
    rows = [shortened(one) for one in (*lines, *sampled)]
    write_table(options.out, "baselines", rows, markdown(lines, sampled))


if __name__ == "__main__":
    main()
