"""Time per waypoint of angles and cables, both ways, and of the robot checks.

    python -m benchmarks.kinematics [--rows N] [--save FILE]
    python -m benchmarks.kinematics --compare OLD.json NEW.json

Processor time on one thread. "There" is joint centres to angles to cable lengths,
"back" is lengths to angles to centres.
"""

import argparse
import os
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.common import MICRO, Results, command, timed
from vdsm_pin.arm.cables import angles_from_cables, cable_lengths
from vdsm_pin.arm.kinematics import joint_angles, joint_centres
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.cable_check import check_cables
from vdsm_pin.verification.coal_check import check_coal
from vdsm_pin.verification.fk import check_fk
from vdsm_pin.verification.pinocchio_arm import load_arm

PROBLEM = "paper/obs1"


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
    robot = load_arm(arm)
    return {
        "centres from angles": lambda: joint_centres(arm, *joints),
        "angles from centres": lambda: joint_angles(arm, centres),
        "cables from angles": lambda: cable_lengths(arm, motion.alpha, motion.theta),
        "angles from cables": lambda: angles_from_cables(arm, lengths),
        "there: angles and 24 cables from centres": lambda: cable_lengths(
            arm, *joint_angles(arm, centres)
        ),
        "back: centres from 24 cables": lambda: joint_centres(
            arm, motion.x0, *angles_from_cables(arm, lengths)
        ),
        "check: Pinocchio": lambda: check_fk(robot, problem, motion),
        "check: cables": lambda: check_cables(problem, motion),
        "check: Coal": lambda: check_coal(problem, motion),
    }


def measure(rows: int = 10_000, repeats: int = 25) -> Results:
    """Microseconds a waypoint of a long motion."""
    problem = read_problem(PROBLEM)
    return {
        f"{name} [us/waypoint]": timed(run, repeats, MICRO / rows)
        for name, run in cases(problem, rows).items()
    }


def _options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rows", type=int, default=10_000)


if __name__ == "__main__":
    command(__doc__, lambda asked: measure(asked.rows), _options)
