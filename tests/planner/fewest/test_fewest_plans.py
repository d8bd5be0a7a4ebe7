import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from scenes_for_fewest import problem, random_problem
from some_slow import few_of

from vdsm_pin.arm.kinematics import joint_centres, link_angles
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import NoPlanFound, OutOfReach, OutOfTime, PathBlocked
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box, HalfSpace, Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.fewest.strategy import plan_clearest, plan_fewest
from vdsm_pin.planner.records import Plan
from vdsm_pin.planner.time_limit import within_time
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.held import Axes
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.time_limit import Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify
from vdsm_pin.verification.yes_or_no import is_certified

ARM = built_in("hrm8")


def planned(task: PlanningProblem) -> Plan:
    return plan_fewest(task, link_clearance(task), 0.0)


def mean_changed(plan: Plan) -> float:
    angles = link_angles(plan.trajectory.alpha, plan.trajectory.theta)
    changed = (angles > TOLERANCES.changed_angle).sum(axis=1)
    return float(changed[plan.trajectory.on_path].mean())


def changed_along(plan: Plan) -> float:
    """The mean over the length drawn: rows stand closer where the arm turns more."""
    told = plan.trajectory
    changed = (link_angles(told.alpha, told.theta) > TOLERANCES.changed_angle).sum(
        axis=1
    )
    drawn = told.on_path[1:] & told.on_path[:-1]
    length = np.where(drawn, np.abs(np.diff(told.path_m)), 0.0)
    return float((length @ (changed[1:] + changed[:-1])) / (2.0 * length.sum()))


@pytest.mark.parametrize(
    ("name", "most_changed", "most_bent"),
    [
        ("free", 1.0, 31.7),
        ("obs1", 1.5, 34.0),
        ("obs2", 2.2, 34.0),
        ("obs2-small", 1.7, 34.0),
        ("obs3", 1.6, 34.0),
    ],
)
def test_the_papers_square_is_drawn_whole_certified_and_sparse(
    name: str, most_changed: float, most_bent: float
) -> None:
    task = read_problem(f"paper/{name}")
    plan = planned(task)
    result = verify(task, plan.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)
    assert mean_changed(plan) <= most_changed
    angles = link_angles(plan.trajectory.alpha, plan.trajectory.theta)
    assert np.rad2deg(angles.max()) <= most_bent
    for values in (plan.trajectory.alpha, plan.trajectory.theta):
        assert np.rad2deg(np.abs(np.diff(values, axis=0)).max()) <= 5.0


def test_the_tip_is_on_the_path_wherever_a_row_says_so() -> None:
    task = read_problem("paper/obs1")
    trajectory = planned(task).trajectory
    centres = joint_centres(ARM, trajectory.x0, trajectory.alpha, trajectory.theta)
    drawn = trajectory.on_path
    stations = np.mod(trajectory.path_m[drawn], task.path.length)
    gap = np.linalg.norm(centres[drawn, -1] - task.path.at(stations), axis=1)
    assert gap.max() < TOLERANCES.tip_on_path


def test_between_two_rows_the_tip_stays_on_the_path_it_draws() -> None:
    trajectory = planned(read_problem("paper/obs3")).trajectory
    drawn = trajectory.on_path[1:] & trajectory.on_path[:-1]
    tips = joint_centres(ARM, trajectory.x0, trajectory.alpha, trajectory.theta)[:, -1]
    side = np.diff(tips, axis=0)
    square = np.maximum((side * side).sum(axis=1), 1e-30)
    worst = 0.0
    for share in np.linspace(0.1, 0.9, 9):
        x0, alpha, theta = (
            (1.0 - share) * rows[:-1] + share * rows[1:]
            for rows in (trajectory.x0, trajectory.alpha, trajectory.theta)
        )
        between = joint_centres(ARM, x0, alpha, theta)[:, -1] - tips[:-1]
        along = np.minimum(1.0, np.maximum(0.0, (between * side).sum(axis=1) / square))
        gap = np.linalg.norm(between - along[:, None] * side, axis=1)
        worst = max(worst, float(gap[drawn].max()))
    assert 1e-6 < worst <= 1.05 * TOLERANCES.planned_stray * ARM.total_length


@pytest.mark.parametrize("name", ["obs2"])
def test_cores_and_threads_do_not_change_a_plan(name: str) -> None:
    """Another process, one core, other thread counts: the same bytes."""
    code = (
        "import os, sys, hashlib\n"
        "os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:int(sys.argv[2])])\n"
        "from vdsm_pin.io.problem_file import read_problem\n"
        "from vdsm_pin.planner.fewest.strategy import plan_fewest\n"
        "from vdsm_pin.verification.link_clearance import link_clearance\n"
        "task = read_problem(f'paper/{sys.argv[1]}')\n"
        "plan = plan_fewest(task, link_clearance(task), 0.0)\n"
        "joints = plan.trajectory.joints\n"
        "print(hashlib.sha256(joints.tobytes()).hexdigest())\n"
    )
    task = read_problem(f"paper/{name}")
    here = hashlib.sha256(planned(task).trajectory.joints.tobytes()).hexdigest()
    for cores in ("1", "4"):
        threads = {f"{lib}_NUM_THREADS": cores for lib in ("OPENBLAS", "OMP", "NUMBA")}
        told = subprocess.run(
            [sys.executable, "-c", code, name, cores],
            env={**os.environ, **threads, "PYTHONHASHSEED": cores},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        assert told.stdout.strip() == here


def test_a_single_point_is_a_path() -> None:
    ball = Sphere("ball", np.array([2.0, 0.3, 0.3]), 0.1)
    task = problem(ball, points=np.array([[3.126, 0.5, 0.5]]), closed=False)
    plan = planned(task)
    assert plan.trajectory.on_path.sum() == 2
    result = verify(task, plan.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == 1.0


def test_two_runs_give_the_same_plan_to_the_last_bit() -> None:
    task = random_problem(1, clutter=True)
    first, second = planned(task), planned(task)
    np.testing.assert_array_equal(first.trajectory.joints, second.trajectory.joints)
    assert first.notes == second.notes


@pytest.mark.parametrize("clutter", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_random_scenes_are_drawn_whole_and_certified(seed: int, clutter: bool) -> None:
    task = random_problem(seed, clutter=clutter)
    plan = planned(task)
    result = verify(task, plan.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("clutter", [False, True])
def test_hundreds_of_random_scenes_are_drawn_whole(clutter: bool) -> None:
    missed, changed = [], []
    for seed in range(200):
        task = random_problem(seed, clutter=clutter)
        plan = planned(task)
        result = verify(task, plan.trajectory)
        changed.append(mean_changed(plan))
        if result.verdict is not Verdict.CERTIFIED or result.coverage < 1.0 - 1e-9:
            missed.append(seed)
    assert len(missed) <= (6 if clutter else 0), missed
    assert np.mean(changed) <= (2.3 if clutter else 1.9)


def test_a_path_beyond_the_curled_reach_is_proved_out_of_reach() -> None:
    points = np.array([[3.126, 2.5, 2.0], [3.126, 2.6, 2.0]])
    with pytest.raises(OutOfReach):
        planned(problem(points=points, closed=False))


def test_a_path_into_an_obstacle_is_refused_or_drawn_up_to_it() -> None:
    ball = Sphere("ball", np.array([3.126, 1.0, 0.5]), 0.1)
    with pytest.raises(PathBlocked, match="ball"):
        planned(problem(ball, blocked=Blocked.FAIL))
    task = problem(ball)
    plan = planned(task)
    assert [stretch.partition("(")[2] for stretch in plan.undrawn] == [
        "proved: within the margin of 'ball')"
    ]
    result = verify(task, plan.trajectory)
    assert result.verdict is Verdict.INCOMPLETE
    # The chord of the sphere grown by body and clearance, to one row on either side.
    lost = 2.0 * (0.1 + 0.0615 + 0.0035)
    assert 1.0 - result.coverage == pytest.approx(lost / 6.0, abs=0.021 / 6.0)


def test_a_corner_that_no_tip_comes_to_is_refused_at_once_and_proves_nothing() -> None:
    """A motion may cut it between two waypoints; too near by 0.1 mm at one row."""
    corner = np.array([3.126, 0.3, 0.3])
    points = np.array([[3.126, 0.3, 0.0], corner, [3.126, 0.0, 0.3]])
    off = (0.1 + 0.0615 + 0.0035 - 1e-4) * np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)
    ball = Sphere("ball", corner + off, 0.1)
    task = problem(ball, points=points, closed=False, blocked=Blocked.FAIL)
    clearance, asked = link_clearance(task), []

    def counted(centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        asked.append(len(centres))
        return clearance(centres, axes)

    with pytest.raises(NoPlanFound, match=r"'ball' blocks .* have a waypoint there"):
        plan_fewest(task, counted, 0.0)
    assert len(asked) == 2  # the start, and the tips


def test_a_path_behind_a_wall_is_not_found_and_says_what_stands_in_the_way() -> None:
    wall = HalfSpace("wall", np.array([0.0, 0.4, 0.0]), np.array([0.0, -1.0, 0.0]))
    task = problem(wall, blocked=Blocked.FAIL)
    with pytest.raises(PathBlocked, match="wall"):
        planned(task)


@pytest.mark.slow
def test_a_path_behind_a_plate_is_looked_for_to_the_end() -> None:
    plate = Box("plate", np.array([0.0, 0.4, 0.0]), np.eye(3), np.array([9, 0.01, 9]))
    points = np.array([[3.126, 0.6, 0.0], [3.126, 0.9, 0.0]])
    with pytest.raises(NoPlanFound, match="plate"):
        planned(problem(plate, points=points, closed=False))


def test_an_arm_that_starts_bent_starts_there() -> None:
    alpha, theta = np.zeros((1, 8)), np.zeros((1, 8))
    alpha[0, [2, 5]], theta[0, 3] = 0.3, -0.2
    centres = joint_centres(ARM, np.array([0.1]), alpha, theta)
    angles = np.stack([alpha, theta], axis=2).ravel()
    joints = np.concatenate([[0.1], angles])
    start = tuple(centres[0, -1].tolist())
    task = problem(start=start, start_joints=joints)
    plan = planned(task)
    np.testing.assert_allclose(plan.trajectory.joints[0], joints, atol=1e-9)
    result = verify(task, plan.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("name", "gain"), few_of([("obs1", 0.02), ("obs3", 0.3)], 1))
def test_clearest_keeps_much_more_clearance_and_survives_larger_joint_errors(
    name: str, gain: float
) -> None:
    task = read_problem(f"paper/{name}")
    clearance = link_clearance(task)
    wide = plan_clearest(task, clearance, 0.0)
    lean = plan_fewest(task, clearance, 0.0)
    assert clearance(wide.centres).min() > clearance(lean.centres).min() + gain
    assert changed_along(wide) >= changed_along(lean)
    result = verify(task, wide.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)
    error = float(np.deg2rad(0.12))
    assert is_certified(task, wide.trajectory, ErrorBox(joint=error))
    assert not is_certified(task, lean.trajectory, ErrorBox(joint=error))


def test_a_time_limit_stops_and_tells_how_far_it_came_and_never_steers() -> None:
    task = random_problem(1, clutter=True)
    clearance = link_clearance(task)
    limited = plan_fewest(task, within_time(clearance, Deadline.after(1000.0)), 0.0)
    free = plan_fewest(task, clearance, 0.0)
    np.testing.assert_array_equal(limited.trajectory.joints, free.trajectory.joints)
    calls = 0

    def slow(centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        nonlocal calls
        calls += 1
        if calls > 3:
            raise OutOfTime(0.5)
        return clearance(centres, axes)

    with pytest.raises(
        OutOfTime, match=r"limit of 0\.5 s came first; drew 0\.000 mm of 6000\.000 mm"
    ):
        plan_fewest(task, slow, 0.0)
    with pytest.raises(OutOfTime, match="limit of 0 s"):
        plan_fewest(task, within_time(clearance, Deadline.after(0.0)), 0.0)
