"""Guards on cost that no busy machine can upset: counts, and ratios of counts.

Python's work does not grow with the rows; the proof needs few subdivisions and Coal few
calls.
"""

import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

from vdsm_pin.arm.cables import angles_from_cables, cable_lengths
from vdsm_pin.arm.kinematics import joint_angles, joint_centres
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import SLICES
from vdsm_pin.verification import coal_check
from vdsm_pin.verification import coal_shapes as measuring
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.coal_bodies import Call
from vdsm_pin.verification.link_clearance import link_clearance


def calls(run: Callable[[], object]) -> int:
    """How often Python calls a function, its own or C's, to run this once more."""
    run()
    count = 0

    def note(frame: FrameType, kind: str, argument: object) -> None:
        nonlocal count
        count += kind in ("call", "c_call")

    sys.setprofile(note)
    try:
        run()
    finally:
        sys.setprofile(None)
    return count


def swaying(rows: int) -> Trajectory:
    t = np.linspace(0.0, 6.0, rows)[:, None] + np.arange(8.0)
    off = np.zeros(rows, bool)
    x0 = 0.05 * np.sin(t[:, 0])
    return Trajectory(off, off, x0, 0.1 * np.sin(t), 0.1 * np.cos(t))


def near() -> PlanningProblem:
    return read_problem("paper/obs1")


def work(rows: int, folder: Path) -> dict[str, int]:
    """Calls by what is done to the rows."""
    problem, motion = near(), swaying(rows)
    arm = problem.manipulator
    joints = motion.x0, motion.alpha, motion.theta
    centres, file = joint_centres(arm, *joints), folder / f"{rows}.csv"
    lengths = cable_lengths(arm, motion.alpha, motion.theta)
    return {
        "cables": calls(lambda: cable_lengths(arm, *joint_angles(arm, centres))),
        "angles": calls(lambda: angles_from_cables(arm, lengths)),
        "proof": calls(lambda: prove_clearance(problem, motion, ErrorBox())),
    } | {"write": calls(lambda: write_trajectory(motion, file)),
         "read": calls(lambda: read_trajectory(file, arm))}  # fmt: skip


def test_python_does_not_work_row_by_row(tmp_path: Path) -> None:
    few, many = work(200, tmp_path), work(1000, tmp_path)
    for what in ("cables", "angles", "proof"):
        assert many[what] <= 1.1 * few[what], what
    # Of a line there is one call to put it together, and four to read and look at it.
    assert many["write"] <= few["write"] + 1.5 * 800
    assert many["read"] <= few["read"] + 4.5 * 800


def test_a_loop_over_rows_would_be_noticed() -> None:
    def row_by_row(values: FloatArray) -> float:
        return sum(float(np.sin(value)) for value in values)

    counts = [calls(lambda n=n: row_by_row(np.ones(n))) for n in (200, 1000)]  # type: ignore[misc]
    assert counts[1] > 4 * counts[0]


@pytest.fixture(scope="module")
def planned() -> Trajectory:
    problem = near()
    return strategy("paper")(problem, link_clearance(problem), 0.0).trajectory


def test_the_proof_of_a_plan_needs_few_subdivisions(planned: Trajectory) -> None:
    proving = AskedMotion.of_arm(near(), planned, ErrorBox()).proving()
    proving.prove()
    results = proving.results
    assert results.tally[SLICES] <= 0.01 * results.counts.sum()


def test_coal_is_asked_where_it_adds_evidence(
    planned: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, asked = near(), 0
    measure = measuring.measure_each

    def counting(calls: Iterable[Call], count: int) -> object:
        nonlocal asked
        every = list(calls)
        asked += len(every)
        return measure(every, count)

    monkeypatch.setattr(measuring, "measure_each", counting)
    coal_check.check_coal(problem, planned)
    pairs = planned.n_samples * problem.manipulator.n_links
    assert 8 + 21 <= asked <= 21 + 0.4 * pairs
