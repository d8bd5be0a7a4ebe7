"""Time per waypoint of planning the paper's problems, beside damped least squares.

    python -m benchmarks.plan [--repeats N] [--save FILE]
    python -m benchmarks.plan --compare OLD.json NEW.json

Processor time on one thread. The peer is damped least squares on Pinocchio with
avoidance by Coal's distances (`benchmarks/hrm1000/references`); it makes a motion of
the same problem that the same verifier judges, and is timed in the same run.
"""

import argparse
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.common import MICRO, Results, command, timed
from benchmarks.hrm1000.references import reference
from vdsm_pin.errors import VdsmError
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import load_robot
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.verify import verify

PROBLEMS = ("free", "obs1", "obs2", "obs3")
STRATEGIES = ("paper", "fewest")
PEER = "damped-least-squares"


def measure(repeats: int) -> Results:
    """Every strategy and the peer on every problem."""
    results: Results = {}
    for name in PROBLEMS:
        problem = read_problem(f"paper/{name}").problem
        clearance = link_clearance(problem)
        for which in STRATEGIES:
            plan = strategy(which)
            motion = plan(problem, clearance, 0.0).trajectory
            count = repeats if which == "paper" else max(3, repeats // 4)
            spans = timed(
                lambda: plan(problem, clearance, 0.0),  # noqa: B023
                count,
                MICRO / motion.n_samples,
            )
            spans["waypoints"] = motion.n_samples
            results[f"plan {name}, {which} [us/waypoint]"] = spans
        peer = _peer(problem)
        unit = "us/waypoint" if peer["completes"] else "s until it gives up"
        results[f"plan {name}, {PEER} [{unit}]"] = peer
    _note_ratios(results)
    return results


def _peer(problem: PlanningProblem, repeats: int = 3) -> dict[str, float]:
    """The peer's time a waypoint and whether the verifier passes its motion."""
    robot, clearance = load_robot(problem.manipulator), link_clearance(problem)
    follow = reference(PEER)
    start = time.process_time()
    try:
        motion = follow(problem, robot, clearance)
    except VdsmError:
        return {"median": time.process_time() - start, "completes": 0.0}
    spans = timed(
        lambda: follow(problem, robot, clearance), repeats, MICRO / motion.n_samples
    )
    passed = verify(problem, motion, robot).verdict.value == "certified"
    whole = {"waypoints": float(motion.n_samples), "certified": float(passed)}
    return spans | whole | {"completes": 1.0}


def _note_ratios(results: Results) -> None:
    """How many times as fast each plan is as the peer that completes the problem."""
    for name, row in results.items():
        peer = results.get(name.rsplit(",", 1)[0] + f", {PEER} [us/waypoint]")
        if peer is not None and row is not peer:
            row["times as fast as the peer"] = peer["median"] / row["median"]


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--repeats", type=int, default=20)


if __name__ == "__main__":
    command(__doc__, lambda asked: measure(asked.repeats), _options)
