"""Time to certify: a motion of 10,000 intervals, and how the time grows.

    python benchmarks/certify.py [--save FILE] [--repeat N]
    python benchmarks/certify.py --compare OLD.json NEW.json

The motion sways the arm beside a bar that leaves the required clearance or more.
Only the clearance proof is timed, in one process, after one run to warm up.
"""

import argparse
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np

import vdsm_pin
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.kinematics import joint_centres
from vdsm_pin.manipulator import built_in
from vdsm_pin.problem import DesiredPath, PlanningProblem
from vdsm_pin.scene import Cylinder, Scene, Sphere
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.records import ErrorBox

ARM = built_in("hrm8")
MM = 1e-3


def sway(n_intervals: int) -> Trajectory:
    """A smooth motion of all joints, with one period whatever the number of rows."""
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 2.0 * np.pi, n_intervals + 1)[:, None]
    phase = rng.uniform(0.0, 6.0, (2, 8))
    alpha, theta = 0.1 * np.sin(t + phase[0]), 0.1 * np.cos(t + phase[1])
    n = n_intervals + 1
    x0 = 0.1 * np.sin(t[:, 0])
    return Trajectory(np.zeros(n, bool), np.zeros(n), x0, alpha, theta)


def beside(motion: Trajectory, clearance: float) -> Cylinder:
    """A bar along x above the arm, as near as that."""
    centres = joint_centres(ARM, motion.x0, motion.alpha, motion.theta)
    top = float(centres[..., 2].max())
    height = top + ARM.link_radius + clearance + 0.2
    middle = np.array([1.5, 0.0, height])
    return Cylinder("bar", middle, np.array([1.0, 0.0, 0.0]), 4.0, 0.2)


def far_away(count: int) -> list[Sphere]:
    """Balls around the arm, outside its reach."""
    rng = np.random.default_rng(1)
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    away = rng.uniform(2.2, 6.0, count)
    centres = np.column_stack(
        [rng.uniform(0.0, 3.0, count), away * np.cos(turn), away * np.sin(turn)]
    )
    return [Sphere(f"ball{k}", c, 0.1) for k, c in enumerate(centres)]


def case(n_intervals: int, n_obstacles: int, clearance: float) -> dict[str, float]:
    """One row of the tables, without its times."""
    return {
        "intervals": n_intervals,
        "obstacles": n_obstacles,
        "pairs": 8 * n_obstacles + 21,
        "clearance_mm": clearance / MM,
    }


def timed(run: Callable[[], object], repeat: int) -> dict[str, float]:
    """Median and 95th percentile over some runs after one to warm up; [ms]."""
    run()
    spans, work = [], []
    for _ in range(repeat):
        wall, cpu = time.perf_counter(), time.process_time()
        run()
        spans.append(1e3 * (time.perf_counter() - wall))
        work.append(1e3 * (time.process_time() - cpu))
    p95: FloatArray = np.percentile(spans, 95.0)
    return {
        "median_ms": statistics.median(spans),
        "p95_ms": float(p95),
        "median_cpu_ms": statistics.median(work),
    }


def measure(
    n_intervals: int, n_obstacles: int, clearance: float, repeat: int
) -> dict[str, float]:
    """Time one case."""
    motion = sway(n_intervals)
    obstacles = (beside(motion, clearance), *far_away(n_obstacles - 1))
    point = np.array([3.126, 0.0, 0.0])
    path = DesiredPath(point, point[None])
    problem = PlanningProblem(
        "bench", ARM, Scene(obstacles), path, clearance, np.eye(4)
    )
    proof = prove_clearance(problem, motion, ErrorBox())
    row = case(n_intervals, n_obstacles, clearance)
    row["not_certified"] = int(proof.counts[:, 1:].sum())
    spans = timed(lambda: prove_clearance(problem, motion, ErrorBox()), repeat)
    return row | spans


def all_rows(repeat: int) -> list[dict[str, float]]:
    """Every case: obstacles, then clearance, then intervals."""
    near = 3.5 * MM
    cases = [(10_000, n, near) for n in (1, 3, 10, 100, 1000)]
    cases += [(10_000, 3, c * MM) for c in (0.1, 1.0, 10.0, 100.0)]
    cases += [(n, 3, near) for n in (100, 1_000, 100_000)]
    return [measure(*one, repeat) for one in cases]


def show(rows: list[dict[str, float]]) -> None:
    """Print the table."""
    names = ("intervals", "obstacles", "pairs", "clearance_mm", "median_ms", "p95_ms",
             "median_cpu_ms", "not_certified")  # fmt: skip
    print("  ".join(f"{name:>13}" for name in names))
    for row in rows:
        print("  ".join(f"{row[name]:13.6g}" for name in names))


def main() -> int:
    """Run or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", type=Path)
    parser.add_argument("--repeat", type=int, default=7)
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    options = parser.parse_args()
    if options.compare:
        old, new = (json.loads(path.read_text())["rows"] for path in options.compare)
        for a, b in zip(old, new, strict=True):
            ratio = b["median_ms"] / a["median_ms"]
            print(f"{a['intervals']:>7} x {a['pairs']:>5} pairs: {ratio:.2f} times")
        return 0
    rows = all_rows(options.repeat)
    show(rows)
    record = {
        "machine": platform.processor() or platform.machine(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "vdsm_pin": vdsm_pin.__version__,
        "rows": rows,
    }
    if options.save:
        options.save.write_text(json.dumps(record, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
