"""Motions that draw nothing: start, goal, clearance and limits are judged, no more."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem, Posture
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.records import Check, Verdict
from vdsm_pin.verification.tip import check_tip
from vdsm_pin.verification.verify import verify

ARM = built_in("hrm8")
BALL = Sphere("ball", np.array([2.0, 0.0, -0.9]), 0.1)


def swing(n: int = 9) -> Trajectory:
    """From the straight arm to a bent one, in n rows."""
    rng, share = np.random.default_rng(3), np.linspace(0.0, 1.0, n)
    bent = rng.uniform(-0.1, 0.1, (2, ARM.n_links))
    alpha, theta = share[:, None] * bent[0], share[:, None] * bent[1]
    return Trajectory(np.zeros(n, bool), np.zeros(n), 0.2 * share, alpha, theta)


def posture(motion: Trajectory, row: int) -> Posture:
    one = motion.part(row, row + 1)
    tip = joint_centres(ARM, one.x0, one.alpha, one.theta)[0, -1]
    return Posture(tip, one.joints[0])


def asked(**ends: Posture) -> PlanningProblem:
    return PlanningProblem(ARM, Scene((BALL,)), None, 0.01, name="p", **ends)


def names(checks: tuple[Check, ...]) -> list[str]:
    return [check.name for check in checks]


def test_without_start_and_goal_nothing_is_asked_of_the_tip() -> None:
    report = check_tip(asked(), swing())
    assert report.checks == ()
    assert np.isnan(report.coverage)
    assert (report.deviation, report.undrawn.shape) == (0.0, (0, 2))


def test_start_and_goal_are_met_to_the_micrometre_at_their_own_rows() -> None:
    motion = swing()
    first, last = posture(motion, 0), posture(motion, 8)
    good = check_tip(asked(start=first, goal=last), motion).checks
    assert names(good) == [
        "tip at its start", "joints at their start",
        "tip at its goal", "joints at their goal",
    ]  # fmt: skip
    assert {check.verdict for check in good} == {Verdict.CERTIFIED}
    assert [check.moment for check in good] == [0, 0, 8, 8]
    swapped = check_tip(asked(start=last, goal=first), motion).checks
    assert {check.verdict for check in swapped} == {Verdict.REFUTED}
    off = replace(last, tip=last.tip + np.array([0.0, 2e-6, 0.0]))
    judged = check_tip(asked(goal=off), motion).checks
    assert [check.verdict for check in judged] == [Verdict.REFUTED, Verdict.CERTIFIED]


def test_a_goal_may_be_known_by_its_tip_alone() -> None:
    motion = swing()
    goal = Posture(posture(motion, 8).tip)
    assert names(check_tip(asked(goal=goal), motion).checks) == ["tip at its goal"]


def test_a_clear_joint_move_is_certified_and_one_through_a_ball_is_not() -> None:
    motion = swing()
    task = asked(start=posture(motion, 0), goal=posture(motion, 8))
    clear = verify(task, motion)
    assert clear.verdict is Verdict.CERTIFIED
    assert not [name for name in names(clear.checks) if "path" in name]
    assert [key for key, _ in clear.summary()] == [
        *("problem", "verdict", "proved clearance", "waypoints")
    ]
    ball = replace(BALL, centre=posture(motion, 4).tip - np.array([0.4, 0.0, 0.0]))
    through = verify(replace(task, scene=Scene((ball,))), motion)
    assert through.verdict is Verdict.REFUTED


def test_marks_on_a_path_that_nobody_asked_for_are_not_read() -> None:
    motion = swing()
    marked = replace(motion, on_path=np.ones(9, bool), path_m=np.arange(9.0))
    assert check_tip(asked(), marked).checks == check_tip(asked(), motion).checks


def test_a_path_of_one_point_is_drawn_by_one_row_there() -> None:
    motion = swing()
    goal = posture(motion, 8).tip
    path = DesiredPath(posture(motion, 0).tip, goal[None])
    task = replace(asked(), tip_path=path)
    once = replace(motion, on_path=np.arange(9) == 8)
    report = check_tip(task, once)
    assert report.coverage == 1.0
    assert {check.verdict for check in report.checks} == {Verdict.CERTIFIED}
    assert "coverage of the desired path" in names(report.checks)
    never = check_tip(task, motion)
    assert never.coverage == 0.0
    assert never.checks[-1].verdict is Verdict.INCOMPLETE
    elsewhere = replace(motion, on_path=np.arange(9) == 7)
    verdicts = [check.verdict for check in check_tip(task, elsewhere).checks]
    assert Verdict.REFUTED in verdicts


def test_start_and_goal_stand_in_a_problem_without_path_only() -> None:
    motion = swing()
    start = posture(motion, 0)
    with pytest.raises(InvalidInput, match="without tip_path"):
        replace(asked(goal=start), tip_path=DesiredPath(start.tip, start.tip[None]))
    with pytest.raises(InvalidInput, match="expected 17 numbers"):
        asked(goal=Posture(start.tip, np.zeros(16)))
    with pytest.raises(InvalidInput, match="nothing to draw"):
        _ = asked().path
    with pytest.raises(InvalidInput, match="has a goal and no start"):
        _ = asked(goal=start).path
    with pytest.raises(InvalidInput, match="has a start and no goal"):
        _ = asked(start=start).path
