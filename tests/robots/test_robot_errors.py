"""Error boxes of robots: Pinocchio and Coal at corners and inside, and bad input."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from oracles.certificate_cases import certificate_lines
from oracles.shortcuts import named

from vdsm_pin.certificate_checker.program import main as check_certificate_main
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.solids import Box, HalfSpace, Sphere
from vdsm_pin.problem.error_boxes import ErrorBox, TypedErrorBox
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.report.files import VerificationFile
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.judgement import verify_robot
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.verification.records import Verdict

URDF = """<robot name="two">
  <link name="base"><collision><origin xyz="0.3 0 0"/>
    <geometry><box size="0.8 0.2 0.1"/></geometry></collision></link>
  <link name="arm"><collision><origin xyz="0.5 0 0" rpy="0 1.5707963 0"/>
    <geometry><cylinder radius="0.05" length="0.8"/></geometry></collision></link>
  <link name="hand"><collision><origin xyz="0 0.1 0"/>
    <geometry><box size="0.1 0.3 0.1"/></geometry></collision></link>
  <link name="finger"><collision><origin xyz="0.1 0 0.2"/>
    <geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
    <origin xyz="0 0 0.3" rpy="0.1 0.2 0"/><axis xyz="0 0 2"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/>
    <origin xyz="1 0 0" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="follow" type="revolute"><parent link="hand"/><child link="finger"/>
    <axis xyz="1 1 0"/><mimic joint="turn" multiplier="-0.5" offset="0.1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>
"""
BOX = TypedErrorBox(
    joint_deg={"turn": 1.5},
    base_mm=4.0,
    base_deg=0.7,
    obstacle_mm=2.0,
    obstacles_mm={"ball": 3.0},
    obstacles_deg={"block": 2.0},
    slide_mm=6.0,
)
FOLLOW = 0.5 * np.radians(1.5)
"""What the mimicking joint may be off; [rad]."""

CELL = """vdsm_problem: 1
length_unit: mm
robot: {urdf: two.urdf}
required_clearance: 0
errors: ERRORS
obstacles:
  - {name: ball, shape: sphere, center: [0, 1800, 500], radius: 50}
  - {name: floor, shape: half_space, normal: [0, 0, 1], point: [0, 0, -900]}
"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    urdf = tmp_path_factory.mktemp("robot") / "two.urdf"
    urdf.write_text(URDF)
    return read_robot(RobotFiles(urdf))


def random_cell(robot: Robot, rng: np.random.Generator) -> tuple[Cell, Motion]:
    """A cell whose obstacles stand about the robot, and a motion of three rows."""
    places = [rng.normal(size=3) for _ in range(2)]
    ball, block = (p / np.linalg.norm(p) * rng.uniform(0.5, 1.6) for p in places)
    turn = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
    scene = Scene(
        (
            Sphere("ball", ball, 0.1),
            Box("block", block, turn, rng.uniform(0.02, 0.2, 3)),
            HalfSpace("floor", np.array([0.0, 0.0, -1.5]), np.array([0.0, 0.0, 1.0])),
        )
    )
    q = rng.uniform((-2.0, -0.3), (2.0, 0.3), (3, 2))
    return Cell(robot, scene, errors=BOX), Motion(q)


class Sampler:
    """Distances of links and obstacles by Pinocchio and Coal alone, errors applied."""

    def __init__(self, cell: Cell) -> None:
        self.model = pin.buildModelFromXML(URDF)
        kind = pin.GeometryType.COLLISION
        self.links = pin.buildGeomFromUrdfString(self.model, URDF, kind)
        self.scene = cell.scene

    def distances(
        self, q: FloatArray, rng: np.random.Generator, corner: bool
    ) -> dict[tuple[str, str], float]:
        """Of every link from every obstacle, and of links from links; [m].

        The errors are at a corner of the box or anywhere in it.
        """
        value = np.array([q[0], q[1], -0.5 * q[0] + 0.1])
        size = rng.choice([-1.0, 1.0], 3) if corner else rng.uniform(-1, 1, 3)
        value += size * [np.radians(1.5), 0.006, FOLLOW]
        data, geometry = self.model.createData(), self.links.createData()
        pin.updateGeometryPlacements(self.model, data, self.links, geometry, value)
        base = moved(np.eye(3), np.zeros(3), (0.004, np.radians(0.7)), rng, corner)
        of_links = {
            self.model.frames[one.parentFrame].name: (one.geometry, base * pose)
            for one, pose in zip(self.links.geometryObjects, geometry.oMg, strict=True)
        }
        found = {}
        for name, mine in of_links.items():
            for other, theirs in self._obstacles(rng, corner):
                found[name, other] = distance(mine, theirs)
            for other, theirs in of_links.items():
                found[name, other] = distance(mine, theirs)
        return found

    def gap_at(self, q: FloatArray, link: str, other: str) -> float:
        """Distance at values of the joints, nothing else off; [m]."""
        value, data = np.array([*q, 0.1 - 0.5 * q[0]]), self.model.createData()
        geometry = self.links.createData()
        pin.updateGeometryPlacements(self.model, data, self.links, geometry, value)
        (mine,) = (
            (one.geometry, pose)
            for one, pose in zip(self.links.geometryObjects, geometry.oMg, strict=True)
            if self.model.frames[one.parentFrame].name == link
        )
        still = self._obstacles(np.random.default_rng(0), corner=False, size=0.0)
        return distance(mine, dict(still)[other])

    def _obstacles(
        self, rng: np.random.Generator, corner: bool, size: float = 1.0
    ) -> Iterator[tuple]:
        """Size: how much of their errors counts."""
        ball, block, floor = self.scene.obstacles
        pose = moved(np.eye(3), ball.centre, (size * 0.003, 0.0), rng, corner)
        yield "ball", (coal.Sphere(ball.radius), pose)
        error = size * 0.002, size * np.radians(2.0)
        pose = moved(block.rotation, block.centre, error, rng, corner)
        yield "block", (coal.Box(*(2.0 * block.half_size)), pose)
        up = np.array(
            [0.0, 0.0, size * 0.002 * (1.0 if corner else rng.uniform(-1.0, 1.0))]
        )
        pose = pin.SE3(np.eye(3), up)
        yield "floor", (coal.Halfspace(0.0, 0.0, 1.0, floor.point[2]), pose)


def moved(
    turn: FloatArray,
    place: FloatArray,
    error: tuple[float, float],
    rng: np.random.Generator,
    corner: bool,
) -> pin.SE3:
    """A pose off by a shift and a turn about its origin (both as stated or less)."""
    way, axis = (x / np.linalg.norm(x) for x in rng.normal(size=(2, 3)))
    shift, angle = np.array(error) * (1.0 if corner else rng.uniform(size=2))
    return pin.SE3(pin.exp3(angle * axis) @ turn, place + shift * way)


def distance(one: tuple, other: tuple) -> float:
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    shapes = []
    for shape, pose in (one, other):
        shapes += [shape, coal.Transform3s(pose.rotation, pose.translation)]
    return float(coal.distance(*shapes, request, result))


@pytest.mark.parametrize("seed", range(6))
def test_no_sample_of_the_box_is_nearer_than_proved(robot: Robot, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell, path = random_cell(robot, rng)
    sampler, found = Sampler(cell), verify_robot(cell, named(path))
    least: dict[tuple[str, str], float] = {}
    for k in range(300):
        moment = rng.uniform(0.0, 2.0)
        row = path.within(np.array([int(moment)]), np.array([moment % 1.0]))[0]
        for pair, gap in sampler.distances(row, rng, corner=k % 2 == 0).items():
            least[pair] = min(gap, least.get(pair, np.inf))
    assert len(found.pairs) == 15
    for k, pair in enumerate(found.pairs):
        sampled = least[pair.own, pair.obstacle or pair.other_body]
        if found.least.lower[k] > 0.0:  # below, only the sign counts
            assert sampled >= found.least.lower[k] - 1e-6


def test_each_error_alone_is_covered(robot: Robot) -> None:
    """A ball above the base link, which only errors of base and ball reach."""
    scene = Scene((Sphere("ball", np.array([0.3, 0.0, -0.35]), 0.1),))
    path = Motion(np.zeros((1, 2)))

    def lower(**errors: float) -> float:
        found = verify_robot(Cell(robot, scene, errors=ErrorBox(**errors)), named(path))
        k = [pair.own for pair in found.pairs].index("base")
        return float(found.least.lower[k])

    assert lower() == pytest.approx(0.2, abs=1e-6)
    assert lower(base=0.01) == pytest.approx(0.19, abs=1e-6)
    assert lower(obstacle=0.02) == pytest.approx(0.18, abs=1e-6)
    assert lower(joint=0.1, slide=0.1) == pytest.approx(0.2, abs=1e-6)
    assert 0.19 > lower(base_turn=0.05) > 0.16  # an arm of 0.3 m, corners at 0.7 m


@pytest.mark.parametrize("seed", range(6))
def test_just_beyond_what_is_proved_is_refuted(robot: Robot, seed: int) -> None:
    """By a configuration within the errors, where Coal measures what is told."""
    cell, path = random_cell(robot, np.random.default_rng(seed))
    errors = TypedErrorBox(joint_deg=1.5, slide_mm=6.0, base_mm=4.0)
    cell, size = replace(cell, errors=errors), [np.radians(1.5), 0.006]
    proved = verify_robot(cell, named(path)).least
    asked = max(0.0, float(proved.lower[:12].min())) + 0.008
    found = verify_robot(replace(cell, required_clearance=asked), named(path))
    assert found.verdict is Verdict.REFUTED
    if not found.counterexamples:  # the nominal motion itself is too near
        exact = verify_robot(replace(cell, errors=ErrorBox()), named(path)).least
        assert exact.upper[:12].min() < asked
        return
    (one,) = found.counterexamples
    assert found.nominal_clear
    assert (np.abs(one.offsets) <= size).all()
    moment = np.array([one.interval]), np.array([one.share])
    np.testing.assert_allclose(
        one.joints - one.offsets, path.within(*moment)[0], atol=1e-12
    )
    gap = Sampler(cell).gap_at(one.joints, one.pair.own, one.pair.obstacle)
    assert gap - 0.004 == pytest.approx(one.clearance, abs=2e-6)
    assert one.clearance < asked


def test_mimic_joints_err_by_their_ratio(robot: Robot) -> None:
    """The finger turns by half of what the joint before it does."""
    errors = TypedErrorBox(joint_deg=1.0, slide_mm=2.0)
    box = Cell(robot, Scene()).asked.box(errors)
    expected = [0.0, np.radians(1.0), 0.002, np.radians(0.5)]
    np.testing.assert_allclose(box.joints, expected)


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ({"joint_deg": {"follow": 1.0}}, "follow"),
        ({"joint_deg": {"slide": 1.0}}, "in millimetres"),
        ({"slide_mm": {"turn": 1.0}}, "in degrees"),
        ({"joint_deg": [1.0, 2.0]}, "by name"),
        ({"obstacles_mm": {"nobody": 1.0}}, "nobody"),
        ({"obstacles_deg": {"floor": 1.0}}, "half-space"),
        ({"joint_deg": {"turn": -1.0}}, "'turn' error"),
    ],
)
def test_errors_of_what_there_is_not(
    robot: Robot, errors: dict[str, object], words: str
) -> None:
    cell = random_cell(robot, np.random.default_rng(0))[0]
    with pytest.raises(InvalidInput, match=words):
        cell.under(TypedErrorBox(**errors))  # type: ignore[arg-type]


def verified(folder: Path, errors: str, *options: str) -> int:
    (folder / "two.urdf").write_text(URDF)
    (folder / "cell.yaml").write_text(CELL.replace("ERRORS", errors))
    (folder / "t.csv").write_text("turn_rad,slide_m\n0,0\n1,0.1\n")
    words = f"verify {folder}/cell.yaml --trajectory {folder}/t.csv --out {folder}/out"
    with pytest.raises(SystemExit) as exit_status:
        main([*words.split(), *options])
    return int(exit_status.value.code or 0)


def test_the_errors_of_a_file_and_of_options_are_told(tmp_path: Path) -> None:
    options = "--joint-error-deg", "turn=0.5", "--obstacle-error-mm", "ball=3"
    written = "{slide: {slide: 2}, joint_deg: 0.1, base: 1}"
    assert verified(tmp_path, written, *options) == 0
    text = (tmp_path / "out/verification.json").read_text()
    box = VerificationFile.model_validate_json(text).error_box
    assert box.joint_error_rad == pytest.approx(np.radians(0.1))
    named = {one.name: (one.turn_rad, one.shift_m) for one in box.named}
    assert named == {"slide": (0.0, 0.002), "turn": (pytest.approx(np.radians(0.5)), 0)}
    assert (box.base_error_m, box.obstacles[0].shift_m) == (0.001, 0.003)
    assert "with any error of the error box" in json.loads(text)["reason"]
    assert "±0.500° of turn" in (tmp_path / "out/report.html").read_text()


def test_the_certificate_covers_errors_of_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, files = tmp_path / "c.jsonl", [tmp_path / "cell.yaml", tmp_path / "t.csv"]
    options = "--joint-error-deg", "turn=1", "--base-error-mm", "2"
    assert verified(tmp_path, "{base: 1}", *options, "--certificate", str(file)) == 0
    capsys.readouterr()
    assert check_certificate_main([*map(str, (file, *files))]) == 0
    assert "accepted" in capsys.readouterr().out
    stated = certificate_lines(file)[0]["errors"]
    assert stated["joints_rad"] == {"turn": pytest.approx(np.radians(1.0))}
    assert stated["base"] == [0.002, 0.0]


@pytest.mark.parametrize(
    ("errors", "options", "words"),
    [
        ("{joint_deg: {elbow: 1}}", (), "elbow"),
        ("{slide: {turn: 1}}", (), "in degrees"),
        ("{obstacles: [{name: wall, shift: 1}]}", (), "expected one of ball, floor"),
        ("{joint_deg: {turn: -1}}", (), "0 or more"),
        ("{}\ncolour: red", (), "known: vdsm_problem, name, length_unit, base"),
        ("{shift: 1}", (), "errors.shift (line 5): is not a known key; known: joint_d"),
        ("{}", ("--joint-error-deg", "1,turn=2"), "before each number"),
        ("{}", ("--slide-error-mm", "1,2"), "JOINT=MM"),
        ("{}", ("--slide-error-mm", "lift=2"), "lift"),
    ],
)
def test_bad_errors_of_files_and_options(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    errors: str,
    options: tuple[str, ...],
    words: str,
) -> None:
    assert verified(tmp_path, errors, *options) == 2
    told = capsys.readouterr().err
    assert words in told
    assert not (tmp_path / "out").exists()
