"""Refuses URDF documents that the usual readers take and misread.

yourdfpy's own check lets pass a missing parent link, a name used twice, a loop, a
negative mass and limits that are upside down; Pinocchio drops shapes it does not know.
"""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.text import plain_number

JOINT_KINDS: Final = ("fixed", "revolute", "prismatic", "continuous")
"""Joint types of an arm."""

ANY_JOINT_KINDS: Final = (*JOINT_KINDS, "planar", "floating")
"""Joint types of robots that are judged."""

SIZES: Final = {
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "box": {"size": 3},
}
"""Shapes every reader takes, with the count of numbers in each of their sizes."""

ANY_SIZES: Final = {**SIZES, "capsule": {"radius": 1, "length": 1}, "mesh": {}}
"""Shapes of robots that are judged."""


LARGEST: Final = 1e100
"""Numbers beyond this are slips, and their squares would overflow further on."""

AXIS: Final = (1.0 / LARGEST, LARGEST)
"""Largest entry of a joint's axis, whose square is no overflow and not 0; [-]."""

ONCE: Final = (
    *("origin", "geometry", "axis", "limit", "mimic", "parent", "child", "inertial"),
    *("mass", "inertia"),
)
"""Elements of which readers take the first and pass over others."""

KNOWN: Final[Mapping[str, tuple[str, ...]]] = {
    "robot": ("link", "joint"),
    "joint": (
        *("origin", "parent", "child", "axis", "limit", "mimic"),
        *("dynamics", "calibration", "safety_controller"),
    ),
    "link": ("collision", "visual", "inertial"),
    "visual": ("origin", "geometry", "material"),
    "collision": ("origin", "geometry", "material", "verbose", "contact_coefficients"),
}
"""Elements that others may have, of which a misspelt one would be passed over."""

ATTRIBUTES: Final[Mapping[str, tuple[str, ...]]] = {
    "mimic": ("joint", "multiplier", "offset"),
    "limit": (
        *("lower", "upper", "effort", "velocity"),
        *("acceleration", "deceleration", "jerk"),
    ),
    "mesh": ("filename", "scale"),
}
"""Attributes of which one counts as left out where it is misspelt."""

ALIKE: Final = 0.85
"""From here on an attribute is taken for another one misspelt: `gear_velocity`, which
some have besides `velocity`, is not; [-]."""


def validate_urdf(text: str, *, geometry_only: bool = False) -> ET.Element:
    """Refuse a URDF document with any defect that a reader might let pass.

    Args:
        text: The document.
        geometry_only: Whether masses do not matter, and meshes, capsules, planar and
            floating joints and joints without limits are taken.

    Returns:
        Its root element.

    Raises:
        InvalidInput: If the text is not XML; a name is missing or used twice; a joint
            names a link that does not exist; the links are not one tree; a mass,
            inertia or size is impossible; a limit is missing or upside down; an axis
            is zero; a number is not one; or an element is one that a reader would drop.
    """
    try:
        robot = ET.fromstring(text)
    except ET.ParseError as error:
        message = f"URDF is not XML: {error}"
        raise InvalidInput(message) from error
    if robot.tag != "robot":
        message = f"URDF's root element is <{robot.tag}>, expected <robot>"
        raise InvalidInput(message)
    for fault in _faults(robot, geometry_only):
        message = f"URDF: {fault}"
        raise InvalidInput(message)
    return robot


def _faults(robot: ET.Element, geometry_only: bool) -> Iterator[str]:
    for kind in ("link", "joint"):
        names = Counter(element.get("name", "") for element in robot.findall(kind))
        for name, count in names.items():
            if not name:
                yield f"a {kind} has no name"
            if count > 1:
                yield f"{count} {kind}s are named {name!r}; names are unique"
    for joint in robot.findall("joint"):
        yield from _joint_faults(joint, geometry_only)
    yield from _misspelt(robot, "robot")
    yield from _tree_faults(robot)
    for link in robot.findall("link"):
        yield from _link_faults(link, geometry_only)


def _tree_faults(robot: ET.Element) -> Iterator[str]:
    links = {link.get("name", "") for link in robot.findall("link")}
    if not links:
        yield (
            "has no link: it is of macros alone, or a xacro file that does not end in "
            ".xacro"
        )
        return
    parent_of: dict[str, str] = {}
    for joint in robot.findall("joint"):
        name = joint.get("name", "")
        ends = {end: _attribute(joint, end, "link") for end in ("parent", "child")}
        for end, link in ends.items():
            if link not in links:
                yield f"joint {name!r}: {end} link {link!r} does not exist"
        if ends["child"] in parent_of:
            yield f"joint {name!r}: link {ends['child']!r} already has a parent"
        parent_of[ends["child"]] = ends["parent"]
    roots = sorted(links - parent_of.keys())
    if len(roots) > 1:  # without any there is a loop
        yield f"expected one root link, found {len(roots)}: {', '.join(roots)}"
    rooted = set[str]()
    for first in sorted(links):
        link, seen = first, set[str]()
        while link and link not in rooted:
            if link in seen:
                yield f"link {link!r} is its own ancestor: a loop"
                break
            seen.add(link)
            link = parent_of.get(link, "")
        rooted |= seen


def _joint_faults(joint: ET.Element, geometry_only: bool) -> Iterator[str]:
    where = f"joint {joint.get('name', '')!r}"
    kind = joint.get("type", "")
    yield from _repeated(joint, where)
    yield from _misspelt(joint, where)
    yield from _misspelt_attributes(joint, where)
    kinds = ANY_JOINT_KINDS if geometry_only else JOINT_KINDS
    if kind not in kinds:
        yield f"{where}: type {kind!r}, expected one of {', '.join(kinds)}"
    yield from _origin_faults(joint, where)
    if kind == "fixed":
        return
    axis = None if joint.find("axis") is None else _numbers(joint, "axis", "xyz", 3)
    if joint.find("axis") is not None:
        text = _attribute(joint, "axis", "xyz")
        if axis is None or not AXIS[0] < np.abs(axis).max() < AXIS[1]:
            yield f"{where}: axis {text!r} is no direction"
        elif kind == "planar" and (axis[:2].any() or not axis[2] > 0.0):
            yield f"{where}: axis {text!r}, expected 0 0 1 of a planar joint"
    yield from _limit_faults(joint, where, optional=geometry_only)


def unknown_elements(element: ET.Element) -> list[str]:
    """Tags within an element that are none of a URDF, nor of another namespace."""
    tags = (one.tag for one in element if isinstance(one.tag, str))
    return [tag for tag in tags if tag[:1] != "{" and tag not in KNOWN[element.tag]]


def _misspelt(element: ET.Element, where: str) -> Iterator[str]:
    for tag in unknown_elements(element):
        if meant := get_close_matches(tag.lower(), KNOWN[element.tag], 1, 0.7):
            yield f"{where}: <{tag}> is not read by anybody; is <{meant[0]}> meant?"


def _misspelt_attributes(element: ET.Element, where: str) -> Iterator[str]:
    for one in element.iter():
        known = ATTRIBUTES.get(one.tag, ())
        for name in one.attrib:
            meant = get_close_matches(name.lower(), known, 1, ALIKE)
            if meant and name not in known:
                yield f"{where}: <{one.tag}> has {name!r}; is {meant[0]!r} meant?"


def _limit_faults(joint: ET.Element, where: str, optional: bool) -> Iterator[str]:
    """What is wrong with limits; `optional` ones are judged where they are given."""
    limit, kind = joint.find("limit"), joint.get("type")
    given = {} if limit is None else limit.attrib
    if kind in ("revolute", "prismatic"):
        defaults = {"lower": "0", "upper": "0", **given} if optional else given
        bounds = [plain_number(defaults.get(name, "")) for name in ("lower", "upper")]
        if not np.isfinite(bounds).all():
            yield f"{where}: limit needs numbers lower and upper"
        elif not bounds[0] <= bounds[1]:
            yield f"{where}: lower limit {bounds[0]} is above upper limit {bounds[1]}"
    elif not optional:
        return
    for name in ("effort", "velocity", *(["acceleration"] if optional else [])):
        text = given.get(name, "0" if optional else "")
        if not plain_number(text) >= 0.0:
            yield f"{where}: limit {name} is {text!r}, expected 0 or more"


def _link_faults(link: ET.Element, geometry_only: bool) -> Iterator[str]:
    where = f"link {link.get('name', '')!r}"
    yield from _repeated(link, where)
    yield from _misspelt(link, where)
    inertial = link.find("inertial")
    if inertial is not None and not geometry_only:
        yield from _repeated(inertial, where)
        yield from _origin_faults(inertial, where)
        yield from _inertia_faults(inertial, where)
    shown = [] if geometry_only else link.findall("visual")
    sizes = ANY_SIZES if geometry_only else SIZES
    tags = [one.tag.rpartition("}")[2].lower() for one in link.iter()]
    if tags.count("collision") != len(link.findall("collision")):
        yield f"{where}: a collision stands where it is not read, or in capitals"
    for shape in shown + link.findall("collision"):
        yield from _repeated(shape, where)
        yield from _misspelt(shape, f"{shape.tag} of {where}")
        yield from _misspelt_attributes(shape, where)
        yield from _origin_faults(shape, where)
        yield from _shape_faults(shape, where, sizes)


def _inertia_faults(inertial: ET.Element, where: str) -> Iterator[str]:
    mass = _numbers(inertial, "mass", "value", 1)
    if mass is None or not mass[0] > 0.0:
        text = _attribute(inertial, "mass", "value")
        yield f"{where}: mass is {text!r}, expected above 0"
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    values = [_numbers(inertial, "inertia", name, 1) for name in names]
    numbers = [float(value[0]) for value in values if value is not None]
    if len(numbers) < len(names):
        yield f"{where}: inertia needs the six numbers {', '.join(names)}"
        return
    xx, yy, zz, xy, xz, yz = numbers
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not moments[0] > 0.0:
        yield f"{where}: inertia is not positive definite"
    elif not moments[2] <= moments[0] + moments[1]:
        yield f"{where}: inertia breaks the triangle inequality of a real body"


def _shape_faults(
    shape: ET.Element, where: str, sizes: Mapping[str, Mapping[str, int]]
) -> Iterator[str]:
    geometry = shape.find("geometry")
    bodies = [] if geometry is None else list(geometry)
    if geometry is None or len(bodies) != 1:
        yield f"{where}: {shape.tag} has {len(bodies)} geometries, expected 1"
        return
    kind = bodies[0].tag
    if kind not in sizes:
        known = ", ".join(sizes)
        yield f"{where}: <{kind}> is not read by everybody; expected one of {known}"
        return
    for name, count in sizes[kind].items():
        value = _numbers(geometry, kind, name, count)
        if value is None or not (value > 0.0).all():
            text = _attribute(geometry, kind, name)
            yield f"{where}: {kind} {name} is {text!r}, expected above 0"


def _origin_faults(element: ET.Element, where: str) -> Iterator[str]:
    origin = element.find("origin")
    for name in () if origin is None else sorted(origin.keys()):
        if name not in ("xyz", "rpy"):
            yield f"{where}: origin has {name!r}, expected xyz and rpy alone"
        elif _numbers(element, "origin", name, 3) is None:
            text = _attribute(element, "origin", name)
            yield f"{where}: origin {name} is {text!r}, expected 3 finite numbers"


def _repeated(element: ET.Element, where: str) -> Iterator[str]:
    """Elements within one that it has more than once."""
    counts = Counter(child.tag for child in element if child.tag in ONCE)
    for tag, count in counts.items():
        if count > 1:
            yield f"{where}: {element.tag} has {count} <{tag}>, expected 1"


def _attribute(element: ET.Element, child: str, name: str) -> str:
    """An attribute of a child element; empty where either is missing."""
    found = element.find(child)
    return "" if found is None else found.get(name, "")


def _numbers(
    element: ET.Element, child: str, name: str, count: int
) -> FloatArray | None:
    """The finite numbers in a child's attribute; None where they are not `count`."""
    words = _attribute(element, child, name).split()
    values = np.array([plain_number(word) for word in words])
    good = len(words) == count and (np.abs(values) < LARGEST).all()
    return values if good else None
