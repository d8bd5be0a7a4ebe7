"""An arm from a URDF: a rail along x, then links on universal joints in one line.

yourdfpy reads what the document says of joints and shapes. What is not such an arm is
refused by the joint that differs; the cone of psi and the cable holes, which URDF
cannot express, stand in the problem file. `vdsm urdf` writes documents of this kind.
"""

import io
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import Digest, decode, naming_file, read_bytes
from vdsm_pin.io.xml_reader import declared
from vdsm_pin.tolerances import TOLERANCES

MAX_BYTES: Final = 1 << 20
"""An attribute of more than 10 MB is dropped by lxml, which yourdfpy parses with; a
quote in one takes six bytes when it is handed on."""

ATTRIBUTES: Final = {
    "robot": ("name",),
    "link": ("name",),
    "collision": (),
    "geometry": (),
    "joint": ("name", "type"),
    "parent": ("link",),
    "child": ("link",),
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity"),
    "mimic": ("joint",),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
}
"""What says something of an arm: elements and their attributes."""

OF_MOVING: Final = ("axis", "limit", "mimic")
"""Elements of joints that are read, and checked, of those that move within limits."""

X, Y, Z = np.eye(3)
IN_LINE: Final = "expected its origin on the x axis of the link before, unturned"


@dataclass(frozen=True)
class UrdfArm:
    """What a URDF says of an arm.

    Args:
        name: Of the robot.
        link_lengths: L_1..L_N, shape (N,); [m].
        link_radius: Largest radius of its spheres and cylinders; [m].
        max_joint_angle: The limit of every angle; [rad].
        base_range: Smallest and largest x0; [m].
    """

    name: str
    link_lengths: FloatArray
    link_radius: float
    max_joint_angle: float
    base_range: tuple[float, float]


def read_urdf_arm(path: Path, digest: Digest) -> UrdfArm:
    """The arm that a URDF describes.

    Args:
        path: The URDF.
        digest: Gets its bytes.

    Raises:
        InvalidFile: If the file is no URDF, or not of such an arm; names the joint.
    """
    content = read_bytes(path, limit=MAX_BYTES)
    digest.update(content)
    with naming_file(path):
        document = validate_urdf(declared(decode(content, path)))
    from yourdfpy import URDF  # slow to import, and only such files need it

    robot = URDF.load(
        io.BytesIO(ET.tostring(_bare(document), "utf-8")),
        build_scene_graph=False,
        load_meshes=False,
        load_collision_meshes=False,
    ).robot
    return _Reading(path, robot).arm()


def _bare(element: ET.Element) -> ET.Element:
    """An element of a URDF without what says nothing of the arm.

    yourdfpy ends in a traceback at a colour that is none, and its parser passes over
    the rest of a document that is too deep.
    """
    told = {
        k: element.get(k, "") for k in ATTRIBUTES[element.tag] if k in element.keys()
    }
    still = element.get("type") not in (None, "revolute", "prismatic")
    bare = ET.Element(element.tag, told)
    for child in element:
        if child.tag in ATTRIBUTES and not (still and child.tag in OF_MOVING):
            bare.append(_bare(child))
    return bare


@dataclass(frozen=True)
class _Reading:
    path: Path
    robot: Any

    def arm(self) -> UrdfArm:
        """The chain of joints as lengths and limits."""
        joints = self._chain()
        rail, turning, end = joints[0], joints[1:-1], joints[-1]
        self._expect(rail, "prismatic", X)
        if len(turning) % 2:  # a chain has four at least
            fault = (
                f"has {len(turning)} joints between the rail and the tip, expected two "
                "revolutes for each of 2 or more links"
            )
            raise InvalidFile(file=self.path, fault=fault)
        offsets = [self._offset(joint) for joint in (*turning, end)]
        for k, joint in enumerate(turning):
            self._expect(joint, "revolute", Y if k % 2 else Z)
            if k % 2 and offsets[k] != 0.0:
                raise self._invalid(joint, "expected its origin on that of the yaw")
        self._expect(end, "fixed")
        if self._offset(rail) != 0.0 or offsets[0] != 0.0:
            raise self._invalid(turning[0], "expected joint 1 at the base's origin")
        lengths = [*offsets[2:-1:2], offsets[-1]]
        links = (joint.child for joint in turning[1::2])
        return UrdfArm(
            self.robot.name or self.path.stem,
            np.array(lengths),
            self._radius(dict(zip(links, lengths, strict=True))),
            self._box(turning),
            (float(rail.limit.lower), float(rail.limit.upper)),
        )

    def _chain(self) -> list[Any]:
        """The joints from the root to the tip, in order."""
        by_parent: dict[str, list[Any]] = {}
        children = set()
        for joint in self.robot.joints:
            by_parent.setdefault(joint.parent, []).append(joint)
            children.add(joint.child)
        link = next(one.name for one in self.robot.links if one.name not in children)
        chain = []
        while found := by_parent.get(link, []):
            if len(found) > 1:
                names = ", ".join(joint.name for joint in found)
                fault = f"link {link!r} carries {names}; expected one joint: a chain"
                raise InvalidFile(file=self.path, fault=fault)
            chain.append(found[0])
            link = found[0].child
        if len(chain) < 6:
            fault = f"has {len(chain)} joints in a row, expected a rail and 2 links"
            raise InvalidFile(file=self.path, fault=fault)
        return chain

    def _expect(self, joint: Any, kind: str, axis: FloatArray | None = None) -> None:
        if joint.type != kind:
            raise self._invalid(joint, f"is {joint.type}, expected {kind}")
        if joint.mimic is not None:
            fault = f"mimics {joint.mimic.joint!r}, expected one that moves by itself"
            raise self._invalid(joint, fault)
        if axis is not None and not np.array_equal(joint.axis, axis):
            wanted = " ".join(f"{value:g}" for value in axis)
            found = " ".join(f"{value:g}" for value in joint.axis)
            raise self._invalid(
                joint, f"turns or slides along {found}, expected {wanted}"
            )

    def _offset(self, joint: Any) -> float:
        """Where a joint stands on the x axis of the one before; [m]."""
        pose = np.eye(4) if joint.origin is None else np.asarray(joint.origin)
        straight = np.eye(4)
        straight[0, 3] = pose[0, 3]
        if not np.abs(pose - straight).max() <= TOLERANCES.arithmetic:
            raise self._invalid(joint, IN_LINE)
        return float(pose[0, 3])

    def _box(self, turning: Sequence[Any]) -> float:
        """The limit that all angles share; [rad]."""
        first = float(turning[0].limit.upper)
        for joint in turning:
            limits = float(joint.limit.lower), float(joint.limit.upper)
            if limits != (-first, first):
                fault = f"has limits {limits}, expected {(-first, first)} as the first"
                raise self._invalid(joint, fault)
        return first

    def _radius(self, reach: dict[str, float]) -> float:
        """Largest radius of the collision shapes, which all lie on their link's axis.

        Args:
            reach: How far the axis of each link goes from its origin along x; [m].
        """
        radii = [
            self._radius_of(link.name, shape, reach.get(link.name, 0.0))
            for link in self.robot.links
            for shape in link.collisions
        ]
        if not radii:
            fault = "has no collision shape, so no body; expected spheres, cylinders"
            raise InvalidFile(file=self.path, fault=fault)
        return max(radii)

    def _radius_of(self, link: str, shape: Any, reach: float) -> float:
        """Radius of a sphere or cylinder on the axis of a link; [m]."""
        ball, rod = shape.geometry.sphere, shape.geometry.cylinder
        if ball is None and rod is None:
            fault = "is neither a sphere nor a cylinder; a link here is a capsule"
            raise self._bad_shape(link, fault)
        pose = np.eye(4) if shape.origin is None else np.asarray(shape.origin)
        x, aside = float(pose[0, 3]), np.abs(pose[1:3, 3]).max()
        half = 0.0
        if rod is not None:
            half = 0.5 * float(rod.length)
            aside = max(aside, np.abs(pose[1:3, 2]).max())  # a URDF cylinder is along z
        excess = max(float(aside), half - x, x + half - reach)
        if not excess <= TOLERANCES.arithmetic:
            fault = f"is off the link's axis, from 0 to {reach:g} m along x"
            raise self._bad_shape(link, fault)
        return float((ball or rod).radius)

    def _bad_shape(self, link: str, fault: str) -> InvalidFile:
        where = f"link {link!r}"
        return InvalidFile(file=self.path, where=where, fault=f"a shape {fault}")

    def _invalid(self, joint: Any, fault: str) -> InvalidFile:
        return InvalidFile(file=self.path, where=f"joint {joint.name!r}", fault=fault)
