"""Limits of joints: from the URDF, or from a joint_limits.yaml of MoveIt."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.io.source import read_text
from vdsm_pin.io.yaml_reader import read_yaml
from vdsm_pin.robots.places import Place

MAX_BYTES: Final = 4 << 20


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


def read_limits(path: Path) -> dict[str, Limits]:
    """Limits by the name of the joint, from a joint_limits.yaml of MoveIt.

    Raises:
        InvalidFile: If it is none, or a limit makes no sense.
    """
    document = read_yaml(read_text(path, limit=MAX_BYTES), file=path)
    joints = Place(document, (), document.data)["joint_limits"]
    return {name: _limits(joints[name]) for name in joints.keys()}


def _limits(joint: Place) -> Limits:
    found = Limits(velocity=_most(joint, "velocity"))
    found = replace(found, acceleration=_most(joint, "acceleration"))
    if joint.get("has_position_limits", default=False).value is True:
        low, high = joint["min_position"].number(), joint["max_position"].number()
        if not low <= high:
            problem = f"has min_position {low:g} above max_position {high:g}"
            raise joint.invalid(problem)
        found = replace(found, lower=low, upper=high)
    return found


def _most(joint: Place, kind: str) -> float:
    """The largest velocity or acceleration; inf where there is none."""
    if joint.get(f"has_{kind}_limits", default=False).value is not True:
        return np.inf
    most = joint[f"max_{kind}"]
    if not most.number() > 0.0:
        problem = f"is {most.value}, expected above 0"
        raise most.invalid(problem)
    return most.number()
