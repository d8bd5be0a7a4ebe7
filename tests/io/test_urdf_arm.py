"""An arm written as URDF comes back as it was; another is refused by its joint."""

from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import yaml

import vdsm_pin as vp
from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.urdf_writer import urdf_text
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.urdf_arm import read_urdf_arm


def random_arm(rng: np.random.Generator) -> Manipulator:
    count = int(rng.integers(2, 12))
    return Manipulator(
        f"arm{count}",
        rng.uniform(0.2, 0.6, count),
        float(rng.uniform(0.01, 0.05)),
        float(rng.uniform(0.2, 1.2)),
        float(rng.uniform(0.2, 1.2)),
        (float(rng.uniform(-5, -1)), float(rng.uniform(1, 5))),
        CableLayout(0.008, 0.02, paper_hole_angles(count)),
    )


@pytest.mark.parametrize("seed", range(20))
def test_what_is_written_is_read_to_the_last_bit(seed: int, tmp_path: Path) -> None:
    arm = random_arm(np.random.default_rng(seed))
    file = tmp_path / "arm.urdf"
    file.write_text(urdf_text(arm))
    found = read_urdf_arm(file, sha256())
    np.testing.assert_array_equal(found.link_lengths, arm.link_lengths)
    assert found.link_radius == arm.link_radius
    assert found.max_joint_angle == arm.max_joint_angle
    assert found.base_range == arm.base_range
    assert found.name == arm.name


def problem_with(folder: Path, arm: object, tip: float = 3126.0) -> Path:
    file = folder / "p.yaml"
    data = {
        "vdsm_problem": 1,
        "length_unit": "mm",
        "manipulator": arm,
        "tip_path": {"start": [tip, 0, 0], "points": [[tip, 0, 0], [tip, 300, 0]]},
        "required_clearance": 3.5,
    }
    file.write_text(yaml.safe_dump(data))
    return file


def test_a_problem_takes_its_arm_from_a_urdf(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(urdf_text(built_in("hrm8")))
    arm = {"urdf": "arm.urdf", "max_link_angle_deg": 42.5}
    holes = {"hole_radius": 50, "half_gap": 30}
    file = problem_with(tmp_path, arm | {"cables": holes})
    problem = vp.read_problem(file)
    same = vp.read_problem(problem_with(tmp_path, "hrm8"))
    np.testing.assert_array_equal(
        problem.manipulator.link_lengths, same.manipulator.link_lengths
    )
    np.testing.assert_array_equal(
        problem.manipulator.cables.hole_angles, same.manipulator.cables.hole_angles
    )
    assert problem.manipulator.cables.hole_radius == 0.050
    made = vp.plan(problem)
    assert vp.verify(problem, made.trajectory).verdict is vp.Verdict.CERTIFIED


def test_the_urdf_belongs_to_the_problem_and_its_hash(tmp_path: Path) -> None:
    text = urdf_text(built_in("hrm8"))
    (tmp_path / "arm.urdf").write_text(text)
    file = problem_with(tmp_path, {"urdf": "arm.urdf", "max_link_angle_deg": 42.5})
    before = vp.read_problem(file).source
    assert before is not None
    assert before.named == (tmp_path / "arm.urdf",)
    (tmp_path / "arm.urdf").write_text(text + "<!-- -->\n")
    after = vp.read_problem(file).source
    assert after is not None
    assert after.sha256 != before.sha256


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name="alpha2" type="revolute"', 'name="alpha2" type="fixed"', "alpha2"),
        ('axis xyz="0 1 0"', 'axis xyz="0 0 1"', r"theta1.*expected 0 1 0"),
        ('axis xyz="1 0 0"', 'axis xyz="0 1 0"', r"x0.*expected 1 0 0"),
        (
            '<collision name="link1_end">\n      <origin xyz="0.486 0.0',
            '<collision name="link1_end">\n      <origin xyz="0.486 0.1',
            r"link1.*off the link's axis",
        ),
        (
            '<collision name="link1_body">\n      <origin xyz="0.243',
            '<collision name="link1_body">\n      <origin xyz="0.343',
            r"link1.*off the link's axis",
        ),
        (
            '<child link="yaw2" />\n    <origin xyz="0.486 0.0',
            '<child link="yaw2" />\n    <origin xyz="0.486 0.1',
            r"alpha2.*x axis",
        ),
        ('upper="0.7', 'upper="0.6', r"alpha1.*limits|theta1.*limits"),
        ("<robot", "<robots", "XML|root"),
        ('type="prismatic"', 'type="continuous"', "x0"),
        (
            '<child link="yaw2" />',
            '<child link="yaw2" /><mimic joint="alpha1" />',
            r"alpha2.*mimics 'alpha1'",
        ),
        ("<limit", '<mimic joint="alpha1" /><limit', r"x0.*mimics 'alpha1'"),
    ],
)
def test_another_robot_is_refused_by_its_joint(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    text = urdf_text(built_in("hrm8"))
    assert old in text
    file = tmp_path / "other.urdf"
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(InvalidFile, match=said) as found:
        read_urdf_arm(file, sha256())
    assert str(file) in str(found.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<link ", '<material name="m"><color rgba="x"/></material><link '),
        ("<link ", f"{'<x>' * 300}{'</x>' * 300}<link "),
        ("</joint>", f"{'<x>' * 300}{'</x>' * 300}</joint>"),
        ("</joint>", '<safety_controller soft_lower_limit="x"/></joint>'),
        ('type="fixed">', 'type="fixed"><axis xyz="a b c"/>'),
        ('type="fixed">', 'type="fixed"><limit lower="x" upper="1"/>'),
        ("<robot ", f'<robot other="{"é" * 300_000}" '),
        ("<geometry>", "<geometry><?what this?>"),
        ("<link ", '<link drake:colour="red" '),
        ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="utf-16"?>'),
        ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="foo"?>'),
    ],
)
def test_what_says_nothing_of_the_arm_is_passed_over(
    tmp_path: Path, old: str, new: str
) -> None:
    """Oracle: the same file without."""
    text, file = urdf_text(built_in("hrm8")), tmp_path / "arm.urdf"
    arms = []
    for one in (text, text.replace(old, new, 1)):
        file.write_text(one)
        arms.append(repr(read_urdf_arm(file, sha256())))
    assert arms[0] == arms[1]


def test_a_robot_with_two_hands_is_no_chain(tmp_path: Path) -> None:
    text = urdf_text(built_in("hrm8"))
    hand = (
        '<link name="hand"/><joint name="grip" type="fixed"><parent link="link3"/>'
        '<child link="hand"/><origin xyz="0 0 0" rpy="0 0 0"/></joint></robot>'
    )
    file = tmp_path / "two.urdf"
    file.write_text(text.replace("</robot>", hand))
    with pytest.raises(InvalidFile, match=r"link3.*grip.*chain"):
        read_urdf_arm(file, sha256())


def test_the_command_writes_the_arm_of_a_problem(tmp_path: Path) -> None:
    lengths = {"link_lengths": [400, 300, 300], "link_radius": 30}
    limits = {"max_link_angle_deg": 40, "max_joint_angle_deg": 40}
    file = problem_with(tmp_path, lengths | limits, tip=1000.0)
    out = tmp_path / "arm.urdf"
    with pytest.raises(SystemExit) as ended:
        main(["urdf", str(file), "--out", str(out)])
    assert not ended.value.code
    np.testing.assert_array_equal(
        read_urdf_arm(out, sha256()).link_lengths, [0.4, 0.3, 0.3]
    )
