"""Robots from URDF, scenes and trajectories: closed forms, Pinocchio, bad files."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.shortcuts import named, read_path, read_scene

from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile, VdsmError
from vdsm_pin.geometry.arrays import rotation_from_rpy
from vdsm_pin.geometry.solids import Box, Cylinder, HalfSpace, Sphere
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.report.files import VerificationFile
from vdsm_pin.report.robot_facts import reached
from vdsm_pin.robots.by_itself import pose_difference
from vdsm_pin.robots.cell import Cell, cell_of, read_cell
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.judgement import NEAR, verify_robot
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.trajectory_files import read_motion
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.coal_shapes import CoalShapes, Sides
from vdsm_pin.verification.records import CheckKind, Verdict

URDF = """<robot name="two">
  <link name="base"><collision>
    <geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <link name="arm"><collision><origin xyz="1 0 0"/>
    <geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="hand"><collision><origin xyz="0 0 0.3" rpy="0.3 0 0"/>
    <geometry><cylinder radius="0.05" length="0.2"/></geometry></collision></link>
  <link name="finger"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 2"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/>
    <origin xyz="1 0 0" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-0.1" upper="0.4" effort="1" velocity="1"/></joint>
  <joint name="follow" type="revolute"><parent link="hand"/><child link="finger"/>
    <axis xyz="1 1 0"/><mimic joint="slide" multiplier="2" offset="0.1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>
"""
SCENE = """length_unit: mm
obstacles:
  - {name: ball, shape: sphere, center: [0, 1300, 500], radius: 50}
"""
CELL = """vdsm_problem: 1
robot: {urdf: two.urdf}
required_clearance: 149
"""
ROWS = "turn_rad,slide_m\n0,0\n3,0\n"
MOVEIT = """world:
  collision_objects:
    - id: can
      primitives: [{type: cylinder, dimensions: [0.2, 0.05]}]
      primitive_poses:
        - {position: [0, 0, 3], orientation: [0, 0.70710678, 0, 0.70710678]}
    - id: floor
      planes: [{coef: [0, 0, 2, 1]}]
      plane_poses: [{position: {x: 0, y: 0, z: -1}}]
"""


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return read_robot(RobotFiles(write(tmp_path, "two.urdf", URDF)))


def test_poses_are_pinocchios(robot: Robot) -> None:
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 2))
    assert [joint.name for joint in robot.joints] == ["turn", "slide"]
    assert pose_difference(robot, q).max() < 1e-12
    other = replace(robot, text=URDF.replace("0 0 0.5", "0 0 0.6"))
    assert pose_difference(other, q).min() == pytest.approx(0.1)


def test_the_least_clearance_is_the_closed_form(tmp_path: Path, robot: Robot) -> None:
    # The arm's ball runs on a circle of 1 m, the other stands 1.3 m away: 150 mm left.
    scene = read_scene(write(tmp_path, "s.yaml", SCENE), 1.0)
    path = read_path(write(tmp_path, "t.csv", ROWS), robot)
    found = verify_robot(Cell(robot, scene, 0.149), named(path))
    assert found.verdict is Verdict.CERTIFIED, found.checks
    near = found.approaches[0]
    assert (near.pair.own, near.pair.label) == ("arm", "ball")
    assert near.lower <= 0.15 <= near.upper
    assert near.upper - near.lower < 0.02 * 0.15
    assert near.moment == pytest.approx(np.pi / 6.0, abs=0.05)
    assert near.coal == pytest.approx(near.upper, abs=5e-6)
    lost = verify_robot(Cell(robot, scene, 0.151), named(path))
    assert lost.verdict is Verdict.REFUTED
    np.testing.assert_allclose(
        np.linalg.norm(near.link_point - near.other_point), near.upper, atol=1e-6
    )


@pytest.mark.parametrize("depth", [-2e-6, 2e-6, 5e-6, 2e-5])
@pytest.mark.parametrize("ends", [(-1.1, 1.3), (-3.0, 0.7), (-0.2, 2.9)])
def test_what_grazes_for_a_moment_is_decided(
    tmp_path: Path, ends: tuple[float, float], depth: float
) -> None:
    """The edges of a bar that turns reach as far as they are long, for a moment."""
    text = """<robot name="bar"><link name="base"/><link name="bar"><collision>
      <origin xyz="0.3 0 0"/><geometry><box size="0.4 0.04 0.04"/></geometry>
      </collision></link><joint name="turn" type="continuous"><parent link="base"/>
      <child link="bar"/><axis xyz="0 0 1"/></joint></robot>"""
    half, reach = np.array([0.1, 0.9, 0.7]), float(np.hypot(0.5, 0.02))
    centre = np.array([reach - depth + half[0], 0.1, 0.05])
    wall = Box("wall", centre, np.eye(3), half)
    bar = read_robot(RobotFiles(write(tmp_path, "bar.urdf", text)))
    found = verify_robot(
        Cell(bar, Scene((wall,))), named(Motion(np.array(ends)[:, None]))
    )
    (row,) = (one for one in found.checks if one.name == CheckKind.OBSTACLES)
    assert row.verdict is (Verdict.REFUTED if depth > 0.0 else Verdict.CERTIFIED)
    assert -depth / 2.0 <= row.worst < 0.0 if depth > 0.0 else row.worst <= -depth


def test_what_is_not_judged_in_time_is_undecided(tmp_path: Path, robot: Robot) -> None:
    """Also where no pair was looked at, so that Coal has nothing to measure."""
    scene = read_scene(write(tmp_path, "s.yaml", SCENE), 1.0)
    path = read_path(write(tmp_path, "t.csv", ROWS), robot)
    found = verify_robot(Cell(robot, scene), named(path), Deadline.after(0.0))
    assert found.verdict is Verdict.UNDECIDED


def test_without_a_pair_to_check_nothing_is_green(tmp_path: Path) -> None:
    ignored = "".join(
        f'<disable_collisions link1="{one}" link2="{other}"/>'
        for one, other in (("base", "arm"), ("arm", "hand"), ("base", "hand"))
    )
    srdf = write(tmp_path, "r.srdf", f'<robot name="two">{ignored}</robot>')
    urdf = write(tmp_path, "two.urdf", URDF)
    cell = cell_of(RobotFiles(urdf=urdf, srdf=srdf))
    rows = verify_robot(cell, named(Motion(np.array([[0.0, 0.0], [1.0, 0.0]]))))
    assert rows.verdict is Verdict.UNDECIDED
    bad = [row for row in rows.checks if row.verdict is not Verdict.CERTIFIED]
    assert [(row.name, row.count) for row in bad] == [("clearance between links", 0)]
    assert bad[0].where.startswith("no pair to check")


@pytest.mark.parametrize("wrong", [None, "nearer", "farther"])
def test_far_pairs_are_held_against_balls_by_coal(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, wrong: str | None
) -> None:
    """Near pairs and the ten that are listed are measured, the others' balls asked."""
    balls = [Sphere(f"b{k}", np.array([3.0, 0.0, float(k)]), 0.1) for k in range(9)]
    true = CoalShapes.between_balls

    def moved(self: CoalShapes, poses: Any, sides: Sides) -> Any:
        low, high = true(self, poses, sides)
        far = {None: 0.0, "nearer": -9.0, "farther": 9.0}[wrong]
        return low + far, high + far

    monkeypatch.setattr(CoalShapes, "between_balls", moved)
    cell, path = Cell(robot, Scene(tuple(balls))), Motion(np.array([[0.0, 0.0]]))
    found = verify_robot(cell, named(path))
    (row,) = [check for check in found.checks if "Coal" in check.name]
    near = (found.least.lower < NEAR).sum()
    assert row.count == max(near, len(found.approaches)) < len(found.pairs)
    assert "the others are far, by balls about the bodies" in row.where
    good = Verdict.UNDECIDED if wrong else Verdict.CERTIFIED
    assert row.verdict is good and (row.worst > 1.0) == bool(wrong)
    assert all(np.isfinite(one.coal) for one in found.approaches)


def test_a_shape_that_coal_cannot_take_is_named(tmp_path: Path) -> None:
    """A flat hull, of which Coal measures nothing, beside others, which it does."""
    plate = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0.1 0.1 0\nf 1 2 3\nf 2 4 3\n"
    write(tmp_path, "plate.obj", plate)
    mesh = '<mesh filename="plate.obj"/>'
    text = URDF.replace('<cylinder radius="0.05" length="0.2"/>', mesh)
    urdf = RobotFiles(write(tmp_path, "two.urdf", text))
    cell = cell_of(urdf, write(tmp_path, "s.yaml", SCENE))
    found = verify_robot(cell, named(Motion(np.array([[0.0, 0.0], [1.0, 0.1]]))))
    (row,) = [check for check in found.checks if "Coal" in check.name]
    assert row.verdict is Verdict.CERTIFIED
    assert row.where.endswith("; none of 'hand', whose shape Coal cannot take")


def test_a_robot_of_which_nothing_moves_is_judged_where_it_stands(
    tmp_path: Path,
) -> None:
    """The ball on the arm, locked at a right angle, is 150 mm from the other."""
    urdf = write(tmp_path, "two.urdf", URDF)
    lock = {"turn": np.pi / 2, "slide": 0.0}
    robot = read_robot(RobotFiles(urdf, lock=lock))
    path = read_path(write(tmp_path, "t.csv", "time_s\n0\n1\n"), robot)
    scene = read_scene(write(tmp_path, "s.yaml", SCENE), 1.0)
    for required, verdict in ((0.149, "certified"), (0.151, "refuted")):
        found = verify_robot(Cell(robot, scene, required), named(path))
        assert found.verdict.value == verdict
        assert found.min_clearance == pytest.approx(0.15, abs=1e-9)


def test_the_profile_is_the_least_of_each_link_and_obstacle(
    tmp_path: Path, robot: Robot
) -> None:
    """The arm's ball in closed form, interval by interval, from both columns."""
    scene = read_scene(write(tmp_path, "s.yaml", SCENE), 1.0)
    turns = np.linspace(0.0, 3.0, 40)
    path = Motion(np.column_stack([turns, np.zeros(40)]))
    profile = verify_robot(Cell(robot, scene), named(path)).profile
    fine = np.linspace(turns[:-1], turns[1:], 50)
    gap = np.hypot(np.cos(fine), np.sin(fine) - 1.3) - 0.15
    k = [body.name for body in robot.bodies].index("arm")
    least = gap.min(axis=0)
    assert (profile.link_lower[:, k] <= least).all()
    assert (least <= profile.link_upper[:, k] + 1e-3).all()
    # Another link may be nearer to the ball, where the arm is far.
    assert (profile.obstacle_lower[:, 0] <= least).all()
    assert profile.obstacle_upper.min() == profile.link_upper.min()
    assert profile.obstacle_upper.min() == pytest.approx(0.15, rel=0.03)


def test_what_meets_is_refuted_though_nothing_is_required(
    tmp_path: Path, robot: Robot
) -> None:
    text = (
        "length_unit: m\nobstacles:\n  - {name: crate, shape: box, center: [X, 0, 0], "
    )
    for x, verdict in ((0.15, Verdict.REFUTED), (0.31, Verdict.CERTIFIED)):
        scene = write(
            tmp_path, "s.yaml", text.replace("X", str(x)) + "size: [0.2, 1, 0.05]}"
        )
        rows = read_path(write(tmp_path, "t.csv", ROWS), robot)
        found = verify_robot(Cell(robot, read_scene(scene, 1.0)), named(rows))
        k = [str(pair) for pair in found.pairs].index("base and crate")
        assert found.least.verdict[k] == (verdict is Verdict.REFUTED)


def test_of_bodies_that_meet_the_depth_is_told_as_the_least(
    tmp_path: Path, robot: Robot
) -> None:
    crate = "{name: crate, shape: box, center: [0.15, 0, 0], size: [0.2, 1, 0.05]}"
    text = f"length_unit: m\nobstacles: [{crate}]\n"
    scene = read_scene(write(tmp_path, "s.yaml", text), 1.0)
    rows = read_path(write(tmp_path, "t.csv", ROWS), robot)
    found = verify_robot(Cell(robot, scene, required_clearance=0.01), named(rows))
    (row,) = (one for one in found.checks if one.name == "clearance from obstacles")
    assert row.verdict is Verdict.REFUTED
    assert row.deeper
    assert -0.05 <= row.worst < -0.005  # they share a slab of 50 mm
    near = next(one for one in found.approaches if str(one.pair) == "base and crate")
    assert (near.upper, near.deeper) == (row.worst, True)
    # The arm's ball of 100 mm comes 80 mm deep into a wall; what both hold is smaller.
    wall = HalfSpace("wall", np.array([0.0, 1.02, 0.0]), np.array([0.0, -1.0, 0.0]))
    deep = verify_robot(Cell(robot, Scene((wall,))), named(rows))
    near = next(one for one in deep.approaches if str(one.pair) == "arm and wall")
    assert -0.08 - 1e-9 <= near.upper <= 0.9 * -0.08
    ball = read_scene(write(tmp_path, "s.yaml", SCENE), 1.0)
    apart = verify_robot(Cell(robot, ball, required_clearance=0.151), named(rows))
    assert apart.verdict is Verdict.REFUTED
    assert not any(one.deeper for one in (*apart.checks, *apart.approaches))


def test_the_hash_covers_the_meshes_of_links_and_scene(tmp_path: Path) -> None:
    """One bit of any file that is read changes it; the scene may name files too."""
    corner = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\nf 1 2 4\nf 2 3 4\n"
    sphere = '<sphere radius="0.1"/>'
    files = {
        "two.urdf": URDF.replace(sphere, '<mesh filename="arm.obj"/>'),
        "arm.obj": corner,
        "part.obj": corner,
        "s.yaml": "length_unit: m\nobstacles:\n  - {name: part, shape: mesh, "
        "file: part.obj, solid: false, check_size: false, center: [5, 0, 0]}\n",
    }
    for name, content in files.items():
        write(tmp_path, name, content)
    asked = RobotFiles(tmp_path / "two.urdf"), tmp_path / "s.yaml"
    before = cell_of(*asked).source
    assert before is not None
    assert {path.name for path in before.files} == files.keys()
    for name, content in files.items():
        write(tmp_path, name, content + "\n")
        changed = cell_of(*asked).source
        assert changed is not None
        assert changed.sha256 != before.sha256, name
        write(tmp_path, name, content)


def test_limits_are_checked_at_and_between_waypoints(
    tmp_path: Path, robot: Robot
) -> None:
    scene = read_scene(write(tmp_path, "s.yaml", SCENE), 1.0)
    past = read_path(
        write(tmp_path, "t.csv", "turn_deg,slide_mm\n0,0\n90,401\n"), robot
    )
    found = verify_robot(Cell(robot, scene), named(past))
    refuted = [c.name for c in found.checks if c.verdict is Verdict.REFUTED]
    assert refuted == ["joint 'slide' in its limits"]
    still = read_path(write(tmp_path, "r.csv", "turn_deg,slide_mm\n0,0\n"), robot)
    turn = verify_robot(Cell(robot, scene), named(still)).checks[1]
    assert turn.limit == robot.joints[0].upper == -robot.joints[0].lower
    # From 0.39 back to it at a speed of v the slide goes v / 4 farther, the control
    # points v / 3; its limit is 0.4.
    for speed, verdict in ((0.036, "certified"), (0.044, "refuted"), (1.0, "refuted")):
        ends = [([0.39, 0], speed, 0), ([0.39, 1], -speed, 1)]
        points = [
            {"positions": q, "velocities": [v, 0], "time_from_start": t}
            for q, v, t in ends
        ]
        message = {"joint_names": ["slide", "turn"], "points": points}
        file = write(tmp_path, "t.json", json.dumps(message))
        smooth = read_motion(file, robot.joints, None, robot.values)
        assert smooth.path.degree == 3
        assert smooth.q.tolist() == [[0.0, 0.39], [1.0, 0.39]]
        checks = verify_robot(Cell(robot, scene), smooth).checks
        (limit,) = (c for c in checks if c.name == "joint 'slide' in its limits")
        assert limit.verdict.value == verdict
        if verdict == "refuted":
            assert limit.moment == 0.5
            assert limit.worst == pytest.approx(0.39 + speed / 4)


@pytest.mark.parametrize(
    ("follower", "limits", "verdict", "whose"),
    [
        ('lower="-3" upper="3"', (-0.1, 0.4, 0.5), "certified", ""),
        ('lower="0.3" upper="0.5"', (0.1, 0.2, 0.5), "refuted", "'follow'"),
        ('lower="-9" upper="9"', (-0.1, 0.4, 0.5), "certified", ""),
        ('lower="2" upper="3"', (-0.1, 0.4, 0.5), "certified", ""),
    ],
)
def test_a_joint_is_held_to_the_limits_of_what_mimics_it(
    tmp_path: Path,
    follower: str,
    limits: tuple[float, float, float],
    verdict: str,
    whose: str,
) -> None:
    """Follow = 2 slide + 0.1, at 1 rad/s; limits that leave no room do not count."""
    head, tail = URDF.split('offset="0.1"/>')
    text = head + 'offset="0.1"/>' + tail.replace('lower="-3" upper="3"', follower)
    robot = read_robot(RobotFiles(write(tmp_path, "two.urdf", text)))
    slide = robot.joints[1]
    assert (slide.lower, slide.upper, slide.velocity) == pytest.approx(limits)
    rows = "turn_rad,slide_m,time_s\n0,0.1,0\n0.2,0.3,1\n"
    path = read_path(write(tmp_path, "t.csv", rows), robot)
    scene = read_scene(write(tmp_path, "s.yaml", SCENE), 1.0)
    checks = verify_robot(Cell(robot, scene), named(path)).checks
    (row,) = (c for c in checks if c.name == "joint 'slide' in its limits")
    assert row.verdict.value == verdict
    assert whose in row.where
    (rate,) = (c for c in checks if c.name == "joint 'slide' in its velocity limit")
    assert (rate.verdict, rate.limit) == (Verdict.CERTIFIED, 0.5)
    assert "'follow'" in rate.where


@pytest.mark.parametrize(
    ("change", "lock", "why"),
    [('multiplier="0" offset="3.1"', {}, "it stands at 3.1"),
     ('multiplier="2" offset="3.1"', {"slide": 0.1}, "it stands at 3.3"),
     ('multiplier="2" offset="2.8"', {"slide": 0.1}, ""),
     ('multiplier="2" offset="5"', {}, "they leave joint 'slide', which it mimics, no"),
     ('multiplier="-30" offset="-3"', {}, ""),
     ('multiplier="-1" offset="-2.9"', {}, "")],
)  # fmt: skip
def test_limits_of_a_mimic_that_cannot_be_kept_are_noted(
    tmp_path: Path, change: str, lock: dict[str, float], why: str
) -> None:
    """As of a gripper whose fingers turn against each other with the same limits."""
    text = URDF.replace('multiplier="2" offset="0.1"', change)
    robot = read_robot(RobotFiles(write(tmp_path, "two.urdf", text), lock=lock))
    found = [note for note in robot.notes if "limits of joint 'follow'" in note]
    assert len(found) == bool(why)
    assert all(f"-3 to 3, are not judged: {why}" in note for note in found)
    if not lock and why:
        slide = robot.joints[1]
        assert (slide.lower, slide.upper) == (-0.1, 0.4)
        assert slide.velocity == (1.0 if 'r="0"' in change else 0.5)


def test_a_joint_without_room_of_its_own_is_left_none_by_no_mimic(
    tmp_path: Path,
) -> None:
    """Limits of equal ends; those of the mimic hold them, and are kept."""
    text = URDF.replace('lower="-0.1" upper="0.4"', 'lower="0.2" upper="0.2"')
    robot = read_robot(RobotFiles(write(tmp_path, "two.urdf", text)))
    assert not [note for note in robot.notes if "not judged" in note]
    slide = robot.joints[1]
    assert (slide.lower, slide.upper, slide.velocity) == (0.2, 0.2, 0.5)


def test_ranges_of_joints_hold_what_lies_between_rows() -> None:
    """Of a cubic piece between equal values a parabola, v h / 4 high: closed form."""
    rates = np.array([[0.8, -0.4], [-0.8, 0.4]])
    path = Motion.through(np.zeros((2, 2)), np.array([0.0, 1.0]), rates)
    np.testing.assert_allclose(reached(path), [[0.0, -0.1], [0.2, 0.0]], atol=1e-15)


def test_planning_scenes_are_read_as_they_stand(tmp_path: Path) -> None:
    can, floor = read_scene(write(tmp_path, "m.yaml", MOVEIT), 1.0).obstacles
    assert isinstance(can, Cylinder)
    np.testing.assert_allclose(np.abs(can.axis), [1, 0, 0], atol=1e-8)
    assert isinstance(floor, HalfSpace)
    assert floor.normal @ floor.point == pytest.approx(-1.5)


def test_planning_scenes_are_whole_and_in_one_frame(tmp_path: Path) -> None:
    files = RobotFiles(write(tmp_path, "two.urdf", URDF))

    def framed(text: str, of: str, frame: str) -> str:
        return text.replace(of, f"{of}\n      header: {{frame_id: {frame}}}")

    both = framed(framed(MOVEIT, "id: can", "world"), "id: floor", "world")
    assert len(cell_of(files, write(tmp_path, "s.yaml", both)).scene.obstacles) == 2
    for text, expected in (
        (f"is_diff: true\n{MOVEIT}", "expected a whole one"),
        (framed(MOVEIT, "id: can", "world"), "in the frame '', expected that of"),
        (both.replace("world}", "/hand}"), "in the frame '/hand', expected that of"),
    ):
        with pytest.raises(InvalidFile, match=expected):
            cell_of(files, write(tmp_path, "s.yaml", text))


def test_pairs_follow_the_srdf(tmp_path: Path) -> None:
    urdf = write(tmp_path, "two.urdf", URDF)
    assert [one.reason for one in read_robot(RobotFiles(urdf)).left_out] == [
        "neighbours, joined by one joint",
        "neighbours, joined by one joint",
    ]
    entry = '<disable_collisions link1="arm" link2="base" reason="Adjacent"/>'
    srdf = write(tmp_path, "two.srdf", f"<robot>{entry}</robot>")
    robot = read_robot(RobotFiles(urdf, srdf))
    assert len(robot.held) == 2
    assert robot.left_out[0].reason == "left out by the SRDF: Adjacent"
    # As some robots' own files do, which MoveIt takes: it leaves out no pair more.
    other = entry.replace("arm", "leg")
    write(tmp_path, "two.srdf", f"<robot>{entry}{other}{other}</robot>")
    again = read_robot(RobotFiles(urdf, srdf))
    assert (again.held, again.left_out) == (robot.held, robot.left_out)
    (note,) = set(again.notes) - set(robot.notes)
    assert note == "disable_collisions of the SRDF names no links: 'leg'"


BAD = [
    ("<limit lower", "<limit upper='-5' lower", "not XML"),
    ('lower="-3" upper="3"', 'lower="3" upper="-3"', "is above upper limit"),
    ('<child link="arm"/>', '<child link="leg"/>', "'leg' does not exist"),
    ('<parent link="base"/>', '<parent link="finger"/>', "ancestor: a loop"),
    ("</robot>", '<link name="more"/></robot>', "expected one root link, found 2"),
    ('<link name="finger"/>', '<link name="f"/>', "'finger' does not exist"),
    ('type="prismatic"', 'type="ball"', "type 'ball', expected one of"),
    ('type="prismatic"', 'type="floating"', "'slide', which is no joint of one value"),
    ('type="prismatic"', 'type="planar"', "expected 0 0 1 of a planar joint"),
    ('velocity="1"', 'velocity="-1"', "limit velocity is '-1', expected 0 or more"),
    ('joint="slide"', 'joint="follow"', "is no joint of one value or mimics it"),
    ('multiplier="2"', 'multiplier="x"', "expected a finite number"),
    ('<sphere radius="0.1"/>', '<mesh filename="a.stl"/>', "is not found"),
    ('<sphere radius="0.1"/>', '<mesh filename="$(arg d)/a"/>', "expected no $( )"),
    ('<axis xyz="0 0 2"/>', '<axis xyz="0 0 0"/>', "is no direction"),
    ("<collision>", "<nothing>", "not XML"),
]


@pytest.mark.parametrize(("old", "new", "expected"), BAD)
def test_odd_robots_are_refused_in_a_sentence(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    path = write(tmp_path, "bad.urdf", URDF.replace(old, new, 1))
    with pytest.raises(InvalidFile) as caught:
        read_robot(RobotFiles(path))
    assert expected in str(caught.value)


ODD_ROWS = {
    "turn_rad\n0\n": "no column for joint 'slide', expected slide_m",
    "turn_m,slide_m\n0,0\n": "expected _rad or _deg for this joint",
    "turn_rad,slide_m\n90,0\n": "is it in degrees? expected _deg, for any number",
    "turn_deg,slide_m\n0,0\n1.57,0\n": "look like radians",
    "turn;slide\n0;0\n": "'turn' without a unit, expected turn_rad or turn_deg",
    "turn_rad,slide\n0,0\n": "'slide' without a unit, expected slide_m or slide_mm",
    "turn_rad,Slide [m]\n0,0\n": "expected slide_m or slide_mm, not 'Slide [m]'",
    "turn_rad,slide2_m\n0,0\n": "expected slide_m or slide_mm; or state",
    "turn_rad,slide_m\n0,9\n": "is it in millimetres? expected _mm or metres, with",
    "turn_rad,slide_mm\n0,0\n0,0.3\n": "look like metres",
    "turn_rad,slide_m\n0,x\n": "expected a number",
    "turn_rad,slide_m\n": "has no row",
}


@pytest.mark.parametrize("text", ODD_ROWS)
def test_odd_trajectories_are_refused(tmp_path: Path, robot: Robot, text: str) -> None:
    with pytest.raises(InvalidFile) as caught:
        read_path(write(tmp_path, "t.csv", text), robot)
    assert ODD_ROWS[text] in str(caught.value)


def mutated(text: str, rng: np.random.Generator) -> str:
    data = bytearray(text.encode())
    for _ in range(int(rng.integers(1, 4))):
        data[int(rng.integers(len(data)))] = int(rng.integers(32, 127))
    return bytes(data[: int(rng.integers(len(data) // 2, len(data) + 1))]).decode()


def test_damaged_files_never_end_in_a_traceback(tmp_path: Path, robot: Robot) -> None:
    rng = np.random.default_rng(1)
    message = json.dumps(
        {
            "joint_trajectory": {
                "joint_names": ["turn", "slide"],
                "points": [{"positions": [0, 0.1], "time_from_start": {"sec": 1}}],
            }
        }
    )
    cell = CELL + SCENE + "base: {position: [0, 0, 1], rpy_deg: [0, 0, 90]}\n"
    write(tmp_path, "two.urdf", URDF)
    readers: list[tuple[str, str, Callable[[Path], object]]] = [
        ("cell.yaml", cell, read_cell),
        ("a.urdf", URDF, lambda file: read_robot(RobotFiles(file))),
        ("s.yaml", SCENE, lambda path: read_scene(path, 1.0)),
        ("m.yaml", MOVEIT, lambda path: read_scene(path, 1.0)),
        ("t.csv", ROWS, lambda path: read_path(path, robot)),
        ("t.json", message, lambda path: read_path(path, robot)),
    ]
    refused = 0
    for name, text, reader in readers:
        for _ in range(150):
            try:
                reader(write(tmp_path, name, mutated(text, rng)))
            except VdsmError as error:
                refused += 1
                assert len(str(error).splitlines()) == 1
    assert refused > 200


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("none.yaml", r"none\.yaml: does not exist"),
        (".", "is a folder, expected a file"),
        ("paper/obs1", "paper/obs1: does not exist"),  # an arm's, by its name
    ],
)
def test_a_cell_is_read_from_a_path(name: str, told: str) -> None:
    with pytest.raises(InvalidFile, match=rf"^{told}$|\.: {told}$"):
        read_cell(name)


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(str(ended.value.code))


def test_the_command_ends_with_the_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf = write(tmp_path, "two.urdf", URDF)
    scene, rows = write(tmp_path, "s.yaml", SCENE), write(tmp_path, "t.csv", ROWS)
    asked = ("verify", "--urdf", urdf, "--scene", scene, "--trajectory", rows)
    out = tmp_path / "out"
    assert run(*asked, "--out", out, "--required-clearance-mm", 149) == 0
    assert "certified  two" in capsys.readouterr().out
    file = json.loads((out / "verification.json").read_text())
    assert file["verdict"] == "certified"
    VerificationFile.model_validate(file)
    first = file["closest"][0]
    assert (first["body"], first["obstacle"]) == ("arm", "ball")
    assert [joint["name"] for joint in file["motion"]["joints"]] == ["turn", "slide"]
    assert file["left_out"][0]["body"] == "base"
    rows = (out / "clearance.csv").read_text().splitlines()
    assert len(rows) == 1 + 3 + 1  # three links to the ball, base to hand
    assert run(*asked, "--out", out, "--required-clearance-mm", 151) == 1
    assert run(*asked, "--out", out, "--lock", "elbow=1") == 2
    twice = "--lock", "slide=1", "--lock", "slide=2"
    assert run(*asked, "--out", out, *twice) == 2
    said = capsys.readouterr().err
    assert "has no joint 'elbow' to lock" in said
    assert "--lock is given twice for 'slide'" in said
    assert run("verify", "paper/obs1", *asked[1:], "--out", out) == 2
    assert "PROBLEM has no meaning with --urdf" in capsys.readouterr().err
    assert run("verify", "--trajectory", rows, "--out", out) == 2
    bad, nowhere = write(tmp_path, "bad.csv", "turn_rad\n0\n"), tmp_path / "nowhere"
    assert run(*asked[:-1], bad, "--out", nowhere) == 2
    assert not nowhere.exists()
    assert run("verify", "paper/obs1", "--lock", "a=1", *asked[5:], "--out", out) == 2


def test_a_problem_file_names_a_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same verdicts and brackets as by options; planning refuses it."""
    urdf, rows = write(tmp_path, "two.urdf", URDF), write(tmp_path, "t.csv", ROWS)
    scene, out = write(tmp_path, "s.yaml", SCENE), tmp_path / "out"
    problem = write(tmp_path, "cell.yaml", CELL + SCENE)
    pairs = []
    of_files = ("--urdf", urdf, "--scene", scene, "--required-clearance-mm", "149")
    for asked in (of_files, (problem,)):
        assert run("verify", *asked, "--trajectory", rows, "--out", out) == 0
        pairs.append(json.loads((out / "verification.json").read_text())["closest"])
    assert pairs[0] == pairs[1]
    for required, status in ((151, 1), (149, 0)):
        write(tmp_path, "cell.yaml", CELL.replace("149", str(required)) + SCENE)
        assert run("verify", problem, "--trajectory", rows, "--out", out) == status
    capsys.readouterr()
    for words in (
        ("plan", problem),
        ("verify", problem, "--trajectory", rows, "--all-pairs"),
        ("verify", problem, "--trajectory", rows, "--lock", "a=1"),
        ("verify", problem, "--trajectory", rows, "--required-clearance-mm", "0"),
    ):
        assert run(*words, "--out", out) == 2
    said = capsys.readouterr().err.splitlines()
    assert "robot (line" in said[0]
    assert "expected manipulator" in said[0]
    assert "--all-pairs has no meaning with a robot" in said[1]
    assert "--lock has no meaning with a problem" in said[2]
    assert "--required-clearance-mm has no meaning with a problem" in said[3]


def test_a_base_moves_the_robot_in_the_scene(tmp_path: Path) -> None:
    """Moving base and obstacles together changes no clearance."""
    write(tmp_path, "two.urdf", URDF)
    rng = np.random.default_rng(4)
    for _ in range(10):
        rpy, position, center = rng.uniform(-1.0, 1.0, (3, 3))
        R = rotation_from_rpy(rpy)
        turn, place = np.degrees(rpy).tolist(), (1e3 * position).tolist()
        there = (1e3 * (R @ center + position)).tolist()
        text = CELL + SCENE.replace("[0, 1300, 500]", str(there))
        text += f"base: {{position: {place}, rpy_deg: {turn}}}\n"
        (ball,) = read_cell(write(tmp_path, "cell.yaml", text)).scene.obstacles
        assert isinstance(ball, Sphere)
        np.testing.assert_allclose(ball.centre, center, atol=1e-12)


def test_whole_turns_of_a_base_are_taken_off_exactly(tmp_path: Path) -> None:
    write(tmp_path, "two.urdf", URDF)
    poses = []
    for yaw in (90.0, 90.0 + 360.0 * 2**31):
        text = CELL + SCENE + f"base: {{position: [0, 0, 1], rpy_deg: [0, 0, {yaw}]}}\n"
        poses.append(read_cell(write(tmp_path, "cell.yaml", text)).T_world_base)
    np.testing.assert_array_equal(*poses)
