"""Broken URDFs are refused with a message that names what is broken."""

import io
import re

import pytest
import yourdfpy

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.arm.urdf_writer import urdf_text
from vdsm_pin.errors import InvalidInput

TEXT = urdf_text(built_in("hrm8"))


def replaced(old: str, new: str) -> str:
    assert old in TEXT
    return TEXT.replace(old, new, 1)


def before_end(extra: str) -> str:
    return TEXT.replace("</robot>", f"{extra}</robot>")


LOOP = """
<link name="p"/><link name="q"/>
<joint name="pq" type="fixed"><parent link="p"/><child link="q"/></joint>
<joint name="qp" type="fixed"><parent link="q"/><child link="p"/></joint>
"""
SHAPE = "<link name='tip'><collision><geometry>{}</geometry></collision></link>"
TIP = '<link name="tip" />'
MASS = re.search(r'<mass value="[^"]*" />', TEXT)
assert MASS is not None
INERTIA = re.search(r"<inertia [^/]*/>", TEXT)
assert INERTIA is not None

BROKEN = {
    # yourdfpy's own validation passes the first six.
    "missing parent": (
        replaced('<parent link="base" />', '<parent link="bass" />'),
        "joint 'alpha1': parent link 'bass' does not exist",
    ),
    "link twice": (
        before_end('<link name="link3"/>'),
        "2 links are named 'link3'",
    ),
    "joint twice": (
        replaced('name="theta2"', 'name="theta1"'),
        "2 joints are named 'theta1'",
    ),
    "negative mass": (
        replaced(MASS.group(), '<mass value="-1.0" />'),
        "link 'base': mass is '-1.0', expected above 0",
    ),
    "lower above upper": (
        replaced('lower="-5.0"', 'lower="6.0"'),
        "joint 'x0': lower limit 6.0 is above upper limit 5.0",
    ),
    "loop": (before_end(LOOP), "is its own ancestor: a loop"),
    "not XML": (TEXT[:-20], "URDF is not XML"),
    "no robot": ("<model/>", "root element is <model>"),
    "missing child": (
        replaced('<child link="base" />', '<child link="bass" />'),
        "joint 'x0': child link 'bass' does not exist",
    ),
    "two parents": (
        before_end(
            '<joint name="again" type="fixed">'
            '<parent link="rail"/><child link="link4"/></joint>'
        ),
        "joint 'again': link 'link4' already has a parent",
    ),
    "two roots": (before_end('<link name="loose"/>'), "one root link, found 2"),
    "nameless link": (before_end("<link/>"), "a link has no name"),
    "unknown joint": (
        replaced('type="prismatic"', 'type="planar"'),
        "joint 'x0': type 'planar'",
    ),
    "zero axis": (replaced('xyz="1 0 0"', 'xyz="0 0 0"'), "'x0': axis '0 0 0'"),
    "short axis": (replaced('xyz="1 0 0"', 'xyz="1 0"'), "'x0': axis '1 0'"),
    "limit is a word": (
        replaced('lower="-5.0"', 'lower="low"'),
        "joint 'x0': limit needs numbers lower and upper",
    ),
    "limit is NaN": (
        replaced('lower="-5.0"', 'lower="nan"'),
        "joint 'x0': limit needs numbers lower and upper",
    ),
    "negative effort": (
        replaced('effort="1000.0"', 'effort="-1"'),
        "joint 'x0': limit effort is '-1'",
    ),
    "origin with two numbers": (
        replaced('xyz="0.0 0.0 0.0"', 'xyz="0.0 0.0"'),
        "joint 'x0': origin xyz is '0.0 0.0'",
    ),
    "missing moment": (
        replaced(' izz="', ' jzz="'),
        "link 'base': inertia needs the six numbers",
    ),
    "negative moment": (
        replaced(
            INERTIA.group(),
            '<inertia ixx="-1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>',
        ),
        "link 'base': inertia is not positive definite",
    ),
    "impossible moments": (
        replaced(
            INERTIA.group(),
            '<inertia ixx="1" iyy="1" izz="9" ixy="0" ixz="0" iyz="0"/>',
        ),
        "link 'base': inertia breaks the triangle inequality",
    ),
    "capsule": (
        replaced(TIP, SHAPE.format('<capsule radius="1" length="1"/>')),
        "link 'tip': <capsule> is not read by everybody",
    ),
    "no geometry": (
        replaced(TIP, SHAPE.format("")),
        "link 'tip': collision has 0 geometries",
    ),
    "zero radius": (
        replaced(TIP, SHAPE.format('<sphere radius="0"/>')),
        "link 'tip': sphere radius is '0', expected above 0",
    ),
    "radius that Python alone reads": (
        replaced(TIP, SHAPE.format('<sphere radius="0_1"/>')),
        "link 'tip': sphere radius is '0_1'",
    ),
    "long axis": (replaced('xyz="1 0 0"', 'xyz="1e200 0 0"'), "axis '1e200 0 0'"),
    "two geometries": (
        replaced(
            TIP,
            SHAPE.format(
                '<sphere radius="1"/></geometry><geometry><box size="9 9 9"/>'
            ),
        ),
        "link 'tip': collision has 2 <geometry>, expected 1",
    ),
    "two axes": (
        replaced('<axis xyz="1 0 0"', '<axis xyz="0 1 0"/><axis xyz="1 0 0"'),
        "joint 'x0': joint has 2 <axis>, expected 1",
    ),
    "turn that is not read": (
        replaced('xyz="0.0 0.0 0.0"', 'xyz="0 0 0" quat_xyzw="0 0 1 0"'),
        "joint 'x0': origin has 'quat_xyzw', expected xyz and rpy alone",
    ),
    "collision in capitals": (
        replaced(TIP, '<link name="tip"><Collision/></link>'),
        "link 'tip': <Collision> is not read by anybody; is <collision> meant?",
    ),
    "collision within": (
        replaced(TIP, '<link name="tip"><x><collision/></x></link>'),
        "link 'tip': a collision stands where it is not read",
    ),
    "flat box": (
        replaced(TIP, SHAPE.format('<box size="1 1"/>')),
        "link 'tip': box size is '1 1'",
    ),
}


def test_the_arm_itself_passes() -> None:
    validate_urdf(TEXT)


@pytest.mark.parametrize("name", BROKEN)
def test_broken_document_is_refused(name: str) -> None:
    text, message = BROKEN[name]
    with pytest.raises(InvalidInput, match=re.escape(message)):
        validate_urdf(text)


def test_a_second_reader_takes_the_arm() -> None:
    robot = yourdfpy.URDF.load(io.BytesIO(TEXT.encode()), load_meshes=False)
    assert robot.validate()
    assert robot.num_actuated_joints == 17
