"""The whole of `vdsm verify` on a plan with a million rows: peak memory, time.

    python -m benchmarks.memory [--rows 1e6] [--save FILE]

The rows of a plan of paper/obs1 lie on its straight lines in joint space, as many as
are wanted. The tip between two waypoints of a plan is a little off its path, so the
motion is refuted for its tip; every check is done all the same.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.common import Results, command
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.link_clearance import link_clearance

PROBLEM = "paper/obs1"
PROGRAM = """\
import sys
from vdsm_pin.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
status = open("/proc/self/status").read()
print(status.partition("VmHWM:")[2].split()[0])
"""
"""Says its own peak; that of `getrusage` may be of the process that began it."""


def dense(motion: Trajectory, rows: int) -> Trajectory:
    """The same motion in so many rows."""
    at = np.linspace(0.0, motion.n_samples - 1, rows)
    before = np.minimum(at.astype(int), motion.n_samples - 2)
    number = np.arange(motion.n_samples)

    def along(values: FloatArray) -> FloatArray:
        return np.interp(at, number, values)

    return Trajectory(
        motion.on_path[before] & motion.on_path[before + 1],
        along(motion.path_m),
        along(motion.x0),
        np.stack([along(column) for column in motion.alpha.T], axis=1),
        np.stack([along(column) for column in motion.theta.T], axis=1),
    )


def measure(rows: int) -> Results:
    """Peak memory and processor time of the process, and what it wrote."""
    problem = read_problem(PROBLEM)
    motion = strategy("paper")(problem, link_clearance(problem), 0.0).trajectory
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "trajectory.csv"
        write_trajectory(dense(motion, rows), file)
        words = [
            "verify",
            PROBLEM,
            "--trajectory",
            str(file),
            "--out",
            str(folder / "v"),
        ]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        ended = subprocess.run(
            [sys.executable, "-c", PROGRAM, *words],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        written = sum(path.stat().st_size for path in (folder / "v").iterdir())
        read = file.stat().st_size
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    peak = float(ended.stdout.split()[-1]) / 1024.0
    return {
        f"peak memory of vdsm verify, {rows} rows [MiB]": {"median": peak},
        f"processor time of vdsm verify, {rows} rows [s]": {"median": spent},
        f"trajectory file, {rows} rows [MB]": {"median": read / 1e6},
        f"files written, {rows} rows [MB]": {"median": written / 1e6},
    }


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rows", type=float, default=1e6)


if __name__ == "__main__":
    command(__doc__, lambda asked: measure(int(asked.rows)), _options)
