"""Links among themselves: Coal, the closed form and the proved brackets agree."""

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import link_gaps, row_brackets
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import coal_shapes as measuring
from vdsm_pin.verification.coal_arm import CoalArm
from vdsm_pin.verification.coal_check import check_coal
from vdsm_pin.verification.records import Verdict


def coiling_arm(n_links: int) -> Manipulator:
    cables = CableLayout(0.03, 0.05, paper_hole_angles(n_links))
    return Manipulator(
        "coil", np.full(n_links, 0.3), 0.04, 1.3, 1.3, (-5.0, 5.0), cables
    )


def problem_for(arm: Manipulator) -> PlanningProblem:
    tip = np.array([arm.total_length, 0.0, 0.0])
    return PlanningProblem(arm, Scene(), DesiredPath(tip, tip[None]), 0.0, name="any")


def trajectory_of(arm: Manipulator, n: int, size: float) -> Trajectory:
    rng = np.random.default_rng(arm.n_links)
    alpha, theta = rng.uniform(-size, size, (2, n, arm.n_links))
    return Trajectory(np.zeros(n), np.zeros(n), np.zeros(n), alpha, theta)


@pytest.mark.parametrize("size", [1.3, 0.3, 1e-7, 0.0])
def test_closed_form_is_inside_the_proved_bracket(size: float) -> None:
    """Bent, almost straight and straight: parallel links are the degenerate case."""
    arm = coiling_arm(6)
    motion = trajectory_of(arm, 25, size)
    centres = joint_centres(arm, motion.x0, motion.alpha, motion.theta)
    gaps = link_gaps(centres, arm.axis_radii)
    for m in range(25):
        for i in range(6):
            for k in range(6):
                if k < i + 2:
                    assert gaps[m, i, k] == np.inf
                    continue
                pieces = pack_pieces([[Hull(centres[m, i : i + 2])]])
                ends, one = centres[None, m, k : k + 2], np.zeros(1, np.int64)
                low, high = row_brackets(pieces, ends, one, 1e-12)[0] - 0.08
                if high > -0.08 + 1e-9:  # else the axes cross: only the sign counts
                    assert low - 1e-11 <= gaps[m, i, k] <= high + 1e-11


@pytest.mark.parametrize("n_links", [3, 8, 20])
def test_coal_agrees_on_every_pair(n_links: int) -> None:
    arm = coiling_arm(n_links)
    motion = trajectory_of(arm, 12, 1.3)
    found = list(CoalArm(problem_for(arm)).near(motion, np.inf))
    count = sum(chunk.moment.size for chunk in found)
    assert count == 12 * (n_links - 1) * (n_links - 2) // 2
    assert max(chunk.disagreement.max() for chunk in found) < 1e-12
    (check,) = check_coal(problem_for(arm), motion)
    assert check.verdict is Verdict.CERTIFIED
    assert (n_links - 1) * (n_links - 2) // 2 <= check.count <= count


def test_links_that_meet_are_measured_as_meeting() -> None:
    arm = coiling_arm(8)
    rings = np.random.default_rng(1).uniform(0.85, 1.0, (60, 8))
    still = np.zeros(60)
    motion = Trajectory(still, still, still, rings, np.zeros((60, 8)))
    found = list(CoalArm(problem_for(arm)).near(motion, 0.0))
    meeting = np.concatenate([chunk.distance[chunk.upper < 0.0] for chunk in found])
    assert meeting.size > 20
    assert (meeting <= 0.0).all()


def test_two_links_have_no_pair() -> None:
    arm = coiling_arm(2)
    checks = check_coal(problem_for(arm), trajectory_of(arm, 3, 0.3))
    assert checks == ()


@pytest.mark.parametrize("excess", [0.9, 1.1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_wrong_distance_is_noticed(
    excess: float, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = measuring.measure_each

    def lying(*arguments: object) -> FloatArray:
        found = honest(*arguments)
        error = sign * excess * TOLERANCES.coal_agreement
        return found + error

    monkeypatch.setattr(measuring, "measure_each", lying)
    arm = built_in("hrm8")
    motion = trajectory_of(arm, 5, 0.3)
    (check,) = check_coal(problem_for(arm), motion)
    expected = Verdict.CERTIFIED if excess < 1.0 else Verdict.UNDECIDED
    assert check.verdict is expected
