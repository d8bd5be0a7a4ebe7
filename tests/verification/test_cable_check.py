"""The cable round trip passes what cables can drive and refuses what they cannot."""

from collections.abc import Iterator

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.cables import angles_from_cables
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.errors import InconsistentCables
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification import cable_check
from vdsm_pin.verification.cable_check import check_cables
from vdsm_pin.verification.records import Verdict

HRM8 = built_in("hrm8")


def problem_for(arm: Manipulator) -> PlanningProblem:
    tip = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    return PlanningProblem(arm, Scene(), path, 0.0, name="any")


def trajectory_of(alpha: np.ndarray, theta: np.ndarray) -> Trajectory:
    n = len(alpha)
    return Trajectory(np.zeros(n), np.zeros(n), np.zeros(n), alpha, theta)


def test_motion_inside_the_box_passes() -> None:
    box = HRM8.max_joint_angle
    alpha, theta = np.random.default_rng(1).uniform(-box, box, (2, 2500, 8))
    check = check_cables(problem_for(HRM8), trajectory_of(alpha, theta))
    assert check.verdict is Verdict.CERTIFIED
    assert check.count == 2 * 8 * 2500
    assert 0.0 < check.worst < 1e-12


def test_cables_that_do_not_determine_the_angles_are_refuted() -> None:
    """Link 5's three cables in one hole: a turn across it changes no length."""
    holes = paper_hole_angles(8)
    holes[4] = 0.3
    fields = {name: getattr(HRM8, name) for name in Manipulator.__dataclass_fields__}
    arm = Manipulator(**(fields | {"cables": CableLayout(0.05, 0.03, holes)}))
    alpha = np.zeros((3, 8))
    alpha[2, 4] = 0.2
    check = check_cables(problem_for(arm), trajectory_of(alpha, np.zeros((3, 8))))
    assert check.verdict is Verdict.REFUTED
    assert "joint 5" in check.where


@pytest.mark.parametrize(("error", "passes"), [(0.9e-9, True), (1.1e-9, False)])
def test_both_sides_of_the_tolerance(
    error: float, passes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A solver that is off by so much at one joint is caught at that joint."""
    honest = cable_check.angles_from_cables

    def off(arm: Manipulator, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        alpha, theta = honest(arm, lengths)
        theta[3, 5] += error
        return alpha, theta

    monkeypatch.setattr(cable_check, "angles_from_cables", off)
    still = np.zeros((6, 8))
    check = check_cables(problem_for(HRM8), trajectory_of(still, still))
    assert (check.verdict is Verdict.CERTIFIED) == passes
    assert (check.moment, check.where) == (3.0, "theta6")


def test_the_worst_of_all_rows_is_named_wherever_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Oracle: the largest of the errors that a solver is given."""
    rng, still = np.random.default_rng(2), np.zeros((11, 8))
    monkeypatch.setattr(cable_check, "CHUNK", 3)
    for _ in range(30):
        errors = rng.normal(0.0, 1e-7, (2, 11, 8))
        asked = iter(range(0, 11, 3))

        def off(
            *_: object, errors: np.ndarray = errors, asked: Iterator[int] = asked
        ) -> np.ndarray:
            first = next(asked)
            return errors[:, first : first + 3]

        monkeypatch.setattr(cable_check, "angles_from_cables", off)
        check = check_cables(problem_for(HRM8), trajectory_of(still, still))
        kind, row, joint = np.unravel_index(np.abs(errors).argmax(), errors.shape)
        assert check.worst == np.abs(errors).max()
        assert (check.moment, check.where) == (
            row,
            f"{['alpha', 'theta'][kind]}{joint + 1}",
        )


def test_the_row_whose_cables_determine_no_angles_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    honest, calls = cable_check.angles_from_cables, iter(range(4))

    def fails_at_7(arm: Manipulator, lengths: np.ndarray) -> object:
        if next(calls) == 2:
            raise InconsistentCables(waypoint=1, link=3, residual=1.0, tolerance=0.0)
        return honest(arm, lengths)

    monkeypatch.setattr(cable_check, "CHUNK", 3)
    monkeypatch.setattr(cable_check, "angles_from_cables", fails_at_7)
    still = np.zeros((11, 8))
    check = check_cables(problem_for(HRM8), trajectory_of(still, still))
    assert (check.verdict, check.where) == (Verdict.REFUTED, "joint 3")
    assert (check.moment, check.worst) == (7.0, np.inf)


def test_angles_that_are_none_are_refuted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever makes them: what is not known to agree does not."""

    def lost(arm: Manipulator, lengths: np.ndarray) -> list[np.ndarray]:
        found = [np.array(one) for one in angles_from_cables(arm, lengths)]
        found[1][3, 6] = np.nan
        return found

    monkeypatch.setattr(cable_check, "angles_from_cables", lost)
    motion = trajectory_of(*np.full((2, 5, 8), 0.1))
    row = check_cables(problem_for(HRM8), motion)
    assert row.verdict is Verdict.REFUTED
    assert (row.worst, row.where, row.moment) == (np.inf, "theta7", 3.0)
