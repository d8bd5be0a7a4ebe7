"""A SRDF: pairs that need not be held apart, groups of joints, how the robot stands."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Final, Literal, TypeAlias, cast

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.source import read_text
from vdsm_pin.io.xml_reader import end, read_xml
from vdsm_pin.text import listed

MAX_BYTES: Final = 16 << 20

DISABLE: Final = "disable_collisions"
ENABLE: Final = "enable_collisions"
DEFAULT: Final = "disable_default_collisions"
"""Elements that say which pairs of links are held apart."""

KNOWN: Final = {
    "robot": (
        *("group", "group_state", "end_effector", "virtual_joint", "passive_joint"),
        *(DISABLE, ENABLE, DEFAULT),
        *("link_sphere_approximation", "joint_property"),
    ),
    "group": ("group", "link", "joint", "chain"),
}
"""Elements that others may have, of which a misspelt one would be passed over."""

BaseKind: TypeAlias = Literal["planar", "floating"]


@dataclass(frozen=True)
class Base:
    """A joint between the world and the root link.

    Args:
        name: Of the joint.
        kind: What it leaves free.
    """

    name: str
    kind: BaseKind


class Srdf:
    """One SRDF of a robot.

    Args:
        path: The file.
        robot: The root element of the robot's URDF.

    Raises:
        InvalidFile: If it is no SRDF.
    """

    def __init__(self, path: Path, robot: ET.Element) -> None:
        self._path = path
        self._root = read_xml(read_text(path, limit=MAX_BYTES), path)
        if self._root.tag != "robot":
            fault = f"root element is <{self._root.tag}>, expected <robot>"
            raise self._invalid(fault)
        if self._root.find("joint/parent") is not None:
            fault = "is a URDF, with joints between links; expected a SRDF"
            raise self._invalid(fault)
        for within in (self._root, *self._root.iter("group")):
            self._check_spelling(within, KNOWN[within.tag])
        self._links = {link.get("name", "") for link in robot.findall("link")}
        self._joints = {
            joint.get("name", ""): joint for joint in robot.findall("joint")
        }
        self._joint_of = {end(j, "child"): n for n, j in self._joints.items()}

    def _invalid(self, fault: str) -> InvalidFile:
        return InvalidFile(file=self._path, fault=fault)

    def _check_spelling(self, within: ET.Element, known: Sequence[str]) -> None:
        """Refuse an element that looks like another one misspelt.

        What moves the base, or who is of a group, would be left out.
        """
        for tag in (one.tag for one in within if isinstance(one.tag, str)):
            meant = get_close_matches(tag.lower(), known, 1, 0.7)
            if meant and tag not in known:
                fault = f"<{tag}> is not read by anybody; is <{meant[0]}> meant?"
                raise self._invalid(fault)

    def disabled(self) -> dict[frozenset[str], str]:
        """Pairs of links that it does not hold apart, with its reason.

        As in MoveIt: first all pairs of links that it disables by default, without
        those that it enables; then, whatever is enabled, those that it disables.
        """
        found = dict[frozenset[str], str]()
        for link in self._links.intersection(self._by_default()):
            why = f"left out by the SRDF: disable_default_collisions of {link!r}"
            found |= {frozenset((link, other)): why for other in sorted(self._links)}
        for pair, _ in self._pairs(ENABLE):
            found.pop(pair, None)
        for pair, element in self._pairs(DISABLE):
            reason = element.get("reason", "no reason given")
            found[pair] = f"left out by the SRDF: {reason}"
        return found

    def notes(self) -> Iterator[str]:
        """What of it changes nothing, or else than MoveIt has it."""
        for tag in (DISABLE, ENABLE, DEFAULT):
            pairs = [pair for pair, _ in self._pairs(tag)]
            named = {*self._by_default()} if tag == DEFAULT else set().union(*pairs)
            if unknown := sorted(named - self._links):
                yield f"{tag} of the SRDF names no links: {listed(unknown)}"
        if known := [one for one in self._by_default() if one in self._links]:
            yield (
                f"{DEFAULT} of the SRDF leaves pairs of links out; obstacles are held "
                f"apart from these links all the same: {listed(known)}"
            )
        left = {pair for pair, _ in self._pairs(DISABLE)}
        both = dict.fromkeys(p for p, _ in self._pairs(ENABLE) if p in left)
        for one in both:
            names = " and ".join(map(repr, sorted(one)))
            yield f"the SRDF enables and disables {names}: left out, as in MoveIt"

    def _by_default(self) -> list[str]:
        """Links whose pairs it leaves out, unless it enables them."""
        found = (one.get("link", "") for one in self._root.findall(DEFAULT))
        return [*dict.fromkeys(found)]

    def _pairs(self, tag: str) -> Iterator[tuple[frozenset[str], ET.Element]]:
        """Pairs of links that elements of a kind name."""
        for element in self._root.iter(tag):
            pair = element.get("link1", ""), element.get("link2", "")
            yield frozenset(pair), element

    def base(self) -> Base | None:
        """Its planar or floating virtual joint; None where the root link stands.

        Raises:
            InvalidFile: If it does not carry the root link or is of no known type.
        """
        for element in self._root.findall("virtual_joint"):
            name, kind = element.get("name", ""), element.get("type", "")
            if kind == "fixed":
                continue
            where = f"virtual_joint {name!r}"
            if kind not in ("planar", "floating"):
                fault = f"{where}: type {kind!r}, expected fixed, planar or floating"
                raise self._invalid(fault)
            child = element.get("child_link", "")
            if child not in self._links or child in self._joint_of:
                fault = f"{where}: child_link {child!r} is not the root link"
                raise self._invalid(fault)
            if not name or name in self._joints:
                fault = f"{where}: expected a name that no joint has"
                raise self._invalid(fault)
            return Base(name, cast("BaseKind", kind))
        return None

    def group(self, name: str) -> frozenset[str]:
        """Names of the joints of a group.

        Raises:
            InvalidFile: If it or what it is made of is not there, or a part of itself.
        """
        groups = {g.get("name", ""): g for g in self._root.findall("group")}
        parts, left = dict[str, list[str]](), [name]
        while left:
            if (one := left.pop()) in parts:
                continue
            if one not in groups:
                known = ", ".join(groups) or "none"
                fault = f"has no group {one!r}; known: {known}"
                raise self._invalid(fault)
            parts[one] = [part.get("name", "") for part in groups[one].findall("group")]
            left += parts[one]
        try:
            TopologicalSorter(parts).prepare()
        except CycleError as error:
            fault = f"group {error.args[1][0]!r} is a part of itself"
            raise self._invalid(fault) from None
        return frozenset(j for one in parts for j in self._joints_in(groups[one]))

    def _joints_in(self, group: ET.Element) -> Iterator[str]:
        """Those that a group names, without those of groups within."""
        where = f"group {group.get('name', '')!r}"
        for part in group:
            match part.tag:
                case "joint":
                    yield self._joint(part.get("name", ""), where)
                case "link":
                    link = self._link(part.get("name", ""), where)
                    if link in self._joint_of:
                        yield self._joint_of[link]
                case "chain":
                    yield from self._chain(part, where)

    def _joint(self, name: str, where: str) -> str:
        virtual = {v.get("name", "") for v in self._root.findall("virtual_joint")}
        if name not in self._joints and name not in virtual:
            fault = f"{where} names joint {name!r}, which the URDF lacks"
            raise self._invalid(fault)
        return name

    def _link(self, name: str, where: str) -> str:
        if name not in self._links:
            fault = f"{where} names link {name!r}, which the URDF lacks"
            raise self._invalid(fault)
        return name

    def _chain(self, chain: ET.Element, where: str) -> set[str]:
        """The joints from a base link down to a tip."""
        first = self._link(chain.get("base_link", ""), where)
        tip = link = self._link(chain.get("tip_link", ""), where)
        found = set()
        while link != first:
            if link not in self._joint_of:
                fault = f"{where}: no chain leads from {first!r} to {tip!r}"
                raise self._invalid(fault)
            joint = self._joint_of[link]
            found.add(joint)
            link = end(self._joints[joint], "parent")
        return found
