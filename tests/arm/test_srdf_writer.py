"""The SRDF of an arm: read as any robot's, it leaves out what the arm leaves out."""

import json
from itertools import combinations
from pathlib import Path

import pytest
import yaml

from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.urdf_writer import srdf_text, urdf_text
from vdsm_pin.cli import main
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.urdf import read_robot

ROOT = Path(__file__).parents[2]
PIPES = ROOT / "examples" / "pipes_behind_a_port" / "pipes.yaml"
BODIES = [
    {"name": "lamp", "shape": "sphere", "link": 1, "center": [5, 2, 0], "radius": 1},
    {"name": "rod", "shape": "box", "link": 2, "center": [5, 2, 0], "size": [2, 1, 1]},
    {"name": "can & co", "shape": "cylinder", "link": 2, "axis": [0, 0, 1],
     "center": [8, 0, 0], "radius": 1, "length": 3},
    {"name": "bar", "shape": "prism", "link": 1, "axis": "y", "from": 1, "to": 5,
     "polygon": [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]},
]  # fmt: skip
IGNORED = [
    ["rod", "link 1"],
    ["lamp", "feed"],
    ["link 1", "tool"],
    ["bar part 1", "link 3"],
]


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(str(ended.value.code))


def of_arm(arm: Manipulator) -> set[frozenset[str]]:
    """The pairs that an arm holds apart, by the names of the URDF's links."""
    carried = [solid.name for _, solid in arm.carried]
    names = {name: f"body{k}" for k, name in enumerate(carried, start=1)}
    owners = [body.owner for body in arm.convex_bodies]
    both = ([owners[k] for k in pair] for pair in arm.self_pairs.held.tolist())
    return {
        frozenset(names.get(one, one.replace(" ", "")) for one in pair) for pair in both
    }


def of_robot(folder: Path) -> tuple[set[frozenset[str]], dict[frozenset[str], str]]:
    """The pairs that a robot of the two files holds apart, and why not the others."""
    robot = read_robot(RobotFiles(folder / "arm.urdf", srdf=folder / "arm.srdf"))
    assert robot.notes == ()
    held = {frozenset(robot.bodies[k].name for k in pair) for pair in robot.held}
    why = {frozenset((one.body, one.other)): one.reason for one in robot.left_out}
    assert len(held) + len(why) == len([*combinations(robot.bodies, 2)])
    return held, why


def test_the_robot_holds_apart_what_the_arm_does(tmp_path: Path) -> None:
    arm = {"link_lengths": [10, 10, 10], "link_radius": 0.5, "bodies": BODIES,
           "max_link_angle_deg": 40, "max_joint_angle_deg": 40, "feed": {"length": 7},
           "tool": {"length": 2, "radius": 0.3}, "ignore_pairs": IGNORED}  # fmt: skip
    problem = {"vdsm_problem": 1, "length_unit": "m", "manipulator": arm,
               "required_clearance": 0.0}  # fmt: skip
    (tmp_path / "p.yaml").write_text(yaml.safe_dump(problem))
    assert run("urdf", tmp_path / "p.yaml", "--out", tmp_path / "arm.urdf") == 0
    held, why = of_robot(tmp_path)
    assert held == of_arm(read_problem(tmp_path / "p.yaml").manipulator)
    rigid = frozenset(("link3", "tool"))
    assert why[rigid] == "no joint between them moves"
    assert (
        'link1="link3" link2="tool" reason="Never"'
        in (tmp_path / "arm.srdf").read_text()
    )
    assert frozenset(("link3", "body5")) in held  # of its parts one is left out
    for pair, reason in {
        ("link1", "link2"): "Adjacent",
        ("body1", "link1"): "Adjacent",  # the feed
        ("link1", "body3"): "User",
        ("body1", "body2"): "User",
        ("link1", "tool"): "User",
    }.items():
        assert why[frozenset(pair)] == f"left out by the SRDF: {reason}"


def test_committed_file_is_what_the_generator_writes(tmp_path: Path) -> None:
    arm = built_in("hrm8")
    assert srdf_text(arm).encode() == (ROOT / "urdf" / "hrm8.srdf").read_bytes()
    (tmp_path / "arm.urdf").write_text(urdf_text(arm))
    (tmp_path / "arm.srdf").write_text(srdf_text(arm))
    assert of_robot(tmp_path)[0] == of_arm(arm)


def test_an_arms_plan_is_judged_alike_as_a_robots(tmp_path: Path) -> None:
    """Brackets of one clearance overlap: both are proved, each by itself."""
    out, data = tmp_path / "out", yaml.safe_load(PIPES.read_text())
    plan = out / "trajectory.csv"
    assert run("plan", PIPES, "--strategy", "fewest", "--out", out) == 0
    assert run("verify", PIPES, "--trajectory", plan, "--out", out) == 0
    convert = "convert", PIPES, "--trajectory", plan, "--out", tmp_path / "ros"
    assert run(*convert, "--also", "robot-yaml") == 0
    assert run("urdf", PIPES, "--out", tmp_path / "arm.urdf") == 0
    scene = tmp_path / "scene.yaml"
    scene.write_text(yaml.safe_dump({k: data[k] for k in ("length_unit", "obstacles")}))
    asked = (
        *("--urdf", tmp_path / "arm.urdf", "--srdf", tmp_path / "arm.srdf"),
        *("--scene", scene, "--out", tmp_path / "judged"),
        *("--required-clearance-mm", data["required_clearance"]),
    )
    brackets = []
    motion = tmp_path / "ros" / "robot_trajectory.yaml"
    assert run("verify", *asked, "--trajectory", motion) == 0
    for folder in (out, tmp_path / "judged"):
        file = json.loads((folder / "verification.json").read_text())
        assert file["verdict"] == "certified"
        brackets.append(
            {
                ((row["body"] or f"link {row['link']}").replace(" ", ""), other): row
                for row in file["closest"]
                if (other := row["obstacle"] or row["other_body"])
            }
        )
    assert len({*brackets[0]} & {*brackets[1]}) > 2
    for pair in {*brackets[0]} & {*brackets[1]}:
        arm, robot = (each[pair] for each in brackets)
        assert arm["lower_m"] <= robot["upper_m"] + 1e-9
        assert robot["lower_m"] <= arm["upper_m"] + 1e-9
