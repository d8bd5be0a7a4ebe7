"""A URDF and its SRDF to a robot: joints, solids, pairs that are held apart."""

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.geometry.solids import BOX_CORNERS
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.source import read_text
from vdsm_pin.proof.bodies import Body
from vdsm_pin.proof.tree import Joint, Kind, Tree
from vdsm_pin.robots.hulls import covering_hull
from vdsm_pin.robots.model import LeftOut, Robot, RobotJoint

MAX_BYTES: Final = 16 << 20
LARGEST_LINK: Final = 20.0
"""A link's mesh larger than this must be in another unit; [m]."""

_KINDS: Final = {
    "fixed": Kind.FIXED,
    "revolute": Kind.REVOLUTE,
    "continuous": Kind.REVOLUTE,
    "prismatic": Kind.PRISMATIC,
}


@dataclass
class _Reader:
    """One URDF that is being read."""

    path: Path
    package_dirs: tuple[Path, ...]
    lock: Mapping[str, float]
    joints: list[Joint] = field(default_factory=list)
    movable: list[RobotJoint] = field(default_factory=list)
    values: dict[str, tuple[int | None, float, float]] = field(default_factory=dict)
    frames: dict[str, int] = field(default_factory=dict)

    def invalid(self, problem: str) -> InvalidFile:
        return InvalidFile(file=self.path, problem=problem)


def read_robot(
    urdf: Path,
    srdf: Path | None = None,
    package_dirs: tuple[Path, ...] = (),
    lock: Mapping[str, float] | None = None,
) -> Robot:
    """The robot of a URDF.

    Args:
        urdf: The URDF.
        srdf: Its SRDF, for the pairs of links that are not to be held apart.
        package_dirs: Where `package://NAME/REST` is looked for, as NAME/REST or REST;
            then beside the URDF and above it.
        lock: Values of joints that stand still; [rad] or [m].

    Raises:
        InvalidFile: If a file is no URDF or SRDF, a mesh is missing or far too large,
            or a joint is of a kind that is not judged.
    """
    text = read_text(urdf, limit=MAX_BYTES)
    try:
        validate_urdf(text, geometry_only=True)
    except InvalidInput as error:
        raise InvalidFile(file=urdf, problem=str(error)) from None
    document = ET.fromstring(text)
    reader = _Reader(urdf, package_dirs, lock or {})
    _read_joints(reader, document)
    links = document.findall("link")
    solids = [(link.get("name", ""), _solids(reader, link)) for link in links]
    bodies = tuple(
        Body(reader.frames[name], pieces, name) for name, pieces in solids if pieces
    )
    if not bodies:
        problem = "no link has a collision solid: there is nothing to prove"
        raise reader.invalid(problem)
    tree = Tree(tuple(reader.joints))
    names = {name for name, _ in solids}
    disabled = _disabled(srdf, names) if srdf is not None else {}
    held, left_out = _pairs(tree, bodies, disabled, srdf is None)
    return Robot(
        name=document.get("name", urdf.stem),
        text=text,
        tree=tree,
        joints=tuple(reader.movable),
        frames=reader.frames,
        bodies=bodies,
        held=held,
        left_out=left_out,
    )


def _read_joints(reader: _Reader, document: ET.Element) -> None:
    """The joints, parents first; those that others mimic before them by name."""
    elements = document.findall("joint")
    children = {_end(joint, "child") for joint in elements}
    (root,) = {link.get("name", "") for link in document.findall("link")} - children
    reader.joints.append(Joint(0))  # the base stands in the world, beside obstacles
    reader.frames[root] = 1
    _read_values(reader, elements)
    waiting = list(elements)
    while waiting:  # a tree, as was checked: each turn takes one at least
        for joint in [j for j in waiting if _end(j, "parent") in reader.frames]:
            _add_joint(reader, joint)
            waiting.remove(joint)
    unknown = reader.lock.keys() - {joint.get("name") for joint in elements}
    if unknown:
        known = ", ".join(joint.get("name", "") for joint in elements)
        problem = f"has no joint {min(unknown)!r} to lock; known: {known}"
        raise reader.invalid(problem)


def _read_values(reader: _Reader, elements: list[ET.Element]) -> None:
    """Column, ratio and offset of each joint's value."""
    for joint in elements:
        name, kind = joint.get("name", ""), joint.get("type", "")
        if _KINDS[kind] is Kind.FIXED:
            reader.values[name] = None, 1.0, 0.0
        elif joint.find("mimic") is None:
            reader.values[name] = _own_value(reader, joint, name)
    waiting = [j for j in elements if j.get("name") not in reader.values]
    while waiting:
        known = [j for j in waiting if _leader(j) in reader.values]
        if not known:
            joint = waiting[0]
            problem = (
                f"joint {joint.get('name')!r} mimics {_leader(joint)!r}, which is no "
                "joint or mimics it in turn"
            )
            raise reader.invalid(problem)
        for joint in known:
            mimic = joint.find("mimic")
            assert mimic is not None
            column, ratio, offset = reader.values[_leader(joint)]
            factor = _number(reader, mimic, "multiplier", 1.0)
            shift = factor * offset + _number(reader, mimic, "offset", 0.0)
            reader.values[joint.get("name", "")] = column, factor * ratio, shift
            waiting.remove(joint)


def _own_value(
    reader: _Reader, joint: ET.Element, name: str
) -> tuple[int | None, float, float]:
    """Of a joint that mimics none: a column of its own, or its locked value."""
    limit, kind = joint.find("limit"), joint.get("type")
    lower, upper = -np.inf, np.inf
    if limit is not None and kind != "continuous":
        lower = _number(reader, limit, "lower", 0.0)
        upper = _number(reader, limit, "upper", 0.0)
    if name in reader.lock:
        value = reader.lock[name]
        if not lower <= value <= upper:
            problem = f"joint {name!r} is locked at {value:g}, outside of its limits "
            raise reader.invalid(problem + f"{lower:g} to {upper:g}")
        return None, 1.0, value
    reader.movable.append(RobotJoint(name, lower, upper, kind != "prismatic"))
    return len(reader.movable) - 1, 1.0, 0.0


def _add_joint(reader: _Reader, joint: ET.Element) -> None:
    name, kind = joint.get("name", ""), _KINDS[joint.get("type", "")]
    column, ratio, offset = reader.values[name]
    axis = np.array([1.0, 0.0, 0.0])
    element = joint.find("axis")
    if element is not None and kind is not Kind.FIXED:
        axis = np.array([float(word) for word in element.get("xyz", "1 0 0").split()])
    reader.joints.append(
        Joint(
            parent=reader.frames[_end(joint, "parent")],
            kind=kind,
            axis=axis / np.linalg.norm(axis),
            placement=_origin(joint),
            column=column,
            ratio=ratio,
            offset=offset,
            name=name,
        )
    )
    reader.frames[_end(joint, "child")] = len(reader.joints)


def _end(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _leader(joint: ET.Element) -> str:
    mimic = joint.find("mimic")
    return "" if mimic is None else mimic.get("joint", "")


def _number(reader: _Reader, element: ET.Element, name: str, default: float) -> float:
    word = element.get(name)
    try:
        value = default if word is None else float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        problem = f"<{element.tag}> has {name}={word!r}, expected a finite number"
        raise reader.invalid(problem)
    return value


def _origin(element: ET.Element) -> FloatArray:
    """T_parent_element, shape (4, 4); its numbers were checked."""
    placement, origin = np.eye(4), element.find("origin")
    if origin is not None:
        rpy = np.array([float(word) for word in origin.get("rpy", "0 0 0").split()])
        placement[:3, :3] = rotation_from_rpy(rpy)
        placement[:3, 3] = [float(word) for word in origin.get("xyz", "0 0 0").split()]
    return placement


def _solids(reader: _Reader, link: ET.Element) -> tuple[Hull | FlatCylinder, ...]:
    """The convex pieces of a link, in its frame; a mesh's hull holds all of it."""
    return tuple(
        piece
        for collision in link.findall("collision")
        for piece in _pieces(reader, link.get("name", ""), collision)
    )


def _pieces(
    reader: _Reader, link: str, collision: ET.Element
) -> Iterator[Hull | FlatCylinder]:
    placement = _origin(collision)
    turn, shift = placement[:3, :3], placement[:3, 3]
    geometry = collision.find("geometry")
    for shape in [] if geometry is None else list(geometry):
        match shape.tag:
            case "box":
                size = np.array([float(w) for w in shape.get("size", "").split()])
                yield Hull(shift + (BOX_CORNERS * size / 2.0) @ turn.T)
            case "sphere":
                yield Hull(shift[None], float(shape.get("radius", "")))
            case "cylinder":
                half = float(shape.get("length", "")) / 2.0
                radius = float(shape.get("radius", ""))
                yield FlatCylinder(shift, turn[:, 2], half, radius)
            case "mesh":
                points = _mesh_points(reader, link, shape)
                yield covering_hull(shift + points @ turn.T)


def _mesh_points(reader: _Reader, link: str, shape: ET.Element) -> FloatArray:
    """The vertices of a link's mesh, scaled, shape (n, 3); [m]."""
    name = shape.get("filename", "")
    mesh = read_mesh(_found(reader, link, name), hashlib.sha256())
    try:
        scale = np.array([float(w) for w in shape.get("scale", "1 1 1").split()])
    except ValueError:
        scale = np.zeros(0)
    if scale.shape != (3,) or not (np.isfinite(scale) & (scale != 0.0)).all():
        word = shape.get("scale")
        problem = f"link {link!r}: scale is {word!r}, expected 3 numbers that are not 0"
        raise reader.invalid(problem)
    metres = 1.0 if mesh.unit is None else mesh.unit  # COLLADA states its own
    points: FloatArray = metres * mesh.vertices * scale
    size = float(np.ptp(points, axis=0).max())
    if not size <= LARGEST_LINK:
        problem = (
            f"link {link!r}: its mesh {name!r} is {size:.4g} m large; is it in "
            'millimetres? expected scale="0.001 0.001 0.001"'
        )
        raise reader.invalid(problem)
    return points


def _found(reader: _Reader, link: str, name: str) -> Path:
    """The file of a mesh."""
    beside = reader.path.resolve().parent
    if not name.startswith(("package://", "model://")):
        places = [beside / name.removeprefix("file://")]
    else:
        inner = Path(name.split("://", 1)[1])
        rest = Path(*inner.parts[1:])
        folders = [*reader.package_dirs, beside, *beside.parents]
        places = [folder / part for folder in folders for part in (inner, rest)]
    for place in places:
        if place.is_file():
            return place
    problem = f"link {link!r}: mesh {name!r} is not found; say where with --package-dir"
    raise reader.invalid(problem)


def _disabled(srdf: Path, links: set[str]) -> dict[frozenset[str], str]:
    """Pairs of links that a SRDF does not hold apart, with its reason."""
    text = read_text(srdf, limit=MAX_BYTES)
    try:
        document = ET.fromstring(text)
    except ET.ParseError as error:
        problem = f"SRDF is not XML: {error}"
        raise InvalidFile(file=srdf, problem=problem) from None
    found = {}
    for element in document.iter("disable_collisions"):
        pair = element.get("link1", ""), element.get("link2", "")
        for name in pair:
            if name not in links:
                problem = f"disable_collisions names {name!r}, which is no link"
                raise InvalidFile(file=srdf, problem=problem)
        reason = element.get("reason", "no reason given")
        found[frozenset(pair)] = f"left out by the SRDF: {reason}"
    return found


def _pairs(
    tree: Tree,
    bodies: tuple[Body, ...],
    disabled: Mapping[frozenset[str], str],
    adjacent: bool,
) -> tuple[tuple[tuple[int, int], ...], tuple[LeftOut, ...]]:
    """Which links are held apart, and which are not.

    Args:
        tree: The joints.
        bodies: The links with solids.
        disabled: What the SRDF leaves out.
        adjacent: Whether neighbours are left out too, where there is no SRDF.
    """
    held, left_out = [], []
    for i, one in enumerate(bodies):
        for k in range(i + 1, len(bodies)):
            other = bodies[k]
            ways = tree.way(one.frame, other.frame)
            between = [
                int(j)
                for j in np.concatenate(ways)
                if tree.joints[j].column is not None
            ]
            reason = disabled.get(frozenset((one.name, other.name)), "")
            if not between:
                reason = "no joint between them moves"
            elif adjacent and len(between) == 1 and not reason:
                reason = "neighbours, joined by one joint"
            if reason:
                left_out.append(LeftOut(one.name, other.name, reason))
            else:
                held.append((i, k))
    return tuple(held), tuple(left_out)
