"""Everything the user waits for in one page: plan, certify, cables, batch, cold start.

    python -m benchmarks.report --save reports/performance [--only PART ...]
    python -m benchmarks.report --compare OLD NEW

Each part is a file beside the page, so that one can be measured again alone. Times are
processor time on one thread unless they say otherwise, so that other work on the
machine shows little.
"""

import argparse
import os
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks import batch, cold, growth, kinematics, memory, plan
from benchmarks.certify import headline, robot
from benchmarks.common import (
    Results,
    compare,
    described,
    load,
    save,
    saved_on,
    table,
)

PAGE = """\
# Performance

Processor time on one thread, median after a warm-up, unless a row says otherwise;
rebuilt by `python -m benchmarks.report --save reports/performance`, one part of it with
`--only`. How busy the machine was stands with each part.

{around}

## Planning

The peer is damped least squares on Pinocchio with avoidance by Coal's distances
(`benchmarks/hrm2000/references`, written in Python), timed in the same run. By itself
it finds no way round obs1 or obs2. So it is given the way of the tip that each of our
plans takes, waypoint by waypoint, and has only the joints to find; the time we took to
find that way is in our figure, not in its. `certified` says whether the verifier passes
its motion.

{plan}
## Angles and cables

10,000 rows in which all joints move; the checks are what `vdsm verify` does per row.

{kinematics}
## Certifying

The paper's arm beside bars at 3.5 mm; a tree of 6 joints such as a UR5's, whose links
are hulls of 50 corners, within a ring of boxes. `benchmarks/certify.py` has more.

{certify}
## Growth

Least of a few runs. The exponent is the slope of the last two decades; 1 is linear.

{growth}
![time against size, both axes logarithmic](growth.svg)

## Memory of a long motion

{memory}
## Batch

By the wall clock, on a machine that does other work as well; the results were the same
to the byte. See `docs/scaling.md` for many machines.

{batch}
## Whole processes

{cold}"""


PARTS = ("plan", "kinematics", "certify", "growth", "memory", "batch", "cold")


def certifying() -> Results:
    """An arm and a robot of `benchmarks/certify.py`."""
    arm, tree = headline(), robot()
    names = {
        f"10,000 intervals x {arm.pairs} pairs [ms]": arm,
        f"10,000 intervals x {tree.pairs} pairs of a robot's hulls [ms]": tree,
    }
    return {
        name: {"median": row.cpu_ms, "p95": row.p95_ms} for name, row in names.items()
    }


def measured(part: str, most: int, problems: int) -> Results:
    """One part of the page, measured.

    Args:
        part: Its name.
        most: Largest size that anything grows to.
        problems: Of the batch.
    """
    known: dict[str, Callable[[], Results]] = {
        "plan": lambda: plan.measure(20),
        "kinematics": kinematics.measure,
        "certify": certifying,
        "growth": lambda: growth.measure(most),
        "memory": lambda: memory.measure(most),
        "batch": lambda: batch.measure(problems, 1, "none"),
        "cold": cold.measure,
    }
    return known[part]()


def page(folder: Path) -> str:
    """The page of what was measured, and growth.svg beside it."""
    files = {part: folder / f"{part}.json" for part in PARTS}
    missing = [part for part, file in files.items() if not file.exists()]
    if missing:
        return f"Not measured yet: {' '.join(missing)}; no page without them.\n"
    parts = {part: load(file) for part, file in files.items()}
    tables = {part: table(results) for part, results in parts.items()}
    tables["growth"] = growth.growth_table(parts["growth"])
    growth.plot(parts["growth"], folder / "growth.svg")
    tables = {
        part: f"Load of the machine: {saved_on(files[part])['load']}.\n\n{text}"
        for part, text in tables.items()
    }
    text = PAGE.format(around=described(saved_on(files["plan"])), **tables)
    (folder / "README.md").write_text(text, encoding="utf-8")
    return text


def main() -> None:
    """Measure and write, or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--save", type=Path, metavar="FOLDER")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    parser.add_argument("--only", nargs="*", choices=PARTS, default=PARTS)
    parser.add_argument("--most", type=float, default=1e6, help="largest size")
    parser.add_argument("--problems", type=int, default=200, help="of the batch")
    asked = parser.parse_args()
    if asked.compare:
        old, new = asked.compare
        both = [p.name for p in old.glob("*.json") if (new / p.name).exists()]
        for file in sorted(both):
            for name, ratio in compare(old / file, new / file).items():
                print(f"{ratio:6.2f} times  {name}")
        return
    for part in asked.only:
        results = measured(part, int(asked.most), asked.problems)
        print(table(results))
        if asked.save:
            save(asked.save / f"{part}.json", results)
    if asked.save:
        print(page(asked.save))


if __name__ == "__main__":
    main()
