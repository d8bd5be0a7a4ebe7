"""Plans every problem: python -m benchmarks.hrm2000.run --per-family K --jobs 2.

A problem counts as solved if the verifier certifies the motion, the whole path is
drawn, dense sampling finds no fault and planning took no more processor time than the
limit, at which it is stopped. One without a solution is right if it is refused.
Strategies of this package and the references of `references/` get the same problems,
the same limit and the same judge. Results are saved after every problem; `--resume`
goes on where a run of the same code ended.
"""

import argparse
import hashlib
import json
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path
from typing import Any, Final

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import vdsm_pin
from benchmarks.common import surroundings
from benchmarks.hrm2000.attempt import Outcome, attempt
from benchmarks.hrm2000.catalogue import FAMILIES, problem_file
from benchmarks.hrm2000.generate import VERSION
from benchmarks.hrm2000.references import REFERENCES
from benchmarks.hrm2000.summary import document, solved
from vdsm_pin.planner.strategies import DEFAULT_STRATEGY, STRATEGIES

METHODS: Final = (*STRATEGIES, *REFERENCES)
PROBLEMS: Final = Path("out/hrm2000")
"""Where problems are kept from run to run."""


def one(
    task: tuple[str, int, tuple[str, ...]], folder: Path, limit: float
) -> list[Outcome]:
    """One problem by every method named."""
    family, number, names = task
    path = problem_file(folder, family, number)
    return [attempt(path, (family, number), name, limit) for name in names]


def fingerprint() -> str:
    """What tells one state of the package's code from another."""
    digest = hashlib.sha256()
    for path in sorted(Path(vdsm_pin.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def terms(limit: float) -> dict[str, Any]:
    """What two runs must have in common to be one."""
    return {"benchmark": VERSION, "time_limit_s": limit, "code": fingerprint()}


def known(base: Path | None, limit: float) -> list[Outcome]:
    """What an earlier run of the same code with the same limit came to."""
    if base is None or not base.with_suffix(".json").exists():
        return []
    data = json.loads(base.with_suffix(".json").read_text(encoding="utf-8"))
    asked = terms(limit)
    if {name: data["settings"].get(name) for name in asked} != asked:
        return []
    return [Outcome(**row) for row in data["outcomes"]]


def stored(outcome: Outcome) -> dict[str, Any]:
    """The fields of an outcome that are not as by default, numbers to six digits."""
    default = {field.name: field.default for field in fields(Outcome)}
    return {
        name: float(f"{value:.6g}") if isinstance(value, float) else value
        for name, value in asdict(outcome).items()
        if value != default[name]
    }


def save(base: Path, outcomes: list[Outcome], limit: float, jobs: int) -> None:
    """The results as JSON and as a Markdown page."""
    settings = {**terms(limit), "processes": jobs, **surroundings()}
    ordered = sorted(outcomes, key=lambda o: (o.method, o.family, o.number))
    data = {"settings": settings, "outcomes": [stored(o) for o in ordered]}
    base.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(data, separators=(",", ":")) + "\n"
    base.with_suffix(".json").write_text(text, encoding="utf-8")
    page = document(ordered, settings)
    base.with_suffix(".md").write_text(page, encoding="utf-8")


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--per-family", type=int, default=80)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append")
    parser.add_argument("--method", choices=METHODS, action="append")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--problems", type=Path, default=PROBLEMS, metavar="FOLDER")
    parser.add_argument("--resume", action="store_true", help="skip what --save holds")
    parser.add_argument("--save", type=Path, help="base name of a .json and a .md file")
    return parser.parse_args()


def main() -> None:
    """Plan what is asked for, problem by problem, and save after each."""
    asked = options()
    names = tuple(asked.method or [DEFAULT_STRATEGY])
    limit = asked.time_limit
    outcomes = known(asked.save, limit) if asked.resume else []
    have = {(o.family, o.number, o.method) for o in outcomes}
    tasks = []
    for number in range(asked.first, asked.first + asked.per_family):
        for family in asked.family or FAMILIES:
            left = tuple(n for n in names if (family, number, n) not in have)
            if left:
                tasks.append((family, number, left))
    work = partial(one, folder=asked.problems, limit=limit)
    with ProcessPoolExecutor(asked.jobs) as pool:
        for found in pool.map(work, tasks):
            outcomes += found
            for o in found:
                mark = "solved" if solved(o, limit) else "-"
                words = (o.problem, o.method, o.answer, mark, f"{o.plan_s:.2f} s")
                print(*words, o.reason[:120], o.faults, flush=True)
            if asked.save:
                save(asked.save, outcomes, limit, asked.jobs)


if __name__ == "__main__":
    main()
