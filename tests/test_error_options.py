"""Errors as people state them: in degrees and millimetres, by joint and by obstacle."""

import json
import math
import shlex
from math import radians
from pathlib import Path

import made_up
import pytest
from typer.testing import CliRunner

import vdsm_pin as vp
from vdsm_pin.cli import app
from vdsm_pin.cli.options import ErrorOptions
from vdsm_pin.cli.robot import RobotOptions
from vdsm_pin.errors import InvalidInput
from vdsm_pin.problem import error_boxes
from vdsm_pin.report.facts import error_box
from vdsm_pin.report.words import errors

TEXT = """vdsm_problem: 1
name: errors
length_unit: mm
manipulator: {link_lengths: [300, 300], link_radius: 40, max_link_angle_deg: 40,
              max_joint_angle_deg: 40}
obstacles:
  - {name: a, shape: sphere, center: [300, 150, 0], radius: 50}
  - {name: b, shape: box, center: [300, -160, 0], size: [100, 100, 100]}
required_clearance: 5
"""
ROW = "waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,alpha2_rad,theta2_rad\n"


def test_options_and_python_say_the_same() -> None:
    words = ["1", "crate=2.5", "a=b=4"]
    typed = ErrorOptions("0.1,0.2,0.3", 2.0, 0.01, words, ["crate=0.5"]).box()
    box = vp.ErrorBox(
        joint_deg=[0.1, 0.2, 0.3],
        base_mm=2.0,
        base_deg=0.01,
        obstacle_mm=1.0,
        obstacles_mm={"crate": 2.5, "a=b": 4.0},
        obstacles_deg={"crate": 0.5},
    )
    assert typed.widened(error_boxes.ErrorBox()) == box.widened(error_boxes.ErrorBox())
    assert box.with_joint(0.5) == typed.with_joint(0.5)
    assert typed.angles(3)[2].tolist() == [radians(0.3)] * 2
    crate = typed.of_obstacle("crate")
    assert crate.shift == 0.0025 and crate.turn == radians(0.5)
    assert typed.of_obstacle("other").shift == 0.001
    assert ErrorOptions("0.1").box().angles(2).max() == radians(0.1)


def test_an_error_stated_twice_is_told_once_and_the_larger_counts() -> None:
    file = vp.ErrorBox(
        joint_deg={"J": 1.0}, obstacles_mm={"crate": 1.0}, obstacles_deg={"crate": 3.0}
    )
    options = vp.ErrorBox(
        joint_deg={"J": 2.0, "K": 1.0}, obstacles_mm={"crate": 2.0, "a": 1.0}
    )
    both = *file.obstacles, *options.obstacles
    named = *file.named, *options.named
    listed = error_boxes.ErrorBox(obstacles=both, named=named)
    for box in (file.widened(options), options.widened(file), listed):
        words = errors(error_box(box)).split(", ")
        assert sorted(words) == [
            "1.000 mm of a",
            "2.000 mm and 3.000° of crate",
            "±1.000° of K",
            "±2.000° of J",
        ]
    none = error_boxes.ObstacleError("crate", math.nan)
    with pytest.raises(InvalidInput, match="obstacle error is nan m"):
        error_boxes.ErrorBox(obstacles=(*file.obstacles, none))


@pytest.mark.parametrize(
    ("stated", "shift", "turn"),
    [("shift: 2", 0.002, 0.0), ("turn_deg: 3", 0.0, radians(3.0)), ("shift: 0", 0, 0)],
)
def test_an_error_of_an_obstacle_that_is_not_stated_is_none(
    stated: str, shift: float, turn: float, tmp_path: Path
) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(f"{TEXT}errors: {{obstacles: [{{name: b, {stated}}}]}}\n")
    found = vp.read_problem(str(file)).errors.of_obstacle("b")
    assert (found.shift, found.turn) == (shift, turn)


@pytest.mark.parametrize(
    "joint, shifts, turns, words",
    [
        ("x", None, None, "--joint-error-deg is 'x'"),
        ("0.1,", None, None, "--joint-error-deg is ''"),
        ("-1", None, None, "expected a number, 0 or more"),
        ("nan", None, None, "--joint-error-deg is 'nan'"),
        ("inf", None, None, "--joint-error-deg is 'inf'"),
        ("0", ["a=-1"], None, "--obstacle-error-mm is 'a=-1'"),
        ("0", ["1", "2"], None, "twice for all obstacles"),
        ("0", ["a=1", "a=2"], None, "twice for 'a'"),
        ("0", None, ["1"], "needs the obstacle's name"),
    ],
)
def test_what_is_no_error_is_refused(
    joint: str, shifts: list[str] | None, turns: list[str] | None, words: str
) -> None:
    with pytest.raises(InvalidInput, match=words):
        ErrorOptions(joint, 0.0, 0.0, shifts, turns).box()


def write(folder: Path) -> list[str]:
    (folder / "p.yaml").write_text(TEXT)
    (folder / "t.csv").write_text(ROW + "0,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0\n")
    names = str(folder / "p.yaml"), "--trajectory", str(folder / "t.csv")
    return ["verify", *names, "--out", str(folder / "out"), "--json"]


def run(words: list[str]) -> tuple[int, str]:
    found = CliRunner().invoke(app, words, obj="vdsm")
    return found.exit_code, found.output + str(found.exception or "")


@pytest.mark.parametrize(
    "options, passes",
    [
        ([], True),
        # The ball is 60 mm off, 5 are required; the box 70.
        (["--obstacle-error-mm", "a=54.9"], True),
        (["--obstacle-error-mm", "a=55.1"], False),
        (["--obstacle-error-mm", "b=64.9"], True),
        (["--obstacle-error-mm", "b=65.1"], False),
        (["--obstacle-error-mm", "10", "--obstacle-error-mm", "b=64.9"], True),
        (["--obstacle-error-mm", "56", "--obstacle-error-mm", "b=1"], False),
        # Its corners are 86.6 mm from its middle.
        (["--obstacle-error-deg", "b=40"], True),
        (["--obstacle-error-deg", "b=44"], False),
        # Joint 1 moves what is 300 mm away; joint 2 has a lever of 300 mm at most.
        (["--joint-error-deg", "0,3"], True),
        (["--joint-error-deg", "12,0"], False),
    ],
)
def test_errors_count_for_their_joint_and_obstacle(
    tmp_path: Path, options: list[str], passes: bool
) -> None:
    code, text = run([*write(tmp_path), *options])
    assert code == (0 if passes else 1), text


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_takes_them_all_and_tells_how_to_repeat_it(tmp_path: Path) -> None:
    _, problem, _, motion, *_ = write(tmp_path)
    errors = ["--joint-error-deg", "0.5,0.5", "--obstacle-error-mm", "a=55.1"]
    out = tmp_path / "out"
    words = ["batch", problem, "--trajectories", motion, *errors, "--out", str(out)]
    code, text = run(words)
    assert code == 1, text
    told = json.loads((out / "p-t" / "verification.json").read_text())
    assert told["error_box"]["obstacles"][0]["name"] == "a"
    assert told["verdict"] != "certified"
    assert shlex.split(told["command"])[5:9] == errors


def test_an_unknown_obstacle_and_a_list_of_another_arm_are_named(
    tmp_path: Path,
) -> None:
    words = write(tmp_path)
    _, text = run([*words, "--obstacle-error-mm", "c=1"])
    assert "'c'" in text and "a, b" in text
    _, text = run([*words, "--joint-error-deg", "1,2,3"])
    assert "errors of 3 joints are given one by one, expected 2" in text


def test_a_shorter_list_is_refused_beside_a_whole_one() -> None:
    whole, short = (error_boxes.ErrorBox(joints=((0.01, 0.01),) * n) for n in (8, 3))
    asked = made_up.problem().under(whole)
    with pytest.raises(
        InvalidInput, match="errors of 3 joints are given one by one, expected 8"
    ):
        asked.under(short)


@pytest.mark.usefixtures("in_this_process")
def test_a_repair_keeps_the_clearance_under_its_errors(tmp_path: Path) -> None:
    _, *words, _ = write(tmp_path)
    code, text = run(["repair", *words, "--obstacle-error-mm", "a=55.1"])
    assert code == 1 and "a" in text, text
    code, text = run(["repair", *words, "--obstacle-error-mm", "a=54.9"])
    assert code == 0, text
    told = json.loads((tmp_path / "out" / "verification.json").read_text())
    assert told["error_box"]["obstacles"][0]["shift_m"] == pytest.approx(0.0549)


@pytest.mark.parametrize(
    "words, told",
    [
        (["turn"], "--lock is 'turn', expected JOINT=VALUE in radians or metres"),
        (["turn=up"], "--lock is 'turn=up'"),
        (["turn=inf"], "--lock is 'turn=inf'"),
        (["turn=1_0"], "--lock is 'turn=1_0'"),
        (["=1"], "--lock has no name, expected JOINT=VALUE"),
        (["turn=1", "turn=2"], "--lock is given twice for 'turn'"),
    ],
)
def test_what_locks_no_joint_is_refused(words: list[str], told: str) -> None:
    with pytest.raises(InvalidInput, match=told):
        RobotOptions(Path("a.urdf"), lock=words).files()


def test_joints_are_locked_at_any_number() -> None:
    files = RobotOptions(Path("a.urdf"), lock=["turn=-1.5", "slide=2e-3"]).files()
    assert files.lock == {"turn": -1.5, "slide": 2e-3}
