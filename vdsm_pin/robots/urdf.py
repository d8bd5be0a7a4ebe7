"""A URDF and its SRDF to a robot: joints, solids, pairs that are held apart."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from vdsm_pin.arm.urdf_validator import unknown_elements, validate_urdf
from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.source import naming_file
from vdsm_pin.proof.bodies import Body, LeftOut
from vdsm_pin.proof.tree import Tree
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.joint_limits import Limits, read_limits
from vdsm_pin.robots.joints import JointReader, Moving
from vdsm_pin.robots.link_solids import LinkReader
from vdsm_pin.robots.model import Robot, reach_of
from vdsm_pin.robots.srdf import Srdf
from vdsm_pin.robots.xacro import urdf_text
from vdsm_pin.text import listed, plain_number

UNLIMITED: Final = "continuous", "planar", "floating"
"""Types of joints whose `lower` and `upper` nobody reads."""


def read_robot(files: RobotFiles) -> Robot:
    """The robot of some files.

    Raises:
        InvalidFile: If a file breaks its contract, a mesh is missing or far too large,
            or a joint is of a kind that is not judged.
        InvalidInput: If a group is named without a SRDF.
    """
    urdf, group, solids = files.urdf, files.group, files.solids
    text, included = urdf_text(urdf, files.package_dirs, files.xacro_args)
    with naming_file(urdf):
        document = validate_urdf(text, geometry_only=True)
    more = Srdf(files.srdf, document) if files.srdf is not None else None
    if group is not None and more is None:
        message = f"group {group!r} needs a SRDF, which lists its joints"
        raise InvalidInput(message)
    moves = more.group(group) if more is not None and group is not None else None
    limits = read_limits(files.joint_limits) if files.joint_limits else {}
    base = more.base() if more is not None else None
    reader = JointReader(urdf, Moving(moves, files.lock, limits, base))
    reader.read(document)
    links = LinkReader(urdf, files.package_dirs, solids)
    bodies = _bodies(links, document, reader)
    tree = Tree(tuple(reader.joints))
    disabled = more.disabled() if more is not None else {}
    unknown = (*_unlimited(limits, document), *(more.notes() if more else ()))
    apart = any(joint.placement[:3, 3].any() for joint in tree.joints)
    odd = (*links.notes, *(links.too_large(reach_of(tree)) if apart else ()))
    held, left_out = held_pairs(tree, bodies, disabled, more is None)
    return Robot(
        name=document.get("name", urdf.stem),
        text=text,
        tree=tree,
        joints=tuple(reader.movable),
        frames=reader.frames,
        bodies=bodies,
        held=held,
        left_out=left_out,
        base=base,
        solids=solids,
        notes=(*reader.notes, *unknown, *odd, *_not_judged(document)),
        more_files=(*included, *links.meshes(document)),
        covers=links.covers,
        urdf=urdf,
        package_dirs=files.package_dirs,
    )


def _unlimited(limits: Mapping[str, Limits], document: ET.Element) -> Iterator[str]:
    """A note on limits of joints that there are not."""
    names = {joint.get("name", "") for joint in document.findall("joint")}
    if unknown := [name for name in limits if name not in names]:
        yield f"limits of what is no joint of the URDF are not read: {listed(unknown)}"


def _not_judged(document: ET.Element) -> Iterator[str]:
    """Notes on what is not judged or read, or that Pinocchio takes otherwise."""
    links = [
        link for link in document.findall("link") if link.find("visual") is not None
    ]
    names = [link.get("name", "") for link in links if link.find("collision") is None]
    if names:
        yield f"links without a collision solid are not judged: {listed(names)}"
    others = [
        link.get("name", "") for link in document.findall("link[collision_checking]")
    ]
    if others:
        what = "Pinocchio's collision_checking is not read; cylinders have flat ends"
        yield f"{what}: {listed(others)}"
    for kind, place in (("joint", "."), ("link", "collision")):
        having: dict[str, list[str]] = {}
        for one in document.findall(kind):
            for tag in (
                t for part in one.findall(place) for t in unknown_elements(part)
            ):
                having.setdefault(tag, []).append(one.get("name", ""))
        for tag, names in having.items():
            yield f"<{tag}> of {kind}s is not read: {listed(names)}"
    if names := [*_limits_not_meant(document)]:
        what = "lower and upper limits of types of joints that have none are not judged"
        yield f"{what}: {listed(names)}"
    for tag in ("origin", "geometry"):
        if names := [one.get("name", "") for one in document.findall(f"link[{tag}]")]:
            yield f"<{tag}> directly inside links is not read: {listed(names)}"
    words = (word for one in document.iter() for word in (one.tag, *one.attrib))
    spaces = {word[1:].partition("}")[0] for word in words if word.startswith("{")}
    if spaces:
        yield f"what is of these namespaces is not read: {listed(sorted(spaces))}"


def _limits_not_meant(document: ET.Element) -> Iterator[str]:
    """Joints with lower and upper limits that their types do not have."""
    for joint in document.findall("joint"):
        limit = joint.find("limit")
        if limit is not None and joint.get("type") in UNLIMITED:
            ends = (plain_number(limit.get(k, "0")) for k in ("lower", "upper"))
            if any(end != 0.0 for end in ends):  # some write 0 and 0 for none
                yield joint.get("name", "")


def _bodies(
    links: LinkReader, document: ET.Element, joints: JointReader
) -> tuple[Body, ...]:
    """The links that have solids."""
    found = []
    for link in document.findall("link"):
        name = link.get("name", "")
        if pieces := links.pieces(link):
            found.append(Body(joints.frames[name], pieces, name))
    if not found:
        fault = "no link has a collision solid: there is nothing to prove"
        raise joints.invalid(fault)
    return tuple(found)


def held_pairs(
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
