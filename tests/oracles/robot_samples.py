"""Robots within their errors, sampled: kinematics of its own, distances by Coal.

Nothing of the package is used. Joints take the corners of the error box, and those that
follow others move with them; base and obstacles are off by as much as is stated.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import coal
import numpy as np

Rng = np.random.Generator
CUBE = 10.0
"""Edge of the one mesh, a cube about its origin."""


def rpy(values: Any) -> Any:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    turned = np.eye(3)
    for axis, angle in zip(np.eye(3), values, strict=True):
        turned = spin(axis, angle) @ turned
    return turned


def spin(axis: Any, angle: float) -> Any:
    """The rotation about a unit axis (Rodrigues)."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def pose(turned: Any = None, shift: Any = None) -> Any:
    """T from a rotation and an origin, shape (4, 4)."""
    found = np.eye(4)
    found[:3, :3] = np.eye(3) if turned is None else turned
    found[:3, 3] = 0.0 if shift is None else shift
    return found


def numbers(words: str) -> Any:
    return np.array([*map(float, words.split())])


def origin(element: ET.Element) -> Any:
    given = element.find("origin")
    words = {} if given is None else given.attrib
    turned = rpy(numbers(words.get("rpy", "0 0 0")))
    return pose(turned, numbers(words.get("xyz", "0 0 0")))


def shape(element: ET.Element) -> Any:
    """Of a URDF, for Coal."""
    size = {word: numbers(text) for word, text in element.attrib.items() if
            word in ("size", "radius", "length", "scale")}  # fmt: skip
    match element.tag:
        case "box":
            return coal.Box(*size["size"])
        case "sphere":
            return coal.Sphere(*size["radius"])
        case "cylinder":
            return coal.Cylinder(*size["radius"], *size["length"])
        case "capsule":
            return coal.Capsule(*size["radius"], *size["length"])
    return coal.Box(*np.abs(CUBE * size.get("scale", np.ones(3))))


@dataclass
class Errors:
    """As far as what may be off: joints by name, base and obstacles shift and turn."""

    joints: Mapping[str, float] = field(default_factory=dict)
    base: tuple[float, float] = (0.0, 0.0)
    obstacles: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class Sampler:
    """Distances of a robot's links from obstacles and from one another.

    Args:
        urdf: Its text.
        virtual: Type of the joint "roll" between the world and its root; "" for none.
        cell: The problem file's data, in metres.
    """

    def __init__(self, urdf: str, virtual: str, cell: Any) -> None:
        self.document, self.virtual = ET.fromstring(urdf), virtual
        stated = cell.get("base", {})
        turned = rpy(np.radians(stated.get("rpy_deg", [0, 0, 0])))
        self.T_world_base = pose(turned, stated.get("position", [0, 0, 0]))
        self.obstacles = {o["name"]: obstacle(o) for o in cell["obstacles"]}
        self.solids = {
            link.attrib["name"]: [
                (shape(one), origin(collision))
                for collision in link.findall("collision")
                for one in collision.findall("geometry/*")
            ]
            for link in self.document.findall("link")
        }

    def _moved(self, name: str, kind: str, axis: Any, value: Any) -> Any:
        match kind:
            case "fixed":
                return np.eye(4)
            case "prismatic":
                return pose(shift=axis * value(name))
            case "planar":
                turned = spin(np.eye(3)[2], value(f"{name}/theta"))
                return pose(turned, [value(f"{name}/x"), value(f"{name}/y"), 0])
            case "floating":
                angles = [value(f"{name}/{k}") for k in ("roll", "pitch", "yaw")]
                shift = [value(f"{name}/{k}") for k in "xyz"]
                return pose(rpy(angles), shift)
        return pose(spin(axis, value(name)))

    def poses(self, q: Mapping[str, float], T_error: Any) -> dict[str, Any]:
        """T_world_link of every link; joints without a value stand at 0."""
        joints = {j.attrib["name"]: j for j in self.document.findall("joint")}

        def value(name: str) -> float:
            mimic = joints[name].find("mimic") if name in joints else None
            if mimic is None:
                return q.get(name, 0.0)
            factor = float(mimic.get("multiplier", "1"))
            followed = value(mimic.attrib["joint"])
            return factor * followed + float(mimic.get("offset", "0"))

        waiting = [*joints.values()]
        children = {j.find("child").get("link") for j in waiting}  # type: ignore[union-attr]
        (root,) = set(self.solids) - children
        first = self._moved("roll", self.virtual or "fixed", np.eye(3)[0], value)
        found = {root: self.T_world_base @ T_error @ first}
        while waiting:
            joint = waiting.pop(0)
            parent, child = (joint.find(k).get("link") for k in ("parent", "child"))  # type: ignore[union-attr]
            if parent not in found:
                waiting.append(joint)
                continue
            given = joint.find("axis")
            axis = numbers("1 0 0" if given is None else given.attrib["xyz"])
            axis = axis / np.linalg.norm(axis)
            name, kind = joint.attrib["name"], joint.attrib["type"]
            moved = self._moved(name, kind, axis, value)
            found[child] = found[parent] @ origin(joint) @ moved
        return found

    def gaps(
        self, q: Mapping[str, float], errors: Errors, draw: Rng
    ) -> dict[tuple[str, str], float]:
        """Distances of links and obstacles, links and links, at a corner of the box.

        Args:
            q: Nominal values by name; [rad], [m].
            errors: The box.
            draw: Says which corner.
        """
        off = {name: q[name] + error * draw.choice([-1.0, 1.0]) for name, error in
               errors.joints.items()}  # fmt: skip
        links = self.poses({**q, **off}, strayed(errors.base, np.zeros(3), draw))
        parts = {
            name: [(solid, links[name] @ place) for solid, place in solids]
            for name, solids in self.solids.items()
            if solids
        }
        others = {}
        for name, (solid, place) in self.obstacles.items():
            about = place[:3, 3]
            moved = strayed(errors.obstacles.get(name, (0.0, 0.0)), about, draw)
            others[name] = [(solid, moved @ place)]
        return {
            (one, other): min(distance(a, b) for a in mine for b in theirs)
            for one, mine in parts.items()
            for other, theirs in (others | parts).items()
            if one != other
        }


def strayed(error: tuple[float, float], about: Any, draw: Rng) -> Any:
    """A shift and a turn about a point, each as far as stated, either way."""
    way, axis = (x / np.linalg.norm(x) for x in draw.normal(size=(2, 3)))
    turned = spin(axis, error[1])
    return pose(turned, about - turned @ about + error[0] * way)


def obstacle(data: Any) -> tuple[Any, Any]:
    """A ball, box or half-space of a problem file, for Coal, and where it stands."""
    match data["shape"]:
        case "sphere":
            return coal.Sphere(data["radius"]), pose(shift=data["center"])
        case "box":
            turned = rpy(np.radians(data["rpy_deg"]))
            return coal.Box(*data["size"]), pose(turned, data["center"])
    n = np.array(data["normal"]) / np.linalg.norm(data["normal"])
    return coal.Halfspace(*n, 0.0), pose(shift=data["point"])


def distance(one: tuple[Any, Any], other: tuple[Any, Any]) -> float:
    request, result, given = coal.DistanceRequest(), coal.DistanceResult(), []
    for solid, place in (one, other):
        given += [solid, coal.Transform3s(place[:3, :3], place[:3, 3])]
    return float(coal.distance(*given, request, result))
