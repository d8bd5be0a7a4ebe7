"""What a robot's files state and nobody would notice: honoured, told or refused.

The oracle of the SRDF is MoveIt's allowed collision matrix, written down as it is
filled: defaults of links, pairs that are enabled, at last pairs that are disabled.
"""

from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

import vdsm_pin as vp
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.urdf import read_robot

LINKS = "abcde"
BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
URDF = (
    '<robot name="chain">'
    + "".join(f'<link name="{name}">{BALL}</link>' for name in LINKS)
    + "".join(
        f'<joint name="{one}{other}" type="revolute"><parent link="{one}"/>'
        f'<child link="{other}"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        for one, other in pairwise(LINKS)
    )
    + "</robot>"
)
HEAD = "ab_rad,bc_rad,cd_rad,de_rad"
CELL = """vdsm_problem: 1
length_unit: m
robot: {urdf: r.urdf, srdf: r.srdf}
required_clearance: 0
obstacles: [{name: ball, shape: sphere, center: [0, 0, 2], radius: 0.1}]
"""


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(str(ended.value.code))


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    (tmp_path / "r.urdf").write_text(URDF)
    return tmp_path / "r.urdf"


def srdf(urdf: Path, text: str) -> Path:
    file = urdf.with_suffix(".srdf")
    file.write_text(f'<robot name="chain">{text}</robot>')
    return file


def is_allowed(tags: list[tuple[str, ...]], one: str, other: str) -> bool:
    """Whether MoveIt lets two links touch."""
    entries: dict[frozenset[str], bool] = {}
    defaults = {link for tag, link, *_ in tags if tag == "disable_default_collisions"}
    for tag, allowed in (("enable_collisions", False), ("disable_collisions", True)):
        for kind, *pair in tags:
            if kind == tag:
                entries[frozenset(pair)] = allowed
    default = one in defaults or other in defaults
    return entries.get(frozenset((one, other)), default)


@pytest.mark.parametrize("seed", range(40))
def test_pairs_are_left_out_as_by_moveit(urdf: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    tags: list[tuple[str, ...]] = []
    for _ in range(rng.integers(1, 7)):
        pair = rng.choice([*LINKS], 2, replace=False).tolist()
        kind = ["disable_collisions", "enable_collisions", "disable_default_collisions"]
        tag = str(rng.choice(kind))
        tags.append((tag, *pair) if "default" not in tag else (tag, pair[0]))
    text = "".join(
        f'<{tag} link1="{who[0]}" link2="{who[1]}"/>'
        if len(who) > 1
        else f'<{tag} link="{who[0]}"/>'
        for tag, *who in tags
    )
    robot = read_robot(RobotFiles(urdf, srdf=srdf(urdf, text)))
    held = {frozenset(robot.bodies[k].name for k in both) for both in robot.held}
    expected = {
        frozenset(both)
        for both in combinations(LINKS, 2)
        if not is_allowed(tags, *both)
    }
    assert held == expected
    said = " ".join(robot.notes)
    defaults = {who[0] for tag, *who in tags if "default" in tag}
    assert ("obstacles are held apart from these links" in said) == bool(defaults)


def test_checker_and_judge_leave_the_same_pairs_out(urdf: Path) -> None:
    srdf(urdf, '<disable_default_collisions link="c"/>'
         '<enable_collisions link1="c" link2="e"/>')  # fmt: skip
    (urdf.parent / "cell.yaml").write_text(CELL)
    motion = urdf.parent / "t.csv"
    motion.write_text(f"{HEAD}\n0,0,0,0\n0.1,0.2,0.1,0.2\n")
    cell = vp.read_cell(urdf.parent / "cell.yaml")
    found = vp.verify(cell, vp.read_trajectory(motion, cell))
    assert found.verdict.value == "certified"
    vp.write_certificate(found, urdf.parent / "proof", motion)
    files = urdf.parent / "proof", urdf.parent / "cell.yaml", motion
    outcome = check_certificate(*files)
    assert outcome.accepted
    assert "3 of 10 link pairs left out" in outcome.notes


def test_links_that_there_are_not_are_named(urdf: Path) -> None:
    text = '<disable_default_collisions link="z"/><enable_collisions link1="a"/>'
    text += '<enable_collisions link1="a" link2="b"/>'
    text += '<disable_collisions link1="b" link2="a" reason="Adjacent"/>'
    notes = read_robot(RobotFiles(urdf, srdf=srdf(urdf, text))).notes
    assert notes == (
        "enable_collisions of the SRDF names no links: ''",
        "disable_default_collisions of the SRDF names no links: 'z'",
        "the SRDF enables and disables 'a' and 'b': left out, as in MoveIt",
    )


def test_limits_of_no_joint_are_named(urdf: Path) -> None:
    limits = urdf.parent / "limits.yaml"
    one = "{has_velocity_limits: true, max_velocity: 0.5}"
    limits.write_text(f"joint_limits: {{ab: {one}, AB: {one}, gripper: {one}}}\n")
    robot = read_robot(RobotFiles(urdf, joint_limits=limits))
    assert robot.joints[0].velocity == 0.5
    (note,) = robot.notes
    assert note.endswith("no joint of the URDF are not read: 'AB', 'gripper'")


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        ("ab,bc_rad,cd_rad,de_rad", "'ab' without a unit, expected ab_rad or ab_deg"),
        (
            f"{HEAD},time_s,ab_velocity",
            "'ab_velocity' without a unit, expected ab_velocity_rad_s or "
            "ab_velocity_deg_s",
        ),
        ("x,bc_rad,cd_rad,de_rad", "has no column for joint 'ab', expected ab_rad"),
    ],
)
def test_a_unit_that_is_missing_is_told(
    urdf: Path, capsys: pytest.CaptureFixture[str], head: str, expected: str
) -> None:
    motion, out = urdf.parent / "t.csv", urdf.parent / "out"
    row = ",".join("0" for _ in head.split(","))
    motion.write_text(f"{head}\n{row}\n")
    assert run("verify", "--urdf", urdf, "--trajectory", motion, "--out", out) == 2
    assert expected in capsys.readouterr().err


def test_errors_of_joints_that_there_are_not_are_refused(
    urdf: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motion, out = urdf.parent / "t.csv", urdf.parent / "out"
    motion.write_text(f"{HEAD}\n0,0,0,0\n")
    words = "verify", "--urdf", urdf, "--trajectory", motion, "--out", out
    assert run(*words, "--slide-error-mm", "1") == 2
    assert (
        "a slide error has no meaning: no joint that moves slides"
        in capsys.readouterr().err
    )
    srdf(urdf, "")
    (urdf.parent / "cell.yaml").write_text(f"{CELL}errors: {{slide: 1}}\n")
    with pytest.raises(InvalidFile, match=r"errors.*no joint that moves slides"):
        vp.read_cell(urdf.parent / "cell.yaml")
    slides = URDF.replace("revolute", "prismatic")
    urdf.write_text(slides)
    motion.write_text(f"{HEAD.replace('rad', 'm')}\n0,0,0,0\n")
    assert run(*words, "--joint-error-deg", "1") == 2
    assert (
        "a joint error has no meaning: no joint that moves turns"
        in capsys.readouterr().err
    )
    assert run(*words, "--slide-error-mm", "1") == 0
