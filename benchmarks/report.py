"""Everything the user waits for in one page: plan, certify, cables, batch, cold start.

    python -m benchmarks.report --save reports/performance [--most 1e6] [--problems 200]
    python -m benchmarks.report --compare OLD.json NEW.json

Times are processor time on one thread unless they say otherwise, so that other work on
the machine hardly shows.
"""

import argparse
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks import batch, cold, growth, kinematics, memory, plan
from benchmarks.certify import headline
from benchmarks.common import Results, compare, described, save, table

PAGE = """\
# Performance

Processor time on one thread, median after a warm-up, unless a row says otherwise;
rebuilt by `python -m benchmarks.report --save reports/performance` with
`--most {most:g} --problems {problems}`.

{around}

## Planning

The peer is damped least squares on Pinocchio with avoidance by Coal's distances
(`benchmarks/hrm1000/references`, written in Python), timed in the same run. By itself
it finds no way round obs1 or obs2. So it is given the way of the tip that each of our
plans takes, waypoint by waypoint, and has only the joints to find; the time we took to
find that way is in our figure, not in its. `certified` says whether the verifier passes
its motion.

{plan}
## Angles and cables

10,000 rows in which all joints move; the checks are what `vdsm verify` does per row.

{kinematics}
## Certifying

A motion beside bars at 3.5 mm; `benchmarks/certify.py` has more.

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


def certifying() -> Results:
    """The headline of `benchmarks/certify.py`."""
    row = headline()
    name = f"10,000 intervals x {row.pairs} pairs [ms]"
    return {name: {"median": row.cpu_ms, "p95": row.p95_ms}}


def main() -> None:
    """Measure and write, or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--save", type=Path, metavar="FOLDER")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    parser.add_argument("--most", type=float, default=1e6, help="largest size")
    parser.add_argument("--problems", type=int, default=200, help="of the batch")
    asked = parser.parse_args()
    if asked.compare:
        for name, ratio in compare(*asked.compare).items():
            print(f"{ratio:6.2f} times  {name}")
        return
    parts = {
        "cold": cold.measure(),
        "plan": plan.measure(20),
        "kinematics": kinematics.measure(),
        "certify": certifying(),
        "growth": growth.measure(int(asked.most)),
        "memory": memory.measure(int(asked.most)),
        "batch": batch.measure(asked.problems, 1, "none"),
    }
    tables = {name: table(results) for name, results in parts.items()}
    tables["growth"] = growth.growth_table(parts["growth"])
    text = PAGE.format(
        around=described(), most=asked.most, problems=asked.problems, **tables
    )
    print(text)
    if asked.save:
        save(asked.save / "performance.json", {k: v for p in parts.values()
                                               for k, v in p.items()})  # fmt: skip
        growth.plot(parts["growth"], asked.save / "growth.svg")
        (asked.save / "README.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
