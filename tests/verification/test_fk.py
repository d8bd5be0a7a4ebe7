"""The forward kinematics check passes the arm it knows and refuses any other."""

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import fk
from vdsm_pin.verification.fk import CHUNK, check_fk
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import CheckKind, Verdict
from vdsm_pin.verification.verify import verify

HRM8 = built_in("hrm8")


def problem_for(arm: Manipulator) -> PlanningProblem:
    tip = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    return PlanningProblem(arm, Scene(), path, 0.0, name="any")


def trajectory_of(n: int, seed: int = 1) -> Trajectory:
    rng = np.random.default_rng(seed)
    alpha, theta = rng.uniform(-0.7, 0.7, (2, n, 8))
    return Trajectory(np.zeros(n), np.zeros(n), rng.uniform(-1, 1, n), alpha, theta)


def with_length(link: int, change: float) -> Manipulator:
    fields = {name: getattr(HRM8, name) for name in Manipulator.__dataclass_fields__}
    lengths = HRM8.link_lengths.copy()
    lengths[link - 1] += change
    return Manipulator(**(fields | {"link_lengths": lengths}))


def test_the_arm_agrees_with_itself() -> None:
    n = 2 * CHUNK + 17
    (check,) = check_fk(load_arm(HRM8), problem_for(HRM8), trajectory_of(n))
    assert check.verdict is Verdict.CERTIFIED
    assert check.count == 9 * n
    assert 0.0 <= check.worst < 1e-12
    assert check.limit == TOLERANCES.joint_centre


@pytest.mark.parametrize(("change", "passes"), [(0.9e-9, True), (1.1e-9, False)])
def test_both_sides_of_the_tolerance(change: float, passes: bool) -> None:
    """A last link longer by so much moves the tip by as much and nothing else."""
    arm = with_length(8, change)
    (check,) = check_fk(load_arm(HRM8), problem_for(arm), trajectory_of(40))
    assert (check.verdict is Verdict.CERTIFIED) == passes
    assert check.worst == pytest.approx(change, rel=1e-4)
    assert check.where.endswith("O9")


def test_a_wrong_arm_is_refuted_where_it_is_worst() -> None:
    arm = with_length(3, 0.001)
    (check,) = check_fk(load_arm(HRM8), problem_for(arm), trajectory_of(CHUNK + 40))
    assert check.verdict is Verdict.REFUTED
    assert check.worst == pytest.approx(0.001)


def test_missing_evidence_is_no_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    def with_hole(*arguments: object) -> np.ndarray:
        centres = joint_centres(*arguments)
        centres[2, 4, 1] = np.nan
        return centres

    monkeypatch.setattr(fk, "joint_centres", with_hole)
    (check,) = check_fk(load_arm(HRM8), problem_for(HRM8), trajectory_of(5))
    assert check.verdict is Verdict.REFUTED
    assert check.worst == np.inf
    assert (check.moment, check.where) == (2.0, "joint centre O5")


def test_planned_centres_are_held_against_pinocchio() -> None:
    rows = trajectory_of(CHUNK + 40)
    centres = joint_centres(HRM8, rows.x0, rows.alpha, rows.theta).copy()
    robot = load_arm(HRM8)
    _, check = check_fk(robot, problem_for(HRM8), rows, centres)
    assert (check.verdict, check.count) == (Verdict.CERTIFIED, 9 * rows.n_samples)
    assert 0.0 <= check.worst < 1e-12
    centres[CHUNK + 3, 6, 2] += 1.1e-9
    _, check = check_fk(robot, problem_for(HRM8), rows, centres)
    assert check.verdict is Verdict.REFUTED
    assert (check.moment, check.where) == (CHUNK + 3, "joint centre O7")
    judged = verify(problem_for(HRM8), rows.part(CHUNK, CHUNK + 9),
                    centres=centres[CHUNK : CHUNK + 9])  # fmt: skip
    row = next(check for check in judged.checks if check.name == CheckKind.PLANNED)
    assert row.verdict is Verdict.REFUTED


def test_the_worst_centre_is_named_wherever_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Oracle: the errors put into the centres that were planned."""
    rng = np.random.default_rng(9)
    monkeypatch.setattr(fk, "CHUNK", 3)
    robot, zero = load_arm(HRM8), np.zeros(11)
    angles = rng.uniform(-0.2, 0.2, (2, 11, HRM8.n_links))
    motion = Trajectory(zero.astype(bool), zero, zero, *angles)
    honest = joint_centres(HRM8, zero, *angles)
    for size, verdict in ((1e-10, Verdict.CERTIFIED), (1e-6, Verdict.REFUTED)):
        for _ in range(10):
            off = size * rng.uniform(0.1, 0.9, honest.shape[:2])
            row, joint = rng.integers(0, 11), rng.integers(0, HRM8.n_links + 1)
            off[row, joint] = size
            wrong = honest + off[:, :, None] * np.array([0.6, 0.0, -0.8])
            _, check = check_fk(robot, problem_for(HRM8), motion, wrong)
            assert (check.verdict, check.moment) == (verdict, row)
            assert check.where == f"joint centre O{joint + 1}"
            assert check.worst == pytest.approx(size, abs=2e-15, rel=1e-5)
            assert check.count == 11 * (HRM8.n_links + 1)
    honest[5, 2, 1] = np.nan
    _, check = check_fk(robot, problem_for(HRM8), motion, honest)
    assert (check.verdict, check.moment, check.worst) == (Verdict.REFUTED, 5, np.inf)
