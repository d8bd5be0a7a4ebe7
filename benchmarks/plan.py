"""Time per waypoint of planning the paper's problems, beside damped least squares.

    python -m benchmarks.plan [--repeats N] [--save FILE]
    python -m benchmarks.plan --compare OLD.json NEW.json

Processor time on one thread. The peer is damped least squares on Pinocchio with
avoidance by Coal's distances (`benchmarks/hrm2000/references`). By itself it finds no
way round an obstacle that the arm must change sides of. So it is given the way of the
tip that each of our plans takes, waypoint by waypoint, and has only the joints to find;
the time we took to find that way is in our figure, not in its. The same verifier judges
its motion.
"""

import argparse
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.common import MICRO, Results, command, timed
from benchmarks.hrm2000.references.arm import Arm, Wanted, along
from benchmarks.hrm2000.references.jacobian import damped_least_squares
from vdsm_pin.errors import VdsmError
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.records import Plan
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

PROBLEMS = ("free", "obs1", "obs2", "obs3")
STRATEGIES = ("paper", "fewest")
PEER = "damped-least-squares"


def measure(repeats: int) -> Results:
    """Every strategy and the peer on every problem."""
    results: Results = {}
    for name in PROBLEMS:
        problem = read_problem(f"paper/{name}")
        clearance = link_clearance(problem)
        for which in STRATEGIES:
            plan = strategy(which)
            found = plan(problem, clearance, 0.0)
            count = found.trajectory.n_samples
            spans = timed(
                lambda: plan(problem, clearance, 0.0),  # noqa: B023
                repeats,
                MICRO / count,
            )
            peer = _peer(found)
            spans |= {"waypoints": count}
            if peer["certified"]:
                spans["times as fast as the peer"] = peer["median"] / spans["median"]
            results[f"plan {name}, {which} [us/waypoint]"] = spans
            results[f"plan {name}, {PEER} on the way of {which} [us/waypoint]"] = peer
    return results


def _peer(plan: Plan, repeats: int = 3) -> dict[str, float]:
    """The peer's time a waypoint on the way of a plan, and what the verifier says."""
    problem, tip = plan.problem, plan.tip_path
    robot, clearance = load_arm(problem.manipulator), link_clearance(problem)
    goal = Wanted(tip.points[1:], tip.path_m[1:], tip.on_path[1:])
    begin = time.process_time()
    try:
        motion = along(Arm(problem, robot, clearance), damped_least_squares, goal)
    except VdsmError:
        spent = MICRO * (time.process_time() - begin) / len(tip.points)
        return {"median": spent, "completes": 0.0, "certified": 0.0}
    spans = timed(
        lambda: along(Arm(problem, robot, clearance), damped_least_squares, goal),
        repeats,
        MICRO / motion.n_samples,
        warm_up=False,
    )
    passed = verify(problem, motion).verdict is Verdict.CERTIFIED
    return spans | {"completes": 1.0, "certified": float(passed)}


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--repeats", type=int, default=20)


if __name__ == "__main__":
    command(__doc__, lambda asked: measure(asked.repeats), _options)
