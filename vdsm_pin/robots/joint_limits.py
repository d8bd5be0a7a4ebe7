"""Limits of joints: from the URDF, or from a joint_limits.yaml of MoveIt.

A joint that moves is held to its own, and to those of joints that mimic it.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.io.places import Place
from vdsm_pin.io.source import read_text
from vdsm_pin.io.yaml_reader import read_yaml
from vdsm_pin.robots.model import RobotJoint, Values
from vdsm_pin.tolerances import TOLERANCES

MAX_BYTES: Final = 4 << 20
HAS: Final = tuple(
    f"has_{kind}_limits"
    for kind in ("position", "velocity", "acceleration", "deceleration", "jerk", "soft")
)
"""Of a joint in a joint_limits.yaml; misspelt it would count as left out."""

ONE_VALUE: Final = "revolute", "continuous", "prismatic"
"""Types of joints that can mimic another."""


@dataclass(frozen=True)
class Limits:
    """Of one joint, infinite where there is none; in its own unit [rad, m] and [s].

    Args:
        lower: Least value.
        upper: Largest value.
        velocity: Largest rate.
        acceleration: Largest change of the rate.
        stated: Whether a limit of position is stated where one is expected.
    """

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    acceleration: float = np.inf
    stated: bool = True


def stated_limits(joint: ET.Element, given: Limits) -> Limits:
    """The limits of a joint of a URDF, which `validate_urdf` has passed.

    A velocity or acceleration of 0 is none, as MoveIt has it.

    Args:
        joint: The joint.
        given: Limits that count besides.
    """
    limit, kind = joint.find("limit"), joint.get("type")
    words = {} if limit is None else limit.attrib
    has = kind in ("revolute", "prismatic") and {"lower", "upper"} & words.keys()
    lower = float(words.get("lower", 0.0)) if has else -np.inf
    upper = float(words.get("upper", 0.0)) if has else np.inf
    velocity = float(words.get("velocity", 0.0)) or np.inf
    acceleration = float(words.get("acceleration", 0.0)) or np.inf
    lower, upper = max(lower, given.lower), min(upper, given.upper)
    stated = kind not in ("revolute", "prismatic") or bool(
        np.isfinite([lower, upper]).any()
    )
    return Limits(
        lower,
        upper,
        min(velocity, given.velocity),
        min(acceleration, given.acceleration),
        stated,
    )


def narrowed(
    joints: Sequence[RobotJoint],
    values: Values,
    document: ET.Element,
    given: Mapping[str, Limits],
) -> tuple[list[RobotJoint], list[str]]:
    """The joints that move, held to the limits of those that mimic them too.

    Limits that contradict those of what is mimicked, as some robots state them, leave
    it no room: they are not judged, and noted.

    Args:
        joints: Those that move; one by one the columns of `values`.
        values: Of all joints by those that move.
        document: The URDF.
        given: Limits that count besides.

    Returns:
        The joints; a sentence for each limit that is not judged and not kept.
    """
    held, notes = list(joints), list[str]()
    for element in document.findall("joint"):
        if element.get("type") not in ONE_VALUE or element.find("mimic") is None:
            continue
        name = element.get("name", "")
        limits, value = stated_limits(element, given.get(name, Limits())), values[name]
        column, ratio, offset = value
        if column is not None and ratio:
            joint = held[column]
            found = held[column] = _narrower(joint, name, limits, value)
            ends = (found.lower, found.upper), (joint.lower, joint.upper)
            room = found.upper - found.lower > TOLERANCES.arithmetic
            kept = room or ends[0] == ends[1]
            why = f"they leave joint {joint.name!r}, which it mimics, no room"
            if not kept:
                rates = replace(limits, lower=-np.inf, upper=np.inf)
                held[column] = _narrower(joint, name, rates, value)
        else:
            past = max(limits.lower - offset, offset - limits.upper)
            kept, why = past <= TOLERANCES.arithmetic, f"it stands at {offset:g}"
        if not kept:
            span = f"{limits.lower:g} to {limits.upper:g}"
            notes.append(f"limits of joint {name!r}, {span}, are not judged: {why}")
    return held, notes


def _narrower(
    joint: RobotJoint, name: str, limits: Limits, value: tuple[int | None, float, float]
) -> RobotJoint:
    """A joint held to the limits of one that mimics it."""
    _, ratio, offset = value
    low, high = sorted((x - offset) / ratio for x in (limits.lower, limits.upper))
    found = replace(
        joint,
        lower=max(joint.lower, low),
        upper=min(joint.upper, high),
        velocity=min(joint.velocity, limits.velocity / abs(ratio)),
        acceleration=min(joint.acceleration, limits.acceleration / abs(ratio)),
    )
    if found == joint:
        return joint
    return replace(found, narrowed_by=(*joint.narrowed_by, name))


def read_limits(path: Path) -> dict[str, Limits]:
    """Limits by the name of the joint, from a joint_limits.yaml of MoveIt.

    Raises:
        InvalidFile: If it is none, or a limit makes no sense.
    """
    document = read_yaml(read_text(path, limit=MAX_BYTES), file=path)
    joints = Place(document, (), document.data)["joint_limits"]
    return {str(name): _limits(joints[name]) for name in joints.keys()}


def _limits(joint: Place) -> Limits:
    for key in joint.keys():
        meant = get_close_matches(str(key).lower(), HAS, 1, 0.9)
        if meant and key not in HAS:
            fault = f"has {key!r}; is {meant[0]!r} meant?"
            raise joint.invalid(fault)
    found = Limits(velocity=_most(joint, "velocity"))
    found = replace(found, acceleration=_most(joint, "acceleration"))
    if _has(joint, "position"):
        low, high = joint["min_position"].number(), joint["max_position"].number()
        if not low <= high:
            fault = f"has min_position {low:g} above max_position {high:g}"
            raise joint.invalid(fault)
        found = replace(found, lower=low, upper=high)
    return found


def _most(joint: Place, kind: str) -> float:
    """The largest velocity or acceleration; inf where there is none."""
    if not _has(joint, kind):
        return np.inf
    most = joint[f"max_{kind}"]
    if not most.number() > 0.0:
        fault = f"is {most.value}, expected above 0"
        raise most.invalid(fault)
    return most.number()


def _has(joint: Place, kind: str) -> bool:
    """Whether limits of a kind are stated; `yes` and 1 are neither true nor false."""
    has = joint.get(f"has_{kind}_limits", default=False)
    if not isinstance(has.value, bool):
        fault = f"is {has.value!r}, expected true or false"
        raise has.invalid(fault)
    return has.value
