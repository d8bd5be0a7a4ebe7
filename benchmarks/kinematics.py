"""Time per waypoint of angles and cables, both ways, and of the robot checks.

    python benchmarks/kinematics.py
    python benchmarks/kinematics.py --rows 10000 --save kinematics.json

Figures are microseconds a waypoint on one thread, after a warm-up: the median of the
repeats, the 95th percentile and the least, which tells a busy machine from a slow one.
"There" is joint centres to angles to cable lengths, "back" is lengths to angles to
centres.
"""

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from vdsm_pin.cables import angles_from_cables, cable_lengths
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.kinematics import joint_angles, joint_centres
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import load_robot
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.cable_check import check_cables
from vdsm_pin.verification.coal_clearance import check_coal
from vdsm_pin.verification.fk import check_fk

FIGURES = ("median_us", "p95_us", "least_us")
LIBRARIES = ("vdsm-pin", "numpy", "numba", "pin", "coal")


def swaying(problem: PlanningProblem, rows: int) -> Trajectory:
    """A smooth motion of all joints over half their box."""
    arm = problem.manipulator
    rng = np.random.default_rng(1)
    time_axis = np.linspace(0.0, 20.0, rows)[:, None]
    phases = rng.uniform(0.0, 6.28, (2, arm.n_links))
    alpha, theta = (
        0.5 * arm.max_joint_angle * np.sin(time_axis + phase) for phase in phases
    )
    x0 = 0.3 * np.sin(time_axis[:, 0])
    return Trajectory(np.zeros(rows), np.zeros(rows), x0, alpha, theta)


def cases(problem: PlanningProblem, rows: int) -> dict[str, Callable[[], object]]:
    """What is timed, by name."""
    arm, motion = problem.manipulator, swaying(problem, rows)
    joints = motion.x0, motion.alpha, motion.theta
    centres = joint_centres(arm, *joints)
    lengths = cable_lengths(arm, motion.alpha, motion.theta)
    robot = load_robot(arm)
    return {
        "centres from angles": lambda: joint_centres(arm, *joints),
        "angles from centres": lambda: joint_angles(arm, centres),
        "cables from angles": lambda: cable_lengths(arm, motion.alpha, motion.theta),
        "angles from cables": lambda: angles_from_cables(arm, lengths),
        "there": lambda: cable_lengths(arm, *joint_angles(arm, centres)),
        "back": lambda: joint_centres(
            arm, motion.x0, *angles_from_cables(arm, lengths)
        ),
        "check: Pinocchio": lambda: check_fk(robot, problem, motion),
        "check: cables": lambda: check_cables(problem, motion),
        "check: Coal": lambda: check_coal(robot, problem, motion),
    }


def timed(run: Callable[[], object], rows: int, repeats: int) -> dict[str, float]:
    """Median, 95th percentile and least, microseconds a row."""
    run()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    figures = np.quantile(seconds, [0.5, 0.95, 0.0]) / rows * 1e6
    return dict(zip(FIGURES, np.round(figures, 4).tolist(), strict=True))


def main() -> None:
    """Print a table and, if asked to, save it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--problem", default="paper/obs1", help="scene and arm")
    parser.add_argument("--rows", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=25)
    parser.add_argument("--save", type=Path, help="write the numbers as JSON")
    arguments = parser.parse_args()
    problem = read_problem(arguments.problem).problem
    results = {}
    print(f"{'µs a waypoint':24} {'median':>8} {'p95':>8} {'least':>8}")
    for name, run in cases(problem, arguments.rows).items():
        results[name] = timed(run, arguments.rows, arguments.repeats)
        print(f"{name:24}", *(f"{results[name][key]:8.3f}" for key in FIGURES))
    if arguments.save:
        record = {
            "benchmark": "kinematics",
            "problem": arguments.problem,
            "rows": arguments.rows,
            "repeats": arguments.repeats,
            "machine": f"{platform.machine()}, {os.cpu_count()} cores",
            "python": platform.python_version(),
            "versions": {name: version(name) for name in LIBRARIES},
            "results": results,
        }
        arguments.save.parent.mkdir(parents=True, exist_ok=True)
        arguments.save.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
