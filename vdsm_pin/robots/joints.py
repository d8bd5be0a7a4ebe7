"""The joints of a URDF as a tree: axes, limits, what moves, what stands still.

A planar joint becomes three, NAME/x, NAME/y and NAME/theta; a floating one six, NAME/x,
/y, /z, /yaw, /pitch and /roll, in this order: R = Rz(yaw) Ry(pitch) Rx(roll).
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.arm.urdf_validator import LARGEST
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.xml_reader import end, origin_of
from vdsm_pin.proof.tree import IDENTITY, Joint, Kind, X, Y, Z
from vdsm_pin.robots.joint_limits import Limits, narrowed, stated_limits
from vdsm_pin.robots.model import RobotJoint
from vdsm_pin.robots.srdf import Base
from vdsm_pin.text import plain_number

_Axis = FloatArray | tuple[float, float, float]


class _Part(NamedTuple):
    """One movement of a joint."""

    suffix: str
    kind: Kind
    axis: _Axis


_SINGLE: Final = {
    "fixed": Kind.FIXED,
    "revolute": Kind.REVOLUTE,
    "continuous": Kind.REVOLUTE,
    "prismatic": Kind.PRISMATIC,
}
_SHIFTS: Final = (_Part("/x", Kind.PRISMATIC, X), _Part("/y", Kind.PRISMATIC, Y))
_SEVERAL: Final[dict[str, tuple[_Part, ...]]] = {
    "planar": (*_SHIFTS, _Part("/theta", Kind.REVOLUTE, Z)),
    "floating": (
        *_SHIFTS,
        _Part("/z", Kind.PRISMATIC, Z),
        _Part("/yaw", Kind.REVOLUTE, Z),
        _Part("/pitch", Kind.REVOLUTE, Y),
        _Part("/roll", Kind.REVOLUTE, X),
    ),
}


class _Value(NamedTuple):
    """A joint's value: ratio times a column of q, and an offset."""

    column: int | None
    ratio: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Moving:
    """Which joints a trajectory moves.

    Args:
        group: Names of the joints; None for all.
        lock: Values of those that stand still; [rad] or [m].
        limits: Limits in place of the URDF's, by joint.
        base: The joint between the world and the root link, if there is one.
    """

    group: frozenset[str] | None
    lock: Mapping[str, float]
    limits: Mapping[str, Limits]
    base: Base | None


@dataclass
class JointReader:
    """The joints of one URDF, which `validate_urdf` has passed, read in turn.

    Args:
        path: The URDF, for messages.
        moving: Which of them a trajectory moves.
    """

    path: Path
    moving: Moving
    joints: list[Joint] = field(default_factory=list)
    movable: list[RobotJoint] = field(default_factory=list)
    frames: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _values: dict[str, _Value] = field(default_factory=dict)

    def invalid(self, fault: str) -> InvalidFile:
        """The URDF is not what is expected."""
        return InvalidFile(file=self.path, fault=fault)

    def read(self, document: ET.Element) -> None:
        """All joints, parents first; those that others mimic before them by name."""
        elements = document.findall("joint")
        children = {end(joint, "child") for joint in elements}
        (root,) = {link.get("name", "") for link in document.findall("link")} - children
        base = self.moving.base
        if base is not None:
            parts = _SEVERAL[base.kind]
            self._own_values(base.name, parts, Limits())
        self._check_names(elements)
        self._read_values(elements)
        given = self.moving.limits
        self.movable, notes = narrowed(self.movable, self._values, document, given)
        self.notes += notes
        self.joints.append(Joint(0))  # the base stands in the world, beside obstacles
        self.frames[root] = 1
        if base is not None:
            self.frames[root] = self._hang(1, base.name, _SEVERAL[base.kind], IDENTITY)
        ends = {
            which: [end(j, which) for j in elements] for which in ("parent", "child")
        }
        for joint in _after(elements, ends["parent"], ends["child"], [root]):
            parent = self.frames[end(joint, "parent")]
            name, parts = joint.get("name", ""), _parts(joint)
            frame = self._hang(parent, name, parts, origin_of(joint))
            self.frames[end(joint, "child")] = frame

    def _hang(
        self, parent: int, name: str, parts: Sequence[_Part], placement: FloatArray
    ) -> int:
        """The frame that a joint carries."""
        for part in parts:
            value = self._values[name + part.suffix]
            self.joints.append(
                Joint(
                    parent=parent,
                    kind=part.kind,
                    axis=part.axis,
                    placement=placement,
                    column=value.column,
                    ratio=value.ratio,
                    offset=value.offset,
                    name=name + part.suffix,
                )
            )
            parent, placement = len(self.joints), IDENTITY
        return parent

    def _check_names(self, elements: list[ET.Element]) -> None:
        """Refuse names of joints to lock or limit that have no value of their own."""
        base = self.moving.base
        own = {} if base is None else {base.name: _SEVERAL[base.kind]}
        for joint in elements:
            if joint.get("type") != "fixed" and joint.find("mimic") is None:
                own[joint.get("name", "")] = _parts(joint)
        known = {name + part.suffix for name, parts in own.items() for part in parts}
        unknown = self.moving.lock.keys() - known - own.keys()
        if unknown:
            words = ", ".join(sorted(known)) or "none"
            fault = f"has no joint {min(unknown)!r} to lock; known: {words}"
            raise self.invalid(fault)
        for name, parts in own.items():
            if len(parts) > 1 and self.moving.lock.get(name, 0.0) != 0.0:
                words = ", ".join(name + part.suffix for part in parts)
                fault = f"joint {name!r} has several values; lock {words}, or it at 0"
                raise self.invalid(fault)

    def _read_values(self, elements: list[ET.Element]) -> None:
        """Column, ratio and offset of each joint's value."""
        waiting = []
        for joint in elements:
            name, parts = joint.get("name", ""), _parts(joint)
            if joint.get("type") == "fixed":
                self._keep(name, _Value(None))
            elif joint.find("mimic") is not None:
                if len(parts) > 1:
                    leader = _leader(joint)
                    fault = f"joint {name!r} mimics {leader!r}, but has no one value"
                    raise self.invalid(fault)
                waiting.append(joint)
            else:
                given = self.moving.limits.get(name, Limits())
                self._own_values(name, parts, stated_limits(joint, given))
        leaders = [_leader(joint) for joint in waiting]
        names = [joint.get("name", "") for joint in waiting]
        for joint in _after(waiting, leaders, names, [*self._values]):
            self._keep(joint.get("name", ""), self._following(joint))
        for name, leader in zip(names, leaders, strict=True):
            if name not in self._values:
                fault = (
                    f"joint {name!r} mimics {leader!r}, which is no joint of one value "
                    "or mimics it in turn"
                )
                raise self.invalid(fault)

    def _following(self, joint: ET.Element) -> _Value:
        mimic = joint.find("mimic")
        assert mimic is not None
        column, ratio, offset = self._values[_leader(joint)]
        factor = self._number(mimic, "multiplier", 1.0)
        shift = factor * offset + self._number(mimic, "offset", 0.0)
        return _Value(column, factor * ratio, shift)

    def _own_values(self, name: str, parts: Sequence[_Part], limits: Limits) -> None:
        """Of a joint that mimics none: columns of its own, or values that stay."""
        if not limits.stated:
            note = f"joint {name!r} states no limits, and none of its own are checked"
            self.notes.append(note)
        for part in parts:
            value = self._standing(name, name + part.suffix, limits)
            if value is None:
                self.movable.append(
                    RobotJoint(
                        name + part.suffix,
                        limits.lower,
                        limits.upper,
                        part.kind is Kind.REVOLUTE,
                        limits.velocity,
                        limits.acceleration,
                    )
                )
                value = _Value(len(self.movable) - 1)
            self._keep(name + part.suffix, value)

    def _keep(self, name: str, value: _Value) -> None:
        """Take down a joint's value, or that of a part of it."""
        if name in self._values:
            fault = f"two joints have the value {name!r}, expected names that differ"
            raise self.invalid(fault)
        self._values[name] = value

    def _standing(self, joint: str, name: str, limits: Limits) -> _Value | None:
        """The value of a joint that stands still; None where it moves."""
        lock, group = self.moving.lock, self.moving.group
        if name in lock or joint in lock:
            value, why = lock.get(name, 0.0), "is locked at"
        elif group is not None and joint not in group:
            value, why = 0.0, "is no part of the group and stands at"
        else:
            return None
        if not limits.lower <= value <= limits.upper:
            fault = f"joint {name!r} {why} {value:g}, outside of its limits "
            fault += f"{limits.lower:g} to {limits.upper:g}; say where with lock"
            raise self.invalid(fault)
        self.notes.append(f"joint {name!r} {why} {value:g}")
        return _Value(None, 1.0, value)

    def _number(self, element: ET.Element, name: str, default: float) -> float:
        word = element.get(name)
        value = default if word is None else plain_number(word)
        if not abs(value) < LARGEST:
            fault = f"<{element.tag}> has {name}={word!r}, expected a finite number"
            raise self.invalid(fault)
        return value


def _after(
    elements: Sequence[ET.Element],
    above: Sequence[str],
    names: Sequence[str],
    first: Sequence[str],
) -> Iterator[ET.Element]:
    """Elements behind those that they hang on, level by level; others are left out.

    Args:
        elements: In the order of the file, which they keep within a level.
        above: The name of what each hangs on.
        names: Their own.
        first: Names of what they hang on in the end.
    """
    below: dict[str, list[int]] = {}
    for k, name in enumerate(above):
        below.setdefault(name, []).append(k)
    level = list(first)
    while found := sorted(k for name in level for k in below.pop(name, ())):
        yield from (elements[k] for k in found)
        level = [names[k] for k in found]


def _parts(joint: ET.Element) -> tuple[_Part, ...]:
    """The movements that a joint is made of."""
    kind = joint.get("type", "")
    if kind in _SEVERAL:
        return _SEVERAL[kind]
    axis, element = np.array(X), joint.find("axis")
    if element is not None and kind != "fixed":
        axis = np.array([float(word) for word in element.get("xyz", "1 0 0").split()])
    return (_Part("", _SINGLE[kind], axis / np.linalg.norm(axis)),)


def _leader(joint: ET.Element) -> str:
    mimic = joint.find("mimic")
    return "" if mimic is None else mimic.get("joint", "")
