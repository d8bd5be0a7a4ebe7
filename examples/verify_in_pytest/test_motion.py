"""A motion that stays proved: `pytest examples/verify_in_pytest`."""

from pathlib import Path

import pytest

import vdsm_pin as vp


@pytest.fixture(scope="module")
def result() -> object:
    """The verification of a plan of today's code."""
    problem = vp.read_problem("paper/obs3")
    return vp.verify(problem, vp.plan(problem).trajectory, joint_error=True)


def test_the_motion_is_certified(result) -> None:
    """Clear at every instant, within its limits, and on its path."""
    assert result.verdict is vp.Verdict.CERTIFIED, result.closest(3)


def test_it_keeps_ten_millimetres(result) -> None:
    """More than the problem asks for: whoever changes that shall notice."""
    assert result.min_clearance > 0.010


def test_every_joint_may_be_off_by_a_twentieth_of_a_degree(result) -> None:
    """The arm's calibration is as good as that."""
    assert result.joint_error > 0.05 * 3.1416 / 180.0


def test_a_wrong_motion_is_refuted(result, tmp_path: Path) -> None:
    """The test can fail: a motion through the obstacle is not certified."""
    motion = result.trajectory
    wrong = vp.Trajectory(
        motion.on_path, motion.path_m, motion.x0, 1.5 * motion.alpha, motion.theta
    )
    assert vp.verify(result.problem, wrong).verdict is vp.Verdict.REFUTED
