"""Motions of a snake arm that come too near: repaired, or refused with the reason."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from some_slow import few_of
from typer.testing import CliRunner

from vdsm_pin.app import repair as app_repair
from vdsm_pin.app.motions import MotionOptions
from vdsm_pin.app.subjects import subject_of
from vdsm_pin.app.workflow import Given, Verified, VerifyOrder
from vdsm_pin.arm.kinematics import joint_centres, tip_jacobian
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.cli import app
from vdsm_pin.errors import Infeasible, InvalidInput, OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.repair.arm import repair_arm
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.coal_arm import CoalArm


@cache
def planned(name: str) -> tuple[PlanningProblem, Trajectory]:
    problem = read_problem(name)
    return problem, plan_and_verify(problem, "fewest").plan.trajectory


def beside(name: str, row: int, link: int, gap: float) -> PlanningProblem:
    """The problem with a ball above a link at a row, so far from it; [m]."""
    problem, motion = planned(name)
    joints = (values[row : row + 1] for values in (motion.x0, motion.alpha))
    x0, alpha = joints
    centres = joint_centres(problem.manipulator, x0, alpha, motion.theta[row : row + 1])
    middle = centres[0, link : link + 2].mean(axis=0)
    away = problem.manipulator.least_radius + 0.1 + gap
    ball = Sphere("ball", middle + away * np.eye(3)[2], 0.1)
    return replace(problem, scene=Scene((*problem.scene.obstacles, ball)))


def finely(motion: Trajectory) -> Trajectory:
    """The motion with nine moments between any two waypoints."""
    return motion.at(np.linspace(0.0, motion.n_samples - 1.0, 9 * motion.n_samples))


@pytest.mark.parametrize("name", few_of(["paper/obs3", "paper/obs2", "paper/obs1"], 2))
def test_larger_clearance_is_reached(name: str) -> None:
    """Samples between waypoints keep it by Coal; tip and start stay."""
    problem, motion = planned(name)
    asked = replace(problem, required_clearance=problem.required_clearance + 0.03)
    found = repair_arm(asked, motion)
    assert found.verification.verdict == "certified"
    rows = found.verification.trajectory
    assert rows.joints[0].tolist() == motion.joints[0].tolist()
    assert found.given[0] == 0
    assert 0.0 < found.moved.max() < 0.2
    near = CoalArm(asked, links=False).near(finely(rows), 0.02)
    least = min(chunk.distance.min(initial=1.0) for chunk in near)
    assert least >= asked.required_clearance - 5e-6


def test_clear_motion_stays() -> None:
    problem, motion = planned("paper/obs1")
    found = repair_arm(problem, motion)
    assert found.verification.trajectory is motion
    assert found.given.tolist() == list(range(motion.n_samples))
    assert not found.moved.any()


def test_ball_that_is_grazed_is_passed() -> None:
    problem = beside("paper/obs2", 700, 3, -0.002)
    found = repair_arm(problem, planned("paper/obs2")[1])
    assert found.verification.verdict == "certified"
    assert found.verification.coverage == pytest.approx(1.0, abs=1e-12)


def test_start_and_pinned_waypoints_in_the_way_are_named() -> None:
    motion = planned("paper/obs2")[1]
    for row, pinned, gap, how in (
        (0, (), 0.001, r"are [\d.]* mm nearer than required"),
        (700, (700,), -0.002, "meet"),
    ):
        words = f"waypoint {row} stays, and there link 4 and ball {how}$"
        with pytest.raises(Infeasible, match=words):
            repair_arm(beside("paper/obs2", row, 3, gap), motion, pinned)
    with pytest.raises(InvalidInput, match="pinned waypoint is 9999, expected 0 to"):
        repair_arm(planned("paper/obs2")[0], motion, (9999,))


def test_no_time_is_the_reason_where_it_ends_the_work() -> None:
    """Not a check that there was no time for."""
    problem, deadline = beside("paper/obs2", 700, 3, -0.002), Deadline.after(1e-3)
    with pytest.raises(OutOfTime, match=r"the time limit of 0\.001 s came first"):
        repair_arm(problem, planned("paper/obs2")[1], deadline=deadline)


def test_ball_on_the_desired_path_is_refused() -> None:
    """The tip has to go there."""
    problem, motion = planned("paper/obs1")
    row = int(np.flatnonzero(motion.on_path)[len(motion.x0) // 2])
    ball = Sphere("ball", problem.path.at(motion.path_m[row : row + 1])[0], 0.05)
    asked = replace(problem, scene=Scene((ball,)))
    told = "link 8 and ball are too near, and the tip is held on its path there"
    with pytest.raises(Infeasible, match=told):
        repair_arm(asked, motion)


def least_gap(problem: PlanningProblem, joints: FloatArray) -> float:
    """Of the last obstacle, a ball, from all links at rows, by segments; [m]."""
    x0, alpha, theta = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    centres = joint_centres(problem.manipulator, x0, alpha, theta)
    ball, way = problem.scene.obstacles[-1], np.diff(centres, axis=1)
    assert isinstance(ball, Sphere)
    from_start = ball.centre - centres[:, :-1]
    share = (from_start * way).sum(axis=2) / (way * way).sum(axis=2)
    off = from_start - np.clip(share, 0.0, 1.0)[:, :, None] * way
    radius = problem.manipulator.link_radius + ball.radius
    return float(np.linalg.norm(off, axis=2).min()) - radius


@pytest.mark.parametrize(
    ("row", "degree", "gap"), [(100, 3, -0.002), (700, 3, -0.01), (700, 5, -0.002)]
)
def test_smooth_motion_is_repaired_as_a_smooth_one(
    row: int, degree: int, gap: float, tmp_path: Path
) -> None:
    """On its way to the path (row 100) and while it draws (row 700), in rounds."""
    motion, problem = planned("paper/obs2")[1], beside("paper/obs2", row, 3, gap)
    steps = np.abs(np.diff(motion.joints, axis=0)).max(axis=1)
    times = np.append(0.0, np.cumsum(5.0 * np.maximum(steps, 1e-3)))
    rates = np.gradient(motion.joints, times, axis=0)
    changes = np.zeros_like(rates) if degree == 5 else None
    given = replace(motion, times=times, rates=rates, changes=changes)
    pinned = row - 60
    found = repair_arm(problem, given, (pinned,))
    assert found.verification.verdict == "certified"
    assert found.verification.coverage == pytest.approx(1.0, abs=1e-12)
    after = found.verification.trajectory
    assert after.path.degree == degree
    assert after.times is not None
    assert after.rates is not None
    stays = np.flatnonzero(np.isin(found.given, [0, pinned, motion.n_samples - 1]))
    for k, old in zip(stays, [0, pinned, motion.n_samples - 1], strict=True):
        assert after.joints[k].tolist() == given.joints[old].tolist()
        assert after.rates[k].tolist() == rates[old].tolist()
        assert after.times[k] == times[old]
    off = np.abs(after.joints - given.path.at(after.times)).max(axis=1)
    np.testing.assert_allclose(found.moved, off, atol=1e-12)
    dense = after.path.at(np.linspace(0.0, times[-1], 40_000))
    assert least_gap(problem, given.joints) < problem.required_clearance
    assert least_gap(problem, dense) >= problem.required_clearance - 1e-9
    write_trajectory(after, tmp_path / "t.csv")
    read = read_trajectory(tmp_path / "t.csv", problem.manipulator)
    assert read.path.same_as(after.path)


def test_few_smooth_rows_get_more_where_they_are_too_near() -> None:
    """Two rows at rest, no path to draw, and a ball beside the middle of the way."""
    arm = built_in("hrm8")
    rows = np.zeros((2, 1 + 2 * arm.n_links))
    rows[:, 0], rows[1, 1] = -4.0, 0.3
    given = Trajectory.of_joints(
        rows, times=np.array([0.0, 8.0]), rates=np.zeros_like(rows)
    )
    problem = replace(planned("paper/obs1")[0], tip_path=None, start=None, goal=None)
    half = rows.mean(axis=0)[None]
    middle = joint_centres(arm, half[:, 0], half[:, 1::2], half[:, 2::2])[0, 4:6].mean(
        0
    )
    ball = Sphere("ball", middle + (arm.link_radius + 0.099) * np.eye(3)[2], 0.1)
    problem = replace(problem, scene=Scene((ball,)))
    found = repair_arm(problem, given)
    after = found.verification.trajectory
    assert found.verification.verdict == "certified"
    assert found.given[[0, -1]].tolist() == [0, 1]
    assert after.n_samples > 2
    assert after.path.degree == 3
    dense = after.path.at(np.linspace(0.0, 8.0, 8_000))
    assert least_gap(problem, dense) >= problem.required_clearance - 1e-9


def test_jacobian_agrees_with_differences() -> None:
    arm, h = built_in("hrm8"), 1e-6
    q = np.random.default_rng(3).uniform(-0.6, 0.6, (5, 17))

    def tips(q: FloatArray) -> FloatArray:
        return joint_centres(arm, q[:, 0], q[:, 1::2], q[:, 2::2])[:, -1]

    J = tip_jacobian(arm, q[:, 1::2], q[:, 2::2])
    for k, step in enumerate(h * np.eye(17)):
        expected = (tips(q + step) - tips(q - step)) / (2.0 * h)
        np.testing.assert_allclose(J[:, :, k], expected, atol=1e-8)


def test_command_repairs_what_it_is_given(tmp_path: Path) -> None:
    """A file with a larger clearance; how far each waypoint moved is told."""
    problem, motion = planned("paper/obs3")
    text = read_problem("paper/obs3").source.path.read_text(encoding="utf-8")
    assert "required_clearance: 3.5" in text
    file, given, out = tmp_path / "p.yaml", tmp_path / "t.csv", tmp_path / "out"
    file.write_text(text.replace("required_clearance: 3.5", "required_clearance: 33.5"))
    write_trajectory(motion, given)
    words = ["repair", str(file), "--trajectory", str(given), "--out", str(out)]
    ended = CliRunner().invoke(app, words, obj="vdsm repair")
    assert ended.exit_code == 0, ended.output
    assert "✓ certified" in ended.output
    assert re.search(r"largest change .*° of a joint that turns or .* mm", ended.output)
    rows = read_trajectory(out / "trajectory.csv", problem.manipulator)
    waypoints = json.loads((out / "repair.json").read_text())["waypoints"]
    moved = np.abs(rows.joints - motion.joints).max(axis=1)
    np.testing.assert_allclose([one["moved"] for one in waypoints], moved, atol=1e-9)
    verdict = json.loads((out / "verification.json").read_text())["verdict"]
    assert verdict == "certified"


def test_a_repaired_motion_that_is_not_proved_as_written_is_no_success(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the time ends between finding it and verifying what was written.

    Nothing is written then.
    """
    given, verify = tmp_path / "t.csv", app_repair.verify_into
    write_trajectory(planned("paper/free")[1], given)

    def late(order: VerifyOrder, motion: Given, aside: Path) -> Verified:
        order = replace(order, options=MotionOptions(Deadline.after(0.0)))
        subject = subject_of(order.problem, order.options)
        return verify(order, motion._replace(subject=subject), aside)

    monkeypatch.setattr(app_repair, "verify_into", late)
    words = ["repair", "paper/free", "--trajectory", str(given), "--out"]
    ended = CliRunner().invoke(app, [*words, str(tmp_path / "o")], obj="vdsm repair")
    assert ended.exit_code == 1
    assert isinstance(ended.exception, Infeasible)
    assert "the repaired motion, as written" in str(ended.exception)
    assert not list((tmp_path / "o").iterdir())
