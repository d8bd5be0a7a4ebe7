"""Any robot among obstacles as the checker takes it, from its own files.

The URDF is read here once more; joint 0 is fixed and holds the root link.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from itertools import combinations, product
from pathlib import Path as File
from typing import Any, Final, NamedTuple

import numpy as np
from flint import arb_mat

from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.certificate_checker.balls import belongs, claim
from vdsm_pin.certificate_checker.errors import grown
from vdsm_pin.certificate_checker.motion import Branch, beside
from vdsm_pin.certificate_checker.rows import RobotRows
from vdsm_pin.certificate_checker.solids import (
    CUBE,
    Body,
    Compound,
    Pair,
    Solid,
    cover,
    hulls,
    sizes,
    solid,
)
from vdsm_pin.certificate_checker.tree import FIXED, SLIDES, TURNS, Joint, Tree
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.others import OtherFile, Others
from vdsm_pin.io.source import files_in, sha256_of_file
from vdsm_pin.io.xml_reader import end
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Moving
from vdsm_pin.robots.files import CellFile, RobotFiles, files_of_robot, find_mesh
from vdsm_pin.robots.joint_limits import Limits, narrowed, read_limits, stated_limits
from vdsm_pin.robots.model import RobotJoint
from vdsm_pin.robots.srdf import Srdf
from vdsm_pin.robots.trajectory_files import read_motion
from vdsm_pin.robots.xacro import urdf_text

X, Y, Z = np.eye(3)
PLANE: Final = (("/x", SLIDES, X), ("/y", SLIDES, Y))
TURN: Final = (("/yaw", TURNS, Z), ("/pitch", TURNS, Y), ("/roll", TURNS, X))
MOVES: Final = {
    "fixed": (("", FIXED, X),),
    "revolute": (("", TURNS, None),),
    "continuous": (("", TURNS, None),),
    "prismatic": (("", SLIDES, None),),
    "planar": (*PLANE, ("/theta", TURNS, Z)),
    "floating": (*PLANE, ("/z", SLIDES, Z), *TURN),
}
"""What each type of joint is made of: suffix, movement and axis, None for its own."""


def numbers(words: str) -> list[float]:
    """Those of an attribute of a URDF."""
    return [*map(float, words.split())]


def placed(element: ET.Element) -> arb_mat:
    """T_parent_element."""
    origin = element.find("origin")
    words = {} if origin is None else origin.attrib
    x, y, z = numbers(words.get("xyz", "0 0 0"))
    place = arb_mat([[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])
    angles = zip((X, Y, Z), numbers(words.get("rpy", "0 0 0")), strict=True)
    for axis, angle in reversed([one for one in angles if one[1]]):
        turn = Joint(0, TURNS, axis, place, (None, 1.0, angle))
        place = turn.carries([])
    return place


class Model:
    """The joints of a URDF as a tree, which of them a trajectory moves, and its links.

    Of another robot it carries obstacles, along its `path`.

    Args:
        files: Of the robot.
        pose: T_world_root, where the root link hangs on the world, shape (4, 4); [m].
    """

    reach = 0.0

    def __init__(self, files: RobotFiles, pose: Any) -> None:
        self.files, self.lock, self.moved = files, files.lock, list[RobotJoint]()
        text, included = urdf_text(files.urdf, files.package_dirs, files.xacro_args)
        self.document = document = validate_urdf(text, geometry_only=True)
        meshes = map(self._mesh, document.findall("link/collision/geometry/mesh"))
        self.more = (*included, *dict.fromkeys(meshes))
        self.srdf = srdf = Srdf(files.srdf, document) if files.srdf else None
        group = files.group
        claim(srdf or group is None, "a group without a SRDF")
        self.group = None if not srdf or group is None else srdf.group(group)
        self.values = dict[str, tuple[int | None, float, float]]()
        self.elements = {j.attrib["name"]: j for j in document.findall("joint")}
        given = read_limits(files.joint_limits) if files.joint_limits else {}
        base, still = srdf.base() if srdf else None, np.eye(4)
        if base:
            self._own(base.name, base.kind, Limits())
        for name, joint in self.elements.items():
            kind = joint.attrib["type"]
            if kind == "fixed":
                self.values[name] = (None, 1.0, 0.0)
            elif len(MOVES[kind]) > 1 or joint.find("mimic") is None:
                limits = stated_limits(joint, given.get(name, Limits()))
                self._own(name, kind, limits)
        self.joints = [Joint(0, FIXED, X, pose, (None, 1.0, 0.0))]
        waiting, links = [*self.elements.values()], document.findall("link")
        (root,) = {x.attrib["name"] for x in links} - {end(j, "child") for j in waiting}
        self.frames = {root: self._hang(1, base.name, base.kind, still) if base else 1}
        while waiting:
            joint = next(j for j in waiting if end(j, "parent") in self.frames)
            waiting.remove(joint)
            name, kind = joint.attrib["name"], joint.attrib["type"]
            parent, axis = self.frames[end(joint, "parent")], joint.find("axis")
            own = numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
            frame = self._hang(parent, name, kind, placed(joint), own)
            self.frames[end(joint, "child")] = frame
        self.tree = Tree(self.joints)
        self.moved, self.notes = narrowed(self.moved, self.values, document, given)

    def _own(self, name: str, kind: str, limits: Limits) -> None:
        """Of a joint that follows none: columns of its own, or values that stay."""
        away = self.group is not None and name not in self.group
        for suffix, movement, _ in MOVES[kind]:
            one = name + suffix
            if away or one in self.lock or name in self.lock:
                value = self.lock.get(one, 0.0)
                within = limits.lower <= value <= limits.upper
                claim(within, f"joint {one!r} stands outside of its limits")
                self.values[one] = (None, 1.0, value)
                continue
            self.values[one] = (len(self.moved), 1.0, 0.0)
            both = limits.lower, limits.upper
            rates = limits.velocity, limits.acceleration
            self.moved.append(RobotJoint(one, *both, movement == TURNS, *rates))

    def _value(self, name: str, followers: tuple[str, ...] = ()) -> Any:
        """Column, ratio and offset of a joint's value."""
        if name not in self.values:
            known = name in self.elements and name not in followers
            mimic: Any = self.elements[name].find("mimic") if known else None
            told = f"joint {name!r} has no value that another could follow"
            claim(mimic is not None, told)
            column, ratio, more = self._value(mimic.get("joint"), (*followers, name))
            factor = float(mimic.get("multiplier", "1"))
            more = factor * more + float(mimic.get("offset", "0"))
            self.values[name] = column, factor * ratio, more
        return self.values[name]

    def _hang(self, parent: int, name: str, kind: str, place: Any, own: Any = X) -> int:
        """The frame that a joint carries."""
        for suffix, movement, axis in MOVES[kind]:
            along, value = own if axis is None else axis, self._value(name + suffix)
            self.joints.append(Joint(parent, movement, along, place, value))
            parent, place = len(self.joints), np.eye(4)
        return parent

    def least_errors(self, asked: ErrorBox) -> dict[str, Any]:
        """Of each joint, by the unit of its values, what a problem asks for."""
        least: dict[str, Any] = {"joints_rad": {}, "joints_m": {}}
        for joint in self.moved:
            plain = asked.joint if joint.turns else asked.slide
            least[f"joints_{joint.unit}"][joint.name] = plain
        claim(not asked.joints, "errors of a robot's joints are by name")
        for one in asked.named:
            for key, error in (("joints_rad", one.turn), ("joints_m", one.shift)):
                told = f"errors are of {one.name!r}, which does not move so"
                claim(one.name in least[key] or not error, told)
                if error:
                    least[key][one.name] = max(least[key][one.name], error)
        return least

    def err(self, stated: Any) -> None:
        """Take the errors that a certificate states; a follower has the leader's."""
        values = stated["joints_rad"] | stated["joints_m"]
        self.joints[0].err(0.0, *stated["base"])
        for joint in self.joints:
            if joint.column is not None:
                value = values[self.moved[joint.column].name]
                joint.err(abs(float(joint.ratio)) * value, 0.0, 0.0)

    def _mesh(self, mesh: ET.Element) -> Any:
        name = mesh.attrib["filename"]
        found = find_mesh(name, self.files.urdf, self.files.package_dirs)
        claim(found, f"mesh {name!r} is not found")
        return found

    def branch(self, trajectory: File, topic: str | None, how: Any = "auto") -> Branch:
        """How a trajectory moves the joints."""
        motion = read_motion(trajectory, self.moved, topic, self.values, how)
        timed = motion.times is not None
        rates = [x for x in (motion.rates, motion.changes) if timed and x is not None]
        branch = Branch(motion.q, motion.times, rates=rates)
        claim((np.diff(branch.times) > 0.0).all(), "times do not rise")
        return branch

    def links(self, whose: str = "") -> "list[Link]":
        """Those that have solids; `whose` is what their names begin with."""
        own = [(x, x.attrib["name"]) for x in self.document.findall("link[collision]")]
        return [Link(whose + name, self.frames[name], x, self) for x, name in own]

    def solids(self, link: ET.Element, name: str, covers: Any) -> Iterator[Solid]:
        """The convex pieces of a link; of each mesh as the certificate has it."""
        for collision in link.findall("collision"):
            *axes, shift = np.array(placed(collision).tolist(), float)[:3].T
            for shape in collision.findall("geometry/*"):
                if shape.tag == "mesh":
                    mesh = read_mesh(self._mesh(shape))
                    scale = np.array(numbers(shape.get("scale", "1 1 1")))
                    points = mesh.vertices * scale * (mesh.unit or 1.0)
                    cover = covers.pop(0) if covers else None
                    place, corners = (axes, shift), points[mesh.triangles]
                    yield from self._covered(name, corners, place, cover)
                    continue
                words = (shape.get(x, "0") for x in ("size", "radius", "length"))
                size, radius, length = (np.array(numbers(word)) for word in words)
                points = {"box": CUBE * size / 2, "sphere": np.zeros((1, 3))}
                points = points.get(shape.tag, np.array([-Z, Z]) * length / 2)
                far = np.abs(points).max() + np.abs(shift).max()
                round_ = radius[0] if shape.tag == "cylinder" else 0.0
                grown, disc = radius[0] - round_, (axes[2], round_)
                yield Solid(name, [points @ axes + shift], far, grown, disc)
        claim(not covers, f"{name} has fewer meshes than are told of")

    def _covered(self, name: str, corners: Any, place: Any, cover: Any) -> Any:
        """Convex solids that hold a mesh in the way that the problem asks for."""
        (axes, shift), asked = place, self.files.solids
        far = np.abs(corners).max() + np.abs(shift).max()
        if asked.cover == "primitives":
            yield primitive(name, corners.reshape(-1, 3) @ axes + shift, cover)
            return
        most = asked.parts if asked.cover == "parts" else 1
        over = np.array([0] * len(corners) if cover is None else cover)
        good = over.shape == corners.shape[:1] and {*over.tolist()} <= {*range(most)}
        claim(good, f"{name}: expected a hull of at most {most} over each triangle")
        groups = [np.flatnonzero(over == k) for k in np.unique(over)]
        for points in hulls(name, corners, groups):
            yield Solid(name, [points @ axes + shift], far)


class Link(NamedTuple):
    """A link with solids; called with a certificate's links it is made of them.

    Args:
        name: In the certificate.
        frame: On which it rides.
        element: In the URDF.
        model: Whose it is.
    """

    name: str
    frame: int
    element: ET.Element
    model: Model
    reach: float = 0.0  # readers ask for it, of obstacles

    def __call__(self, told: Mapping[str, Any]) -> Compound:
        """Its convex pieces."""
        covers = told.get(self.name, {"meshes": []})["meshes"]
        parts = self.model.solids(self.element, self.name, [*covers])
        return Compound(self.name, [*parts], told)


def other_robot(one: OtherFile) -> Others:
    """The links of another robot, as obstacles that it carries."""
    files = files_of_robot(one.model, one.folder)
    model: Any = Model(files, one.pose)
    model.path = model.branch(one.trajectory, one.topic)
    links = (Moving(x, model, x.frame) for x in model.links(f"{one.name}: "))
    named = (*files.files, *model.more, *files_in(one.trajectory))
    return Others((*links,), named, model.path.timed)


class Robot:
    """What the files ask about.

    Args:
        file: The problem as it was read.
        header: Of the certificate.
        trajectory: The file.
    """

    judged = "clearances hold under the errors stated, limits and rates without them"

    def __init__(self, file: CellFile, header: Any, trajectory: File) -> None:
        self.model = model = Model(file.robot, np.eye(4))
        size = float(sum(joint.lever for joint in model.joints)) or 1.0
        names = {name for name, frame in model.frames.items() if frame != 1}
        found = file.scene(size, names, other_robot)
        scene, source = found.scene, file.source(model.more, found).sha256
        belongs(header, "errors topic", source, sha256_of_file(trajectory))
        how, told = header["interpolation"], header["links"]
        own = model.branch(trajectory, header["topic"], how)
        joined = {1: "linear", 3: "cubic", 5: "quintic"}[own.degree]
        claim(how == joined, f"interpolation is {how}, the file's is {joined}")
        self.links = {x.name: Body(x.frame, x(told)) for x in model.links()}
        things = [solid(one, told) for one in scene.obstacles]
        cover(things, header, self.links)
        self.tree, self.path, at = beside(own, model.joints, scene.obstacles)
        stated, asked = header["errors"], file.errors(scene)
        off = grown(stated, asked, model.least_errors(asked), things)
        model.err(stated)
        self.obstacles = [Body(*one) for one in zip(at, things, off, strict=True)]
        self.notes = [file.robot.solids.words, f"{joined} pieces", *model.notes]
        self.pairs = [*self._pairs(*file.required)]
        self.notes += [note for one in things for note in one.notes()]
        self.notes += sizes(scene.obstacles)
        self.rows = RobotRows(self, own)

    def _pairs(self, required: float, own: float) -> Iterator[Pair]:
        """What the problem holds apart, in order: from obstacles, then links."""
        links = self.links
        for obstacle, link in product(self.obstacles, links.values()):
            for part in link.solid.parts:
                yield Pair(Body(link.frame, part), obstacle, required)
        left = self.model.srdf.disabled() if self.model.srdf else {}
        pairs = [*combinations(links, 2)]
        apart = [names for names in pairs if self._held(*names, left)]
        for one, other in apart:
            both = links[other], links[one]
            link, rest = sorted(both, key=lambda x: len(x.solid.parts))
            for part in link.solid.parts:
                yield Pair(Body(link.frame, part), rest, own)
        self.notes += [f"{len(pairs) - len(apart)} of {len(pairs)} link pairs left out"]

    def _held(self, one: str, other: str, left: Any) -> bool:
        """Whether two links are held apart."""
        way = self.tree.way(self.links[one].frame, self.links[other].frame)
        moving = sum(self.tree.joints[k].column is not None for k, _ in way)
        near = moving == 1 and self.model.srdf is None
        return moving > 0 and not near and frozenset((one, other)) not in left


def primitive(name: str, points: Any, cover: Any) -> Solid:
    """A ball, capsule or box that holds all points, shape (n, 3)."""
    claim(cover, f"{name}: what holds its mesh is missing")
    origin, edges = (np.array(cover[key]) for key in ("origin_m", "edges_m"))
    edges = edges.reshape(-1, 3)
    radius = float(cover["radius_m"])
    shares = np.linalg.lstsq(edges.T, (points - origin).T, rcond=None)[0].T.clip(0, 1)
    corners = origin + np.array([*product((0, 1), repeat=len(edges))]) @ edges
    far = float(max(np.abs(x).max() for x in (corners, points))) + radius
    off = np.linalg.norm(origin + shares @ edges - points, axis=1)
    holds = (off <= radius - 2.0**-46 * far).all()
    claim(holds, f"{name}: a corner of its mesh is not proved inside of what holds it")
    return Solid(name, [corners], far, radius)
