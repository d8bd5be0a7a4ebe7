"""A batch of many small problems with one process and with two, in turns.

    python -m benchmarks.batch [--problems 1000] [--rounds 1] [--keep none]

Says seconds by the wall clock, and processor time of a problem in the processes that do
it and in the one that hands it out. Other work on the machine hardly changes the
latter, so they tell what two free cores would do: all processes together, shared by
two cores, against one process that is never kept waiting. The results are compared
byte for byte.
"""

import argparse
import hashlib
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.common import Results, command

PROGRAM = """\
import resource, sys
from vdsm_pin.cli import main
if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except SystemExit:
        pass
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(used.ru_utime + used.ru_stime)
"""
"""Says at its end what its own processor time was."""

PROBLEM = """\
vdsm_problem: 1
name: small{number}
length_unit: mm
manipulator: hrm8
obstacles:
  - {{name: ball, shape: sphere, center: [{x}, {y}, 0], radius: 200}}
tip_path:
  start: [3126, 0, 0]
  points: [[3126, 0, -200], [3126, {side}, -200], [3126, {side}, -100]]
  closed: true
  spacing: 40
  retreat: 100
required_clearance: 3.5
"""


def write_problems(folder: Path, count: int) -> None:
    """Small squares beside a ball, no two alike; the same in every run."""
    rng = np.random.default_rng(0)
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(count):
        x, y = rng.uniform(1500, 2500), rng.uniform(800, 1200)
        side = rng.uniform(60, 140)
        text = PROBLEM.format(number=number, x=f"{x:.1f}", y=f"{y:.1f}",
                              side=f"{side:.1f}")  # fmt: skip
        (folder / f"small{number:05}.yaml").write_text(text, encoding="utf-8")


def run(problems: Path, out: Path, jobs: int, keep: str) -> dict[str, float]:
    """One batch in a process of its own: seconds of wall clock and of processors."""
    words = ["batch", str(problems), "--out", str(out), "--strategy", "paper",
             "--jobs", str(jobs), "--keep", keep]  # fmt: skip
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    parent = float(ended.stdout.split()[-1])
    return {"wall": wall, "workers": spent - parent, "parent": parent}


def digest(folder: Path) -> str:
    """Hash of names and bytes of all files that hold no times."""
    total = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.name.startswith("timing."):
            total.update(str(path.relative_to(folder)).encode())
            total.update(path.read_bytes())
    return total.hexdigest()


def measure(count: int, rounds: int, keep: str) -> Results:
    """Both numbers of processes in turns; medians of the rounds.

    Raises:
        SystemExit: If the results differ.
    """
    figures: dict[int, list[dict[str, float]]] = {1: [], 2: []}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_problems(folder / "problems", count)
        write_problems(folder / "few", 4)
        run(folder / "few", folder / "warm", 2, keep)
        seen = set()
        for turn in range(rounds):
            for jobs in (1, 2) if turn % 2 == 0 else (2, 1):
                out = folder / f"out{turn}-{jobs}"
                figures[jobs].append(run(folder / "problems", out, jobs, keep))
                seen.add(digest(out))
        if len(seen) != 1:
            sys.exit("the results depend on the number of processes")
    one, two = (
        {
            key: float(np.median([f[key] for f in figures[jobs]]))
            for key in figures[1][0]
        }
        for jobs in (1, 2)
    )
    share, parent = 1e3 / count, two["parent"]
    return {
        f"batch of {count}, 1 process [s]": {"median": one["wall"]},
        f"batch of {count}, 2 processes [s]": {
            "median": two["wall"],
            "times as fast": one["wall"] / two["wall"],
        },
        "a problem, 1 process [ms]": {"median": share * one["workers"]},
        "a problem, 2 processes [ms]": {
            "median": share * two["workers"],
            "times as much": two["workers"] / one["workers"],
        },
        "a problem, what hands it out [ms]": {
            "median": share * parent,
            "times as fast on two free cores": one["workers"]
            / (0.5 * (two["workers"] + parent)),
        },
    }


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--problems", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--keep", default="none")


if __name__ == "__main__":
    command(
        __doc__,
        lambda asked: measure(asked.problems, asked.rounds, asked.keep),
        _options,
    )
