"""Motions of a planar robot past a post: repaired, or refused with the reason."""

import json
import math
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from oracles.shortcuts import named, read_path
from typer.testing import CliRunner

from vdsm_pin.cli import app
from vdsm_pin.errors import Infeasible, InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.problem.error_boxes import ErrorBox, TypedErrorBox
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.repair.robot import repair_robot, spread
from vdsm_pin.repair.rounds import Places
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.judgement import verify_robot
from vdsm_pin.robots.trajectory_csv import csv_text
from vdsm_pin.robots.urdf import read_robot

URDF = """<robot name="two"><link name="foot"/>
<link name="upper"><collision><origin xyz="0.2 0 0"/>
<geometry><box size="0.4 0.04 0.04"/></geometry></collision></link>
<link name="fore"><collision><origin xyz="0.2 0 0"/>
<geometry><box size="0.4 0.04 0.04"/></geometry></collision></link>
<joint name="a" type="revolute"><parent link="foot"/><child link="upper"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="b" type="revolute"><parent link="upper"/><child link="fore"/>
<origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""

OVER = np.array([[0.0, 0.3], [1.2, 0.3]])
"""A sweep whose tip passes a ball just inside of its reach."""


def rows_of(q: FloatArray, **more: FloatArray) -> JointTrajectory:
    return JointTrajectory(("a", "b"), q, **more)


def asked(folder: Path, *balls: tuple[float, float, float]) -> Cell:
    """Balls at (x, y) of a radius, in the plane; [m]."""
    file = folder / "two.urdf"
    file.write_text(URDF)
    solids = [
        Sphere(f"ball{k}", np.array([x, y, 0.0]), r)
        for k, (x, y, r) in enumerate(balls)
    ]
    return Cell(read_robot(RobotFiles(file)), Scene(tuple(solids)), 1e-3)


def tip_at(a: float, b: float) -> tuple[float, float]:
    """The end of the forearm; [m]."""
    x = 0.4 * np.cos(a) + 0.4 * np.cos(a + b)
    return float(x), float(0.4 * np.sin(a) + 0.4 * np.sin(a + b))


def test_grazing_motion_is_repaired(tmp_path: Path) -> None:
    """The repaired motion keeps its ends, and dense samples by Coal keep clearance."""
    x, y = tip_at(0.6, 0.3)
    this = asked(tmp_path, (1.04 * x, 1.04 * y, 0.03))
    assert verify_robot(this, named(Motion(OVER))).verdict == "refuted"
    found = repair_robot(this, rows_of(OVER))
    assert found.verification.verdict == "certified"
    rows = found.verification.trajectory.q
    assert rows[[0, -1]].tolist() == OVER.tolist()
    assert found.given[[0, -1]].tolist() == [0, 1]
    assert 0.0 < found.moved.max() < 0.2
    for a, b in pairwise(rows):
        for share in np.linspace(0.0, 1.0, 40):
            poses = this.robot.tree.poses((a + share * (b - a))[None])
            all_poses = np.repeat(poses, this.asked.table.size, axis=0)
            table = this.asked.table
            distances = this.distances(table.one, table.other, all_poses)
            assert distances.min() >= 1e-3 - 5e-6


def test_errors_are_kept_in_reserve(tmp_path: Path) -> None:
    """A motion that is clear only without errors is moved until it is with them."""
    x, y = tip_at(0.6, 0.3)
    this = asked(tmp_path, (1.1 * x, 1.1 * y, 0.05))
    assert verify_robot(this, named(Motion(OVER))).verdict == "certified"
    errors = TypedErrorBox(joint_deg=0.5, base_mm=20.0, base_deg=0.5)
    assert verify_robot(this.under(errors), named(Motion(OVER))).verdict != "certified"
    found = repair_robot(this.under(errors), rows_of(OVER))
    assert found.verification.verdict == "certified"
    assert found.verification.errors == ErrorBox().widened(errors)
    assert 0.0 < found.moved.max() < 0.3


@pytest.mark.parametrize("degree", [3, 5])
def test_smooth_motion_is_repaired_as_a_smooth_one(tmp_path: Path, degree: int) -> None:
    """The curve that a controller runs is clear, and ends where it did, as fast."""
    x, y = tip_at(0.6, 0.3)
    this = asked(tmp_path, (1.04 * x, 1.04 * y, 0.03))
    times, rates = np.array([0.0, 4.0]), np.array([[0.0, 0.0], [0.05, 0.02]])
    more = {"times": times, "rates": rates}
    if degree == 5:
        more["changes"] = np.array([[0.0, 0.0], [0.01, 0.0]])
    given = rows_of(OVER, **more)
    assert verify_robot(this, given).verdict == "refuted"
    found = repair_robot(this, given)
    motion = found.trajectory
    assert found.verification.verdict == "certified"
    assert found.verification.trajectory is motion
    assert motion.rates is not None
    assert motion.path.degree == degree
    assert motion.path.same_as(found.verification.trajectory.path)
    assert motion.q[[0, -1]].tolist() == OVER.tolist()
    assert motion.rates[[0, -1]].tolist() == rates.tolist()
    assert 0.0 < found.moved.max() < 0.3
    assert motion.times is not None
    base = given.path.at(motion.times)
    np.testing.assert_allclose(found.moved, np.abs(motion.q - base).max(axis=1))
    for q in motion.path.at(np.linspace(0.0, 4.0, 800)):
        poses = np.repeat(this.robot.tree.poses(q[None]), this.asked.table.size, axis=0)
        table = this.asked.table
        near = this.distances(table.one, table.other, poses)
        assert near.min() >= 1e-3 - 5e-6
    # As it is written it is the same motion.
    (tmp_path / "t.csv").write_text(csv_text(motion, this.robot))
    assert read_path(tmp_path / "t.csv", this.robot).same_as(motion.path)


def test_certified_motion_stays(tmp_path: Path) -> None:
    """Nothing is changed where nothing is wrong."""
    found = repair_robot(asked(tmp_path, (5.0, 5.0, 0.1)), rows_of(OVER))
    assert found.verification.trajectory.q.tolist() == OVER.tolist()
    assert not found.moved.any()


def test_robot_without_moving_joints_stays(tmp_path: Path) -> None:
    """Certified as it stands, or refused where it stands in the way."""
    file = tmp_path / "still.urdf"
    file.write_text(URDF.replace("revolute", "fixed"))
    for x, good in ((2.0, True), (0.3, False)):
        ball = Sphere("ball", np.array([x, 0.0, 0.0]), 0.1)
        cell = Cell(read_robot(RobotFiles(file)), Scene((ball,)), 1e-3)
        motion = JointTrajectory((), np.zeros((2, 0)))
        if good:
            assert repair_robot(cell, motion).moved.tolist() == [0.0, 0.0]
            continue
        with pytest.raises(Infeasible, match="waypoint 0 stays"):
            repair_robot(cell, motion)


def test_pinned_waypoint_in_the_way_is_named(tmp_path: Path) -> None:
    """Start, goal and pinned rows are not moved, whatever lies there."""
    x, y = tip_at(0.6, 0.3)
    rows = np.array([[0.0, 0.3], [0.6, 0.3], [1.2, 0.3]])
    this = asked(tmp_path, (x, y, 0.03))
    with pytest.raises(Infeasible, match="waypoint 1 stays, and there fore and ball0"):
        repair_robot(this, rows_of(rows), pinned=(1,))
    with pytest.raises(InvalidInput, match="pinned waypoint is 3, expected 0 to 2"):
        repair_robot(this, rows_of(rows), pinned=(3,))


def test_wall_that_no_small_change_leads_round_is_refused(tmp_path: Path) -> None:
    """A column of balls across the whole reach."""
    wall = [(r * np.cos(0.8), r * np.sin(0.8), 0.05) for r in np.arange(0.1, 0.9, 0.06)]
    with pytest.raises(Infeasible):
        repair_robot(asked(tmp_path, *wall), rows_of(OVER))


def test_two_balls_that_are_too_close_to_pass_between_are_named(
    tmp_path: Path,
) -> None:
    x, y = tip_at(0.6, 0.3)
    balls = (1.04 * x, 1.04 * y, 0.05), (0.9 * x, 0.9 * y - 0.14, 0.05)
    told = "fore and ball1 are too near, and what moves them apart brings fore and"
    with pytest.raises(Infeasible, match=f"of the last attempt: {told} ball0 together"):
        repair_robot(asked(tmp_path, *balls), rows_of(OVER))


def test_what_is_written_is_read_back_to_the_same_numbers(tmp_path: Path) -> None:
    """Bit by bit."""
    robot = asked(tmp_path).robot
    rows = np.random.default_rng(1).uniform(-3.0, 3.0, (20, 2))
    file = tmp_path / "t.csv"
    file.write_text(csv_text(rows_of(rows), robot))
    assert read_path(file, robot).knots.tolist() == rows.tolist()


def test_command_writes_what_verify_certifies(tmp_path: Path) -> None:
    """`vdsm repair`, then `vdsm verify` of what it wrote."""
    this = asked(tmp_path)
    x, y = tip_at(0.6, 0.3)
    (tmp_path / "scene.yaml").write_text(
        "length_unit: m\nobstacles:\n"
        f"- {{name: ball, shape: sphere, center: [{1.04 * x}, {1.04 * y}, 0], "
        "radius: 0.03}\n"
    )
    (tmp_path / "t.csv").write_text(csv_text(rows_of(OVER), this.robot))
    common = ["--urdf", str(tmp_path / "two.urdf"), "--scene"]
    common += [str(tmp_path / "scene.yaml"), "--trajectory"]
    out = tmp_path / "out"
    given = ["repair", *common, str(tmp_path / "t.csv"), "--out", str(out)]
    ended = CliRunner().invoke(app, given, obj="vdsm repair")
    assert ended.exit_code == 0, ended.output
    assert "✓ certified" in ended.output and "largest change" in ended.output
    # Both joints turn; the rows of repair.json are in radians.
    most = re.search(r"largest change +([0-9.]+)°$", ended.output, re.MULTILINE)
    rows = json.loads((out / "repair.json").read_text())["waypoints"]
    assert most
    told = math.radians(float(most[1]))
    assert told == pytest.approx(max(row["moved"] for row in rows), abs=1e-5)
    moved = json.loads((out / "repair.json").read_text())["waypoints"]
    assert moved[0] == {"given": 0, "moved": 0.0}
    again = ["verify", *common, str(out / "trajectory.csv"), "--out"]
    ended = CliRunner().invoke(app, [*again, str(tmp_path / "v")], obj="vdsm verify")
    assert ended.exit_code == 0, ended.output


def test_waypoints_are_not_added_at_the_time_of_another_one() -> None:
    """Moments that differ by rounding have one time; a motion like that is no path."""
    times, same = np.array([5.0, 5.5, 9.0]), np.nextafter(1.0 / 3.0, 1.0)
    moments = np.array([same, np.nextafter(1.0, 0.0), 1.5, 1e-9])
    found = Places.within(np.array([3, 1]), moments, times)
    assert found.moments.tolist() == [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 1.5, 2.0]
    assert (np.diff(found.through(times)) > 0.0).all()
    assert len(Places.within(np.array([3, 1]), moments).moments) == 9


@pytest.mark.parametrize("seconds", [1.5, 8.0])
def test_new_waypoints_leave_joints_the_time_that_they_need(
    tmp_path: Path, seconds: float
) -> None:
    """1.2 rad at 1 rad/s; where they were put, they went faster even in 8 s."""
    x, y = tip_at(0.6, 0.3)
    this = asked(tmp_path, (1.04 * x, 1.04 * y, 0.03))
    found = repair_robot(this, rows_of(OVER, times=np.array([0.0, seconds])))
    assert found.verification.verdict == "certified"
    motion = found.verification.trajectory
    assert motion.times is not None
    assert motion.times[[0, -1]].tolist() == [0.0, seconds]
    speeds = np.abs(np.diff(motion.q, axis=0)) / np.diff(motion.times)[:, None]
    np.testing.assert_allclose(speeds.max(axis=1), speeds.max(), rtol=1e-9, atol=0)


def test_times_are_spread_between_given_waypoints_alone() -> None:
    """By hand: 1 + 3 of 2 rad/s in [0, 8], then 1 + 1 of 4 m in [8, 9], then none."""
    q = np.array([[0, 0], [1, 0], [-2, 4], [-2, 5], [-2, 6], [-2, 6], [-2, 6]], float)
    times = np.array([0.0, 1.0, 8.0, 8.9, 9.0, 9.5, 10.0])
    given = np.array([1, 0, 1, 0, 1, 1, 1], bool)
    motion = rows_of(q, times=times)
    found = spread(motion, given, np.array([0.5, np.inf]))
    assert found.tolist() == [0.0, 2.0, 8.0, 8.5, 9.0, 9.5, 10.0]
    # Where a new waypoint would have the time of another one, all stay as they were.
    given[5] = False
    assert spread(motion, given, np.array([0.5, np.inf])).tolist() == times.tolist()
