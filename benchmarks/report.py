"""Everything the user waits for, beside a peer, in one page.

    python -m benchmarks.report --save reports/performance
    python -m benchmarks.report --compare OLD.json NEW.json

Times are processor time on one thread, so that other work on the machine hardly shows.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.certify import NEAR, beside, problem_of, sway
from benchmarks.common import compare, save, surroundings, timed
from benchmarks.peers.least_squares import follow
from vdsm_pin.cables import angles_from_cables, cable_lengths
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.kinematics import joint_angles, joint_centres
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.robot_model import load_robot
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import ErrorBox

Results = dict[str, dict[str, float]]
SCENES = ("free", "obs1", "obs3")
MICRO, MILLI = 1e6, 1e3
ROWS = (100, 1_000, 10_000)


def scaled(spans: dict[str, float], factor: float) -> dict[str, float]:
    """The same in another unit."""
    return {name: value * factor for name, value in spans.items()}


def planning(results: Results) -> None:
    """Microseconds a waypoint of plans, and of the peer on the same tip positions."""
    for scene in SCENES:
        problem = read_problem(f"paper/{scene}").problem
        clearance, plan = link_clearance(problem), strategy("paper")
        motion = plan(problem, clearance, 0.0).trajectory
        spans = timed(lambda: plan(problem, clearance, 0.0))  # noqa: B023
        rows = motion.n_samples
        results[f"plan {scene} [us/waypoint]"] = scaled(spans, MICRO / rows)
        robot = load_robot(problem.manipulator)
        tips = joint_centres(problem.manipulator, *joints(motion))[:, -1]
        start = time.process_time()
        reached = {"reached": follow(robot, problem, tips) / rows}
        spans = {"median": time.process_time() - start}
        results[f"peer {scene} [us/waypoint]"] = scaled(spans, MICRO / rows) | reached


def joints(motion: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The joint values of a trajectory as separate arrays."""
    return motion.x0, motion.alpha, motion.theta


def growing(results: Results) -> None:
    """Angles, cables, proof and files against the number of rows."""
    for rows in ROWS:
        motion = sway(rows)
        base = read_problem("paper/obs1").problem
        arm = base.manipulator
        centres = joint_centres(arm, *joints(motion))
        lengths = cable_lengths(arm, motion.alpha, motion.theta)
        near = problem_of(arm, [beside(motion, NEAR)], NEAR)
        there = timed(lambda: cable_lengths(arm, *joint_angles(arm, centres)))  # noqa: B023
        back = timed(
            lambda: joint_centres(arm, motion.x0, *angles_from_cables(arm, lengths)),  # noqa: B023
        )
        proof = timed(lambda: prove_clearance(near, motion, ErrorBox()))  # noqa: B023
        results[f"cables from centres, {rows} [us/row]"] = scaled(there, MICRO / rows)
        results[f"centres from cables, {rows} [us/row]"] = scaled(back, MICRO / rows)
        results[f"proof of clearance, {rows} [ms]"] = scaled(proof, MILLI)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "trajectory.csv"
            spans = timed(lambda: write_trajectory(file, motion), 3)  # noqa: B023
            results[f"write, {rows} [us/row]"] = scaled(spans, MICRO / rows)
            spans = timed(lambda: read_trajectory(file, arm), 3)  # noqa: B023
            results[f"read, {rows} [us/row]"] = scaled(spans, MICRO / rows)
    results["memory of all this [MiB]"] = {
        "median": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    }


def cold(results: Results) -> None:
    """Whole processes with their machine code already on disk."""
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "trajectory.csv")
        commands = {
            "vdsm --help": ["--help"],
            "vdsm plan": ["plan", "paper/obs1", "--out", folder],
            "vdsm verify": ["verify", "paper/obs1", "--trajectory", path, "--out",
                            folder],
        }  # fmt: skip
        for name, words in commands.items():
            spans = [_process(words) for _ in range(4)][1:]
            results[f"{name} [s]"] = {"median": float(np.median(spans))}


def _process(words: list[str]) -> float:
    """Processor time of one command; [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "vdsm_pin", *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def page(results: Results) -> str:
    """The results as a Markdown page."""
    around = surroundings()
    versions = ", ".join(f"{k} {v}" for k, v in around["versions"].items())
    lines = [
        "# Performance", "",
        "Processor time on one thread, median after a warm-up; rebuilt by",
        "`python -m benchmarks.report --save reports/performance`.", "",
        f"{around['processor']}, {around['cores']} cores, load {around['load']}; "
        f"Python {around['python']}, {versions}.", "",
        "The peer is damped least squares on Pinocchio with clearance gradients from",
        "Coal. It follows the tip positions of the plan; `reached` is the share",
        "of them it comes within 0.1 mm of, clear of obstacles or not. So it is spared",
        "choosing sides and detours, it is timed once, and what it finds may collide:",
        "the ratios compare costs a waypoint, not planners that do the same.", "",
        "| what | median | p95 | note |", "|---|---|---|---|",
    ]  # fmt: skip
    for name, row in results.items():
        note = f"reached {row['reached']:.1%}" if "reached" in row else ""
        peer = results.get(name.replace("plan ", "peer "))
        if name.startswith("plan ") and peer is not None:
            note = f"{peer['median'] / row['median']:.1f} times as fast as the peer"
        p95 = f"{row['p95']:.3g}" if "p95" in row else "–"
        lines.append(f"| {name} | {row['median']:.3g} | {p95} | {note} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure and write, or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", type=Path, metavar="FOLDER")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    options = parser.parse_args()
    if options.compare:
        for name, ratio in compare(*options.compare).items():
            print(f"{ratio:6.2f} times  {name}")
        return
    results: Results = {}
    for measure in (planning, growing, cold):
        measure(results)
    print(page(results))
    if options.save:
        save(options.save / "performance.json", results)
        (options.save / "README.md").write_text(page(results), encoding="utf-8")


if __name__ == "__main__":
    main()
