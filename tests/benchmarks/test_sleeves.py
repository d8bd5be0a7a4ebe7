"""No proof denies a posture that is there; one with wrong limits is caught."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hrm2000.attempt import ProcessorTime, answer_of
from benchmarks.hrm2000.sleeves import ARMS, PROOFS, SHARE, Sleeved, fuzz, sleeved
from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import Infeasible, OutOfTime
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.planner.time_limit import within_time
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify


def with_cut_limits(problem: PlanningProblem) -> PlanningProblem:
    arm = problem.manipulator
    cone, box = 0.6 * arm.max_link_angle, 0.6 * arm.max_joint_angle
    tight = replace(arm, max_link_angle=cone, max_joint_angle=box)
    return replace(problem, manipulator=tight)


def some(count: int) -> list[Sleeved]:
    rng = np.random.default_rng(7)
    made = [sleeved(rng, ARMS[k % len(ARMS)]) for k in range(3 * count)]
    return [one for one in made if one is not None][:count]


def test_a_push_along_the_rail_is_a_certified_plan_at_the_limits() -> None:
    for one in some(6):
        arm, rows = one.problem.manipulator, one.rows
        tips = one.problem.path.points
        way = np.linspace(0.0, np.linalg.norm(tips[1] - tips[0]), len(rows))
        drawn = np.ones(len(rows), dtype=np.bool_)
        motion = Trajectory(drawn, way, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
        psi = link_angles(motion.alpha, motion.theta).max()
        assert psi == pytest.approx(SHARE * arm.max_link_angle) or psi == 0.0
        result = verify(one.problem, motion)
        assert result.verdict is Verdict.CERTIFIED
        assert result.coverage >= 1.0 - 1e-9


def test_no_proof_denies_a_posture_that_is_there() -> None:
    tally = fuzz(np.random.default_rng(1), 10)
    assert tally.asked == 10
    assert not any(tally.false.values()), tally.false


@pytest.mark.slow
def test_no_proof_denies_any_of_many_postures() -> None:
    tally = fuzz(np.random.default_rng(2), 5_000)
    assert not any(tally.false.values()), tally.false


def test_proofs_whose_limits_are_cut_to_60_percent_are_caught() -> None:
    tally = fuzz(np.random.default_rng(3), 50, with_cut_limits)
    assert all(tally.false[name] > 0 for name in PROOFS), tally.false


@pytest.mark.slow
def test_the_planner_never_says_that_there_is_no_plan() -> None:
    for one in some(40):
        problem = one.problem
        try:
            deadline = ProcessorTime.after(5.0)
            clearance = within_time(link_clearance(problem), deadline)
            strategy("fewest")(problem, clearance, 0.0)
        except OutOfTime:
            continue
        except Infeasible as error:
            assert answer_of(error) != "infeasible", str(error)
