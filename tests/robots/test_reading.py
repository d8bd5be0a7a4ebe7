"""What a robot is read as: groups, bases, limits, covers; Pinocchio agrees."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles.certificate_cases import write_cube
from oracles.random_robots import MESH
from typer.testing import CliRunner

from tests.robots.test_robots import URDF, mutated, write
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.cli import app
from vdsm_pin.errors import InvalidFile, InvalidInput, VdsmError
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.robots.by_itself import pose_difference
from vdsm_pin.robots.cell import cell_of
from vdsm_pin.robots.files import MeshCover, RobotFiles, solids_of
from vdsm_pin.robots.joint_limits import read_limits
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.verification.coal_shapes import link_shapes

SRDF = """<robot name="two">
  <virtual_joint name="cart" type="planar" parent_frame="w" child_link="base"/>
  <group name="arm"><chain base_link="base" tip_link="hand"/></group>
  <group name="first"><joint name="turn"/></group>
  <group name="both"><group name="first"/><link name="hand"/></group>
  <group name="round"><group name="round"/></group>
  <group name="lost"><joint name="elbow"/></group>
  <group name="up"><chain base_link="hand" tip_link="base"/></group>
  <disable_collisions link1="arm" link2="base" reason="Adjacent"/>
</robot>
"""
LIMITS = """joint_limits:
  turn: {has_velocity_limits: true, max_velocity: 0.5}
  slide: {has_acceleration_limits: true, max_acceleration: 2, has_position_limits: true,
          min_position: -1, max_position: 0.2}
"""


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    return write(tmp_path, "two.urdf", URDF)


def names(robot: Robot) -> list[str]:
    return [joint.name for joint in robot.joints]


def test_a_urdf_in_place_of_a_srdf_is_refused(urdf: Path) -> None:
    """It disables no pair, so that neighbours would be held apart."""
    with pytest.raises(InvalidFile, match=r"two.urdf: is a URDF, .* expected a SRDF"):
        read_robot(RobotFiles(urdf, urdf))


def test_a_group_says_which_joints_move(tmp_path: Path, urdf: Path) -> None:
    srdf = write(tmp_path, "two.srdf", SRDF)
    assert names(read_robot(RobotFiles(urdf, srdf, group="arm"))) == ["turn", "slide"]
    assert names(read_robot(RobotFiles(urdf, srdf, group="both"))) == ["turn", "slide"]
    robot = read_robot(RobotFiles(urdf, srdf, group="first", lock={"slide": 0.3}))
    assert names(robot) == ["turn"]
    assert "joint 'slide' is locked at 0.3" in robot.notes
    assert "joint 'cart/x' is no part of the group and stands at 0" in robot.notes
    assert pose_difference(robot, np.array([[0.7]])).max() < 1e-12
    for group, expected in (
        ("leg", "has no group 'leg'; known: arm, first"),
        ("round", "is a part of itself"),
        ("lost", "names joint 'elbow', which the URDF lacks"),
        ("up", "no chain leads from 'hand' to 'base'"),
    ):
        with pytest.raises(InvalidFile, match=expected):
            read_robot(RobotFiles(urdf, srdf, group=group))
    with pytest.raises(InvalidInput, match="needs a SRDF"):
        read_robot(RobotFiles(urdf, group="arm"))
    away = URDF.replace('lower="-0.1"', 'lower="0.1"')
    with pytest.raises(InvalidFile, match=r"stands at 0, outside .* 0\.1 to 0\.4"):
        read_robot(RobotFiles(write(tmp_path, "away.urdf", away), srdf, group="first"))


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_what_floats_stands_where_pinocchio_has_it(tmp_path: Path, kind: str) -> None:
    """As a joint of the URDF, as a base by the SRDF, and both locked."""
    srdf = write(tmp_path, "two.srdf", SRDF.replace("planar", kind))
    text = URDF.replace('type="prismatic"', f'type="{kind}"')
    text = text.replace('<axis xyz="0 1 0"/>', "").replace(
        'joint="slide"', 'joint="turn"'
    )
    urdf = write(tmp_path, "two.urdf", text)
    robot = read_robot(RobotFiles(urdf, srdf))
    count = {"planar": 3, "floating": 6}[kind]
    assert len(robot.joints) == 2 * count + 1
    q = np.random.default_rng(2).uniform(-3.0, 3.0, (50, len(robot.joints)))
    assert pose_difference(robot, q).max() < 1e-12
    still = read_robot(RobotFiles(urdf, srdf, lock={"cart": 0.0, "slide/x": 0.3}))
    assert names(still)[0] == "turn"
    assert pose_difference(still, q[:, : len(still.joints)]).max() < 1e-12
    with pytest.raises(InvalidFile, match="'cart' has several values; lock cart/x"):
        read_robot(RobotFiles(urdf, srdf, lock={"cart": 1.0}))


@pytest.mark.parametrize(
    ("slip", "meant"),
    [("orgin", "origin"), ("Limit", "limit"), ("mimick", "mimic"), ("axes", "axis")],
)
def test_a_misspelt_element_of_a_joint_is_refused(
    tmp_path: Path, slip: str, meant: str
) -> None:
    text = URDF.replace("<limit ", f"<{slip}/><limit ", 1)
    said = f"<{slip}> is not read by anybody; is <{meant}> meant"
    with pytest.raises(InvalidFile, match=said):
        read_robot(RobotFiles(write(tmp_path, "slip.urdf", text)))


@pytest.mark.parametrize("tag", ["friction", "hardwareInterface", "damping", "param"])
def test_another_element_of_a_joint_is_noted(tmp_path: Path, tag: str) -> None:
    text = URDF.replace("<limit ", f"<{tag}/><!-- odd --><limit ", 1)
    (note,) = read_robot(RobotFiles(write(tmp_path, "odd.urdf", text))).notes
    assert note.startswith(f"<{tag}> of joints is not read: ")


@pytest.mark.parametrize(
    ("before", "slip", "meant"),
    [
        ("<collision>", "<colision>", "collision"),
        ("<origin ", "<orgin ", "origin"),
        ("<geometry>", "<geometri>", "geometry"),
        ("<link ", "<lnik ", "link"),
        ("<joint ", "<Joint ", "joint"),
    ],
)
def test_what_a_misspelt_element_leaves_out_is_not_judged_otherwise(
    tmp_path: Path, before: str, slip: str, meant: str
) -> None:
    """A shape stood at its link's origin, or was not there at all."""
    solid = (
        '<collision><origin xyz="0 0 1"/><geometry><sphere radius="0.1"/></geometry>'
        "</collision>"
    )
    tag, wrong = before.strip("< >"), slip.strip("< >")
    text = f'<robot name="r"><link name="a">{solid}</link><link name="b"/><joint '
    text += 'name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
    read_robot(RobotFiles(write(tmp_path, "right.urdf", text)))
    text = text.replace(before, slip, 1).replace(f"</{tag}>", f"</{wrong}>", 1)
    with pytest.raises(InvalidFile, match=f"<{wrong}> is not read.* <{meant}> meant"):
        read_robot(RobotFiles(write(tmp_path, "slip.urdf", text)))


def test_another_element_of_a_collision_is_noted(tmp_path: Path) -> None:
    """As SDF places shapes."""
    text = URDF.replace("<collision>", "<collision><pose>1 0 0 0 0 0</pose>")
    notes = read_robot(RobotFiles(write(tmp_path, "odd.urdf", text))).notes
    assert [note for note in notes if note.startswith("<pose> of links is not read: ")]


@pytest.mark.parametrize(
    ("right", "slip", "told"),
    [
        ("multiplier=", "multiplyer=", "<mimic> has 'multiplyer'; is 'multiplier' m"),
        ("offset=", "Offset=", "<mimic> has 'Offset'; is 'offset' meant"),
        ("velocity=", "velocty=", "<limit> has 'velocty'; is 'velocity' meant"),
        ("velocity=", "deceleration=", ""),
        ("velocity=", "gear_velocity=", ""),
    ],
)
def test_a_misspelt_attribute_is_refused(
    tmp_path: Path, right: str, slip: str, told: str
) -> None:
    """It would count as left out: a mimic has a ratio of 1 then, a limit is none."""
    assert right in URDF
    file = write(tmp_path, "slip.urdf", URDF.replace(right, slip, 1))
    if not told:
        read_robot(RobotFiles(file))
        return
    with pytest.raises(InvalidFile, match=told):
        read_robot(RobotFiles(file))


@pytest.mark.parametrize("name", ["Scale", "scales"])
def test_a_misspelt_scale_of_a_mesh_is_refused(tmp_path: Path, name: str) -> None:
    """Only a mesh far too large is told apart by its size."""
    mesh = f'<mesh filename="none.stl" {name}="2 2 2"/>'
    text = re.sub(r"<(box|cylinder|sphere) [^>]*>", mesh, URDF, count=1)
    with pytest.raises(InvalidFile, match=f"<mesh> has '{name}'; is 'scale' meant"):
        read_robot(RobotFiles(write(tmp_path, "slip.urdf", text)))


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ('<virtual_jiont name="v" type="planar" child_link="x"/>', "virtual_joint"),
        ('<disable_collision link1="x" link2="y"/>', "disable_collisions"),
        ('<group name="arm"><chian base_link="x" tip_link="y"/></group>', "chain"),
        ('<group_stat name="home" group="arm"/>', "group_state"),
        ('<passive_joint name="j"/><rviz/>', ""),
    ],
)
def test_a_misspelt_element_of_a_srdf_is_refused(
    tmp_path: Path, line: str, meant: str
) -> None:
    """Passed over, the base stands or a group is empty."""
    srdf = write(tmp_path, "r.srdf", f'<robot name="r">{line}</robot>')
    files = RobotFiles(write(tmp_path, "r.urdf", URDF), srdf)
    if not meant:
        read_robot(files)
        return
    with pytest.raises(InvalidFile, match=f"not read by anybody; is <{meant}> meant"):
        read_robot(files)


@pytest.mark.parametrize(
    ("key", "told"),
    [("has_velocity_limit", True), ("has_Velocity_limits", True), ("has_jerk", False)],
)
def test_a_misspelt_word_of_moveits_limits_is_refused(
    tmp_path: Path, key: str, told: bool
) -> None:
    """The limit beside it would not count."""
    text = f"joint_limits:\n  turn: {{{key}: true, max_velocity: 0.5}}\n"
    file = write(tmp_path, "limits.yaml", text)
    if not told:
        assert read_limits(file)["turn"].velocity == np.inf
        return
    with pytest.raises(InvalidFile, match=f"{key}'; is 'has_velocity_limits' meant"):
        read_limits(file)


MOVES = """<robot name="r"><link name="w"><collision><geometry><sphere radius="1"/>
  </geometry></collision></link><link name="a"/><link name="b"/>
  <joint name="turn" type="continuous"><parent link="w"/><child link="a"/></joint>
  <joint name="base" type="{}"><parent link="a"/><child link="b"/>{}</joint></robot>"""


@pytest.mark.parametrize("kind", ["continuous", "planar", "floating"])
@pytest.mark.parametrize(
    ("ends", "noted"),
    [
        ('lower="-2" upper="2"', True),
        ('upper="2"', True),
        ('lower="-2"', True),
        ('lower="1" upper="1"', True),
        ('lower="0" upper="0"', False),
        ("", False),
    ],
)
def test_limits_that_a_type_of_joint_has_not_are_noted(
    tmp_path: Path, kind: str, ends: str, noted: bool
) -> None:
    """Values beyond them are not refuted; a velocity is judged of any type."""
    limit = '<axis xyz="0 0 1"/><limit {} velocity="3" effort="1"/>'
    text = MOVES.format(kind, limit.format(ends))
    robot = read_robot(RobotFiles(write(tmp_path, "moves.urdf", text)))
    assert any("none are not judged: 'base'" in note for note in robot.notes) is noted
    assert not np.isfinite([joint.upper for joint in robot.joints]).any()
    assert {joint.velocity for joint in robot.joints[1:]} == {3.0}


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_a_joint_of_several_values_that_mimics_is_refused(
    tmp_path: Path, kind: str
) -> None:
    """It was read as one that moves by itself."""
    file = write(tmp_path, "m.urdf", MOVES.format(kind, '<mimic joint="turn"/>'))
    with pytest.raises(InvalidFile, match="'base' mimics 'turn', but has no one value"):
        read_robot(RobotFiles(file))


@pytest.mark.parametrize("tag", ["origin", "geometry"])
def test_what_places_or_shapes_nothing_inside_a_link_is_noted(
    tmp_path: Path, tag: str
) -> None:
    """Exporters write an origin there; Pinocchio passes over it as well."""
    text = URDF.replace("<collision>", f'<{tag} xyz="1 0 0"/><collision>', 1)
    robot = read_robot(RobotFiles(write(tmp_path, "odd.urdf", text)))
    plain = read_robot(RobotFiles(write(tmp_path, "plain.urdf", URDF)))
    (note,) = set(robot.notes) - set(plain.notes)
    assert note.startswith(f"<{tag}> directly inside links is not read: ")
    assert pose_difference(robot, np.array([[0.7, 0.1]])).max() < 1e-12


def test_prefixes_that_nothing_declares_are_read_as_ros_does(tmp_path: Path) -> None:
    """As in URDFs for Drake; `document.iter` sees them, Pinocchio the same joints."""
    text = URDF.replace("<limit ", '<limit drake:acceleration="2.5" ', 1)
    assert text != URDF
    robot = read_robot(RobotFiles(write(tmp_path, "drake.urdf", text)))
    assert robot.notes == ("what is of these namespaces is not read: 'drake'",)
    assert pose_difference(robot, np.array([[0.7, 0.1]])).max() < 1e-12
    declared = text.replace("<robot ", '<robot xmlns:drake="http://drake.mit.edu" ', 1)
    (note,) = read_robot(RobotFiles(write(tmp_path, "declared.urdf", declared))).notes
    assert "http://drake.mit.edu" in note


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<robot ", '<robot xml:lang="en" '),
        ("<robot ", "<!-- once <robot name='x'> --><robot "),
        ("<robot ", '<?xml version="1.0" encoding="foo"?><robot '),
    ],
)
def test_prefixes_are_declared_where_they_must_be(
    tmp_path: Path, old: str, new: str
) -> None:
    """Oracle: the same robot without."""
    text = URDF.replace(old, new, 1)
    for more in (text, text.replace("<limit ", '<limit drake:acceleration="2" ', 1)):
        robot = read_robot(RobotFiles(write(tmp_path, "odd.urdf", more)))
        same = read_robot(RobotFiles(write(tmp_path, "u.urdf", URDF)))
        assert repr(robot.tree) == repr(same.tree)


def test_the_order_of_joints_and_groups_does_not_matter(tmp_path: Path) -> None:
    """A chain written from its end; groups of which each names another twice."""
    n = 400
    links = [f'<link name="l{k}"/>' for k in range(1, n)]
    joints = [
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/>'
        f'<child link="l{k + 1}"/><origin xyz="0 0 1"/>'
        + (f'<mimic joint="j{k - 1}"/>' if k else "")
        + "</joint>"
        for k in range(n)
    ]
    ball = '<collision><geometry><sphere radius="1"/></geometry></collision>'
    ends = [f'<link name="l{k}">{ball}</link>' for k in (0, n)]
    robots = []
    for some in (joints, joints[::-1]):
        text = f"<robot name='r'>{''.join([*links, *some, *ends])}</robot>"
        robots.append(read_robot(RobotFiles(write(tmp_path, "r.urdf", text))))
    assert repr(robots[0].tree) == repr(robots[1].tree)
    assert robots[0].values == robots[1].values
    groups = [
        f'<group name="g{k}">{2 * f"<group name={chr(34)}g{k + 1}{chr(34)}/>"}</group>'
        for k in range(1500)
    ]
    last = '<group name="g1500"><joint name="j0"/></group>'
    srdf = write(tmp_path, "r.srdf", f"<robot>{''.join([*groups, last])}</robot>")
    found = read_robot(RobotFiles(tmp_path / "r.urdf", srdf, group="g0"))
    assert names(found) == ["j0"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('multiplier="2"', 'multiplier="1_0"', "expected a finite number"),
        ('offset="0.1"', 'offset="\u0661"', "expected a finite number"),
        ('radius="0.1"', 'radius="1_0"', "expected above 0"),
        ('xyz="0 0 0.5"', 'xyz="0 0 1e200"', "expected 3 finite numbers"),
        ('multiplier="2"', 'multiplier="1e300"', "expected a finite number"),
    ],
)
def test_numbers_are_those_that_every_program_reads(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    with pytest.raises(InvalidFile, match=said):
        read_robot(RobotFiles(write(tmp_path, "u.urdf", URDF.replace(old, new))))


def test_limits_that_are_not_stated_are_noted(tmp_path: Path, urdf: Path) -> None:
    limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
    free = write(tmp_path, "free.urdf", URDF.replace(limit, "", 1))
    robot = read_robot(RobotFiles(free))
    assert robot.joints[0].upper == np.inf
    note = "joint 'turn' states no limits, and none of its own are checked"
    assert robot.notes == (note,)
    assert pose_difference(robot, np.array([[0.7, 0.1]])).max() < 1e-12
    limits = write(tmp_path, "joint_limits.yaml", LIMITS)
    turn, slide = read_robot(RobotFiles(urdf, joint_limits=limits)).joints
    assert (turn.velocity, turn.acceleration, turn.upper) == (0.5, np.inf, 3.0)
    assert (slide.velocity, slide.acceleration) == (0.5, 2.0)  # of what mimics it
    assert (slide.lower, slide.upper) == (-0.1, 0.2)
    write(tmp_path, "joint_limits.yaml", LIMITS.replace("0.5", "-0.5"))
    with pytest.raises(InvalidFile, match="expected above 0"):
        read_limits(limits)
    for word in ("yes", "1", "'true'"):
        write(tmp_path, "joint_limits.yaml", LIMITS.replace("true", word))
        with pytest.raises(InvalidFile, match="expected true or false"):
            read_limits(limits)


def test_pinocchio_reads_joints_alone(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Its reader complains of a capsule, and takes no joint without limits."""
    limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
    text = URDF.replace("sphere", 'capsule length="0.1"').replace(limit, "<limit/>")
    robot = read_robot(RobotFiles(write(tmp_path, "two.urdf", text)))
    assert pose_difference(robot, np.array([[0.7, 0.1]])).max() < 1e-12
    assert capfd.readouterr() == ("", "")


def test_links_that_are_seen_alone_are_noted(tmp_path: Path) -> None:
    seen = '<visual><geometry><box size="1 1 1"/></geometry></visual></link>'
    text = URDF.replace('<link name="finger"/>', f'<link name="finger">{seen}')
    odd = (
        '<link name="arm"><collision_checking><capsule name="c"/></collision_checking>'
    )
    text = text.replace('<link name="arm">', odd)
    notes = read_robot(RobotFiles(write(tmp_path, "seen.urdf", text))).notes
    assert notes == (
        "links without a collision solid are not judged: 'finger'",
        "Pinocchio's collision_checking is not read; cylinders have flat ends: 'arm'",
    )


def test_parts_of_a_joint_have_names_of_their_own(tmp_path: Path) -> None:
    text = URDF.replace('name="turn" type="revolute"', 'name="a" type="planar"')
    text = text.replace("0 0 2", "0 0 1").replace('"slide"', '"a/x"')
    with pytest.raises(InvalidFile, match="two joints have the value 'a/x'"):
        read_robot(RobotFiles(write(tmp_path, "two.urdf", text)))


def octahedron(folder: Path) -> Path:
    """A mesh of two octahedra, one beside the other."""
    corners = np.vstack([np.eye(3), -np.eye(3)])
    text = "".join(
        f"v {x} {y} {z}\n"
        for x, y, z in [*corners, *(corners + np.array([6.0, 1.0, 0.5]))]
    )
    for first in (1, 7):
        for k in range(8):
            a, b, c = (first + i + 3 * (k >> i & 1) for i in range(3))
            text += f"f {a} {b} {c}\n"
    return write(folder, "two.obj", text)


@pytest.mark.parametrize(("scale", "noted"), [(1e-4, True), (1e-3, False)])
def test_a_link_that_may_be_scaled_once_too_often_is_noted(
    scale: float, noted: bool, tmp_path: Path
) -> None:
    """An octahedron of 2 and another one beside it, 8 along x."""
    octahedron(tmp_path)
    mesh = f'<mesh filename="two.obj" scale="{scale} {scale} {scale}"/>'
    text = URDF.replace('<sphere radius="0.1"/>', mesh)
    notes = read_robot(RobotFiles(write(tmp_path, "mesh.urdf", text))).notes
    odd = [note for note in notes if "two.obj" in note]
    words = "link 'arm': its mesh 'two.obj' is 0.8 mm large; is it in metres"
    assert odd == ([f"{words} without a scale?"] if noted else [])


@pytest.mark.parametrize(("share", "noted"), [(0.99, False), (1.01, True)])
def test_a_link_far_larger_than_all_joints_reach_is_noted(
    share: float, noted: bool, tmp_path: Path
) -> None:
    """Eight along x, against five times the way from joint to joint, in inches say."""
    octahedron(tmp_path)
    reach = read_robot(RobotFiles(write(tmp_path, "two.urdf", URDF))).reach
    scale = share * 5.0 * reach / 8.0
    mesh = f'<mesh filename="two.obj" scale="{scale} {scale} {scale}"/>'
    text = URDF.replace('<sphere radius="0.1"/>', mesh)
    notes = read_robot(RobotFiles(write(tmp_path, "mesh.urdf", text))).notes
    odd = [note for note in notes if "two.obj" in note]
    assert len(odd) == noted
    assert all("'arm'" in note and "in inches" in note for note in odd)


def test_covers_of_a_mesh_hold_all_of_it(tmp_path: Path) -> None:
    octahedron(tmp_path)
    mesh = '<mesh filename="two.obj" scale="0.1 0.1 0.1"/>'
    text = URDF.replace('<sphere radius="0.1"/>', mesh)
    urdf = write(tmp_path, "mesh.urdf", text)
    points = 0.1 * np.vstack([np.eye(3), -np.eye(3)])
    points = np.vstack([points, points + np.array([0.6, 0.1, 0.05])])
    points += np.array([1.0, 0.0, 0.0])
    far = []
    for solids in (MeshCover(), MeshCover("parts", 2), MeshCover("primitives")):
        robot = read_robot(RobotFiles(urdf, solids=solids))
        (arm,) = [body for body in robot.bodies if body.name == "arm"]
        ends = np.repeat(points[:, None], 2, axis=1)
        none = np.zeros(len(points), np.int64)
        covered = np.min(
            [
                row_brackets(pack_pieces([[piece]]), ends, none, 1e-9)[:, 1]
                for piece in arm.pieces
            ],
            axis=0,
        )
        assert covered.max() <= 2e-9
        between = np.array([[[1.3, 0.05, 0.025]] * 2])
        far.append(
            max(
                row_brackets(pack_pieces([[piece]]), between, none[:1], 1e-9)[0, 0]
                for piece in arm.pieces
            )
        )
        assert all(shapes is not None for shapes in link_shapes(robot.bodies))
    assert len(robot.bodies) == 3
    assert far[0] <= 0.0  # the hull fills the gap, two hulls do not
    assert far[1] > 0.1
    with pytest.raises(InvalidInput, match="expected bodies 'parts'"):
        solids_of("hull", 3)


def test_a_capsule_is_its_closed_form(tmp_path: Path) -> None:
    text = URDF.replace('<sphere radius="0.1"/>', '<capsule radius="0.1" length="2"/>')
    (arm,) = [
        body
        for body in read_robot(RobotFiles(write(tmp_path, "c.urdf", text))).bodies
        if body.name == "arm"
    ]
    point = np.array([[[1.0, 0.0, 1.5]] * 2])
    packed = pack_pieces([list(arm.pieces)])
    low, high = row_brackets(packed, point, np.zeros(1, np.int64), 1e-9)[0]
    assert low <= 0.4 <= high
    assert high - low < 1e-8


def test_a_mesh_is_beside_the_urdf_or_in_a_package_dir(tmp_path: Path) -> None:
    text, more = URDF.replace('sphere radius="0.1"', f'mesh filename="{MESH}"'), "more"
    files = RobotFiles(write(tmp_path, "two.urdf", text), package_dirs=(more,))
    with pytest.raises(InvalidFile, match=f"{MESH!r} is not found; say where with"):
        read_robot(files)
    (tmp_path / more).mkdir()
    files = replace(files, package_dirs=(tmp_path / more,))
    for folder in (tmp_path / more, tmp_path):  # the URDF's own folder is the first
        write_cube(folder / MESH, 0.1)
        assert folder / MESH in read_robot(files).more_files


def test_xacro_is_expanded(tmp_path: Path) -> None:
    pytest.importorskip("xacrodoc")
    head = '<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    head += '<xacro:property name="size" value="${0.05 * 2}"/>'
    text = URDF.replace('<robot name="two">', head).replace('"0.1"', '"${size}"')
    robot = read_robot(RobotFiles(write(tmp_path, "two.urdf.xacro", text)))
    plain = read_robot(RobotFiles(write(tmp_path, "two.urdf", URDF)))
    q = np.array([[0.3, 0.1]])
    np.testing.assert_array_equal(robot.tree.poses(q), plain.tree.poses(q))
    with pytest.raises(InvalidFile, match=r"macros\.xacro: .*it is of macros alone"):
        read_robot(RobotFiles(write(tmp_path, "macros.xacro", f"{head}</robot>")))
    large = text.replace("0.05 *", "len('x' * 5 * 10**9) *")
    for bad in (text.replace("0.05 *", "length *"), text[:300], large):
        with pytest.raises(InvalidFile, match="is not expanded by xacrodoc"):
            read_robot(RobotFiles(write(tmp_path, "two.urdf.xacro", bad)))


XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="tall" default="false"/><link name="foot"/>
<link name="arm"><collision><origin xyz="0 0 ${SIZE}"/><geometry>
<sphere radius="$(arg size)"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="foot"/><child link="arm"/>
<axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
</robot>"""
SIZE = "'$(arg tall)' == 'true' and 2.0 or 1.0"


def test_xacro_files_are_given_their_arguments(tmp_path: Path) -> None:
    """In problem files and options, by the proof, the certificate and its checker."""
    pytest.importorskip("xacrodoc")
    file = write(tmp_path, "arm.xacro", XACRO.replace("SIZE", SIZE))
    with pytest.raises(InvalidFile, match="argument size; give it as --xacro-arg NAME"):
        read_robot(RobotFiles(file))
    with pytest.raises(InvalidFile, match="'-o', expected a name of letters"):
        read_robot(RobotFiles(file, xacro_args={"-o": "x"}))
    plain = write(tmp_path, "plain.urdf", URDF)
    with pytest.raises(InvalidFile, match=r"is no xacro file, .* and is given size"):
        read_robot(RobotFiles(plain, xacro_args={"size": "0.1"}))
    stated = "vdsm_problem: 1\nlength_unit: m\nrequired_clearance: 0\n"
    stated += "robot: {urdf: arm.xacro, "
    stated += "xacro_args: {size: 0.25, tall: true}}\nobstacles:\n"
    stated += "  - {name: post, shape: sphere, center: [0, 0, 3.0], radius: 0.5}\n"
    problem = write(tmp_path, "p.yaml", stated)
    rows = write(tmp_path, "t.csv", "turn_rad\n-0.5\n0.5\n")
    certificate = tmp_path / "c.certificate"
    scene = write(
        tmp_path, "s.yaml", "length_unit: m\n" + stated[stated.index("obs") :]
    )
    options = ["--urdf", str(file), "--xacro-arg", "size=0.25", "--xacro-arg"]
    for asked in ([str(problem)], [*options, "tall=true", "--scene", str(scene)]):
        words = ["verify", *asked, "--trajectory", str(rows), "--certificate"]
        words += [str(certificate), "--out", str(tmp_path / "out")]
        ended = CliRunner().invoke(app, words, obj="vdsm verify")
        assert ended.exit_code == 0, ended.output
        found = json.loads((tmp_path / "out" / "verification.json").read_text())
        assert found["min_clearance"]["lower_m"] == pytest.approx(0.25, abs=2e-6)
        stated_in = [tmp_path / "c.certificate.yaml", problem]
        of = next(one for one in stated_in if one.exists())
        assert check_certificate(certificate, of, rows).accepted
    words = ["verify", *options[:2], "--xacro-arg", "size", "--trajectory", str(rows)]
    ended = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "o")], obj="v")
    assert isinstance(
        ended.exception, InvalidInput
    )  # what the command exits with 2 for
    assert "expected NAME=VALUE" in str(ended.exception)


def test_xacro_is_expanded_where_memory_is_limited_already(tmp_path: Path) -> None:
    pytest.importorskip("xacrodoc")
    file = write(tmp_path, "two.urdf.xacro", URDF)
    asked = "import sys, pathlib; from vdsm_pin.robots.xacro import urdf_text; "
    asked += "print(len(urdf_text(pathlib.Path(sys.argv[1]), ())[0]))"
    script = f"ulimit -v 8000000; exec '{sys.executable}' -c '{asked}' '{file}'"
    done = subprocess.run(
        ["bash", "-c", script], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 100


def test_what_a_xacro_includes_is_in_its_hash(tmp_path: Path) -> None:
    """Also what it reads as YAML, both from wherever the command runs."""
    pytest.importorskip("xacrodoc")
    space = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    head = f'<robot name="two" {space}><xacro:include filename="sizes/ball.xacro"/>'
    head += '<xacro:include filename="absent.xacro" optional="true"/>'
    (tmp_path / "sizes").mkdir()
    size = "${xacro.load_yaml('ball.yaml')['size']}"
    ball = f'<robot {space}><xacro:property name="size" value="{size}"/></robot>'
    yaml = write(tmp_path, "ball.yaml", "size: 0.1\n")
    inner = write(tmp_path, "sizes/ball.xacro", ball)
    text = URDF.replace('<robot name="two">', head).replace('"0.1"', '"${size}"')
    files = RobotFiles(write(tmp_path, "two.xacro", text))
    source = cell_of(files).source
    assert source is not None
    assert {inner, yaml} <= set(source.files)
    for file in (inner, yaml):
        file.write_text(file.read_text() + " ")
        changed = cell_of(files).source
        assert changed is not None
        assert changed.sha256 != source.sha256
        source = changed


def test_damaged_semantics_never_end_in_a_traceback(tmp_path: Path, urdf: Path) -> None:
    rng = np.random.default_rng(7)
    refused = 0
    for _ in range(150):
        srdf = write(tmp_path, "two.srdf", mutated(SRDF, rng))
        limits = write(tmp_path, "limits.yaml", mutated(LIMITS, rng))
        for files in ({"srdf": srdf, "group": "both"}, {"joint_limits": limits}):
            try:
                read_robot(RobotFiles(urdf, **files))  # type: ignore[arg-type]
            except VdsmError as error:
                refused += 1
                assert len(str(error).splitlines()) == 1
    assert refused > 100
