"""Time per waypoint of planning the paper's problems.

    python benchmarks/plan.py
    python benchmarks/plan.py --strategy paper --save reports/performance/plan.json

Each figure is the median of the repeats after a warm-up, with the 95th percentile, in
microseconds of processor time a waypoint, on one thread.
"""

import argparse
import json
import os
import platform
import time
from importlib.metadata import version
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.strategies import STRATEGIES, strategy
from vdsm_pin.verification.link_clearance import link_clearance

PROBLEMS = ("free", "obs1", "obs2", "obs2-small", "obs3")
LIBRARIES = ("vdsm-pin", "numpy", "numba")


def timed(name: str, strategy_name: str, repeats: int) -> dict[str, float]:
    """Waypoints, and median and 95th percentile in microseconds a waypoint."""
    problem = read_problem(f"paper/{name}").problem
    clearance, plan_with = link_clearance(problem), strategy(strategy_name)
    rows = plan_with(problem, clearance, 0.0).trajectory.n_samples
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        plan_with(problem, clearance, 0.0)
        seconds.append(time.process_time() - start)
    median, p95 = np.quantile(seconds, [0.5, 0.95]) / rows * 1e6
    return {"waypoints": rows, "median_us": float(median), "p95_us": float(p95)}


def main() -> None:
    """Print the table and save it where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strategy", choices=tuple(STRATEGIES), default="paper")
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--save", type=Path)
    arguments = parser.parse_args()
    results = {}
    for name in PROBLEMS:
        results[name] = timed(name, arguments.strategy, arguments.repeats)
        row = results[name]
        print(
            f"{name:12} {row['waypoints']:6.0f} waypoints "
            f"{row['median_us']:9.2f} us median {row['p95_us']:9.2f} us p95"
        )
    if arguments.save:
        record = {
            "strategy": arguments.strategy,
            "machine": platform.processor() or platform.machine(),
            "python": platform.python_version(),
            "versions": {name: version(name) for name in LIBRARIES},
            "us_per_waypoint": results,
        }
        arguments.save.parent.mkdir(parents=True, exist_ok=True)
        arguments.save.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
