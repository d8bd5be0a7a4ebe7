"""An arm from a URDF: a rail along x, then links on universal joints in one line.

What is not such an arm is refused by the joint that differs; the cone of psi and the
cable holes, which URDF cannot express, stand in the problem file. `vdsm urdf` writes
documents of this kind.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import decode, naming, read_bytes
from vdsm_pin.io.xml_reader import declared, end, origin_of
from vdsm_pin.tolerances import TOLERANCES

MAX_BYTES: Final = 16 << 20
X, Y, Z = np.eye(3)
IN_LINE: Final = "expected its origin on the x axis of the link before, unturned"


@dataclass(frozen=True)
class UrdfArm:
    """What a URDF says of an arm.

    Args:
        content: The bytes of the file.
        name: Of the robot.
        link_lengths: L_1..L_N, shape (N,); [m].
        link_radius: Largest radius of its spheres and cylinders; [m].
        max_joint_angle: The limit of every angle; [rad].
        base_range: Smallest and largest x0; [m].
    """

    content: bytes
    name: str
    link_lengths: FloatArray
    link_radius: float
    max_joint_angle: float
    base_range: tuple[float, float]


def read_urdf_arm(path: Path) -> UrdfArm:
    """The arm that a URDF describes.

    Raises:
        InvalidFile: If the file is no URDF, or not of such an arm; names the joint.
    """
    content = read_bytes(path, limit=MAX_BYTES)
    with naming(path):
        robot = validate_urdf(declared(decode(content, path)))
    return _Reading(path, robot).arm(content)


@dataclass(frozen=True)
class _Reading:
    path: Path
    robot: ET.Element

    def arm(self, content: bytes) -> UrdfArm:
        """The chain of joints as lengths and limits."""
        joints = self._chain()
        rail, turning, tip = joints[0], joints[1:-1], joints[-1]
        self._expect(rail, "prismatic", X)
        if len(turning) % 2:  # a chain has four at least
            problem = (
                f"has {len(turning)} joints between the rail and the tip, expected two "
                "revolutes for each of 2 or more links"
            )
            raise InvalidFile(file=self.path, problem=problem)
        offsets = [self._offset(joint) for joint in (*turning, tip)]
        for k, joint in enumerate(turning):
            self._expect(joint, "revolute", Y if k % 2 else Z)
            if k % 2 and offsets[k] != 0.0:
                raise self._invalid(joint, "expected its origin on that of the yaw")
        self._expect(tip, "fixed")
        if self._offset(rail) != 0.0 or offsets[0] != 0.0:
            raise self._invalid(turning[0], "expected joint 1 at the base's origin")
        lengths = [*offsets[2:-1:2], offsets[-1]]
        links = (end(joint, "child") for joint in turning[1::2])
        return UrdfArm(
            content,
            self.robot.get("name", self.path.stem),
            np.array(lengths),
            self._radius(dict(zip(links, lengths, strict=True))),
            self._box(turning),
            _limits(rail),
        )

    def _chain(self) -> list[ET.Element]:
        """The joints from the root to the tip, in order."""
        by_parent: dict[str, list[ET.Element]] = {}
        joints = self.robot.findall("joint")
        for joint in joints:
            by_parent.setdefault(end(joint, "parent"), []).append(joint)
        links = {link.get("name", "") for link in self.robot.findall("link")}
        (link,) = links - {end(joint, "child") for joint in joints}
        chain = []
        while found := by_parent.get(link, []):
            if len(found) > 1:
                names = ", ".join(joint.get("name", "") for joint in found)
                problem = f"link {link!r} carries {names}; expected one joint: a chain"
                raise InvalidFile(file=self.path, problem=problem)
            chain.append(found[0])
            link = end(found[0], "child")
        if len(chain) < 6:
            problem = f"has {len(chain)} joints in a row, expected a rail and 2 links"
            raise InvalidFile(file=self.path, problem=problem)
        return chain

    def _expect(
        self, joint: ET.Element, kind: str, axis: FloatArray | None = None
    ) -> None:
        if joint.get("type") != kind:
            raise self._invalid(joint, f"is {joint.get('type')}, expected {kind}")
        if (mimic := joint.find("mimic")) is not None:
            problem = (
                f"mimics {mimic.get('joint')!r}, expected one that moves by itself"
            )
            raise self._invalid(joint, problem)
        stated = joint.find("axis")
        words = "1 0 0" if stated is None else stated.get("xyz", "1 0 0")
        if axis is not None and [*map(float, words.split())] != axis.tolist():
            wanted = " ".join(f"{value:g}" for value in axis)
            found = " ".join(words.split())
            raise self._invalid(
                joint, f"turns or slides along {found}, expected {wanted}"
            )

    def _offset(self, joint: ET.Element) -> float:
        """Where a joint stands on the x axis of the one before; [m]."""
        pose = origin_of(joint)
        straight = np.eye(4)
        straight[0, 3] = pose[0, 3]
        if not np.abs(pose - straight).max() <= TOLERANCES.arithmetic:
            raise self._invalid(joint, IN_LINE)
        return float(pose[0, 3])

    def _box(self, turning: Sequence[ET.Element]) -> float:
        """The limit that all angles share; [rad]."""
        _, first = _limits(turning[0])
        for joint in turning:
            if (limits := _limits(joint)) != (-first, first):
                problem = (
                    f"has limits {limits}, expected {(-first, first)} as the first"
                )
                raise self._invalid(joint, problem)
        return first

    def _radius(self, reach: dict[str, float]) -> float:
        """Largest radius of the collision shapes, which all lie on their link's axis.

        Args:
            reach: How far the axis of each link goes from its origin along x; [m].
        """
        radii = [
            self._radius_of(name, shape, reach.get(name, 0.0))
            for link in self.robot.findall("link")
            for name in [link.get("name", "")]
            for shape in link.findall("collision")
        ]
        if not radii:
            problem = "has no collision shape, so no body; expected spheres, cylinders"
            raise InvalidFile(file=self.path, problem=problem)
        return max(radii)

    def _radius_of(self, link: str, shape: ET.Element, reach: float) -> float:
        """Radius of a sphere or cylinder on the axis of a link; [m]."""
        body = next(iter(shape.iterfind("geometry/*")))
        if body.tag not in ("sphere", "cylinder"):
            problem = "is neither a sphere nor a cylinder; a link here is a capsule"
            raise self._bad_shape(link, problem)
        pose = origin_of(shape)
        x, aside = float(pose[0, 3]), np.abs(pose[1:3, 3]).max()
        half = 0.0
        if body.tag == "cylinder":
            half = 0.5 * float(body.get("length", ""))
            aside = max(aside, np.abs(pose[1:3, 2]).max())  # a URDF cylinder is along z
        excess = max(float(aside), half - x, x + half - reach)
        if not excess <= TOLERANCES.arithmetic:
            problem = f"is off the link's axis, from 0 to {reach:g} m along x"
            raise self._bad_shape(link, problem)
        return float(body.get("radius", ""))

    def _bad_shape(self, link: str, problem: str) -> InvalidFile:
        where = f"link {link!r}"
        return InvalidFile(file=self.path, where=where, problem=f"a shape {problem}")

    def _invalid(self, joint: ET.Element, problem: str) -> InvalidFile:
        return InvalidFile(
            file=self.path, where=f"joint {joint.get('name')!r}", problem=problem
        )


def _limits(joint: ET.Element) -> tuple[float, float]:
    """Least and largest value of a joint that was checked to have them; [m], [rad]."""
    stated = joint.find("limit")
    assert stated is not None
    return float(stated.get("lower", "")), float(stated.get("upper", ""))
