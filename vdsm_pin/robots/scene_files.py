"""Scenes for robots: obstacles as in a problem file, or a PlanningScene of MoveIt."""

import hashlib
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, Literal, TypeAlias

import numpy as np
from pydantic import Field

from vdsm_pin.geometry.arrays import FloatArray, rotation_from_quaternion
from vdsm_pin.geometry.solids import Box, Cylinder, HalfSpace, Mesh, Sphere
from vdsm_pin.io.frames import Frame, Reading
from vdsm_pin.io.motion_field import MovableModel
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.places import Place
from vdsm_pin.io.problem_errors import checked
from vdsm_pin.io.problem_file import files_of_obstacles
from vdsm_pin.io.schema_types import FileModel
from vdsm_pin.io.source import read_text
from vdsm_pin.io.yaml_reader import YamlDocument, read_yaml
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.robots.mjcf import read_mjcf
from vdsm_pin.robots.scene_text import read_scene_text
from vdsm_pin.tolerances import TOLERANCES

Reader: TypeAlias = Callable[[Place, str, FloatArray], Obstacle]
"""Of a shape by its place in the file, its name and T_world_shape."""

MAX_BYTES: Final = 32 << 20


class SceneModel(FileModel):
    """Obstacles in the robot's base frame."""

    length_unit: Literal["mm", "m"] = Field(
        description="Unit of every length in this file."
    )
    obstacles: list[MovableModel] = Field(description="Solids to avoid.")


def read_scene_with_files(
    path: Path, robot_size: float, links: Collection[str] = ()
) -> tuple[Scene, tuple[tuple[str, Path], ...]]:
    """The obstacles of a scene file, in the robot's base frame.

    Args:
        path: A YAML file: `length_unit` and `obstacles` as in a problem file, or a
            PlanningScene as MoveIt writes it; its `.scene` text; or a world in MJCF
            (`.xml`, `.mjcf`).
        robot_size: For judging the size of a mesh; [m].
        links: Of the robot, besides the root link.

    Returns:
        The obstacles, and the names of those that have a file of their own, with it;
        so are files that a world includes.

    Raises:
        InvalidFile: If the file breaks its contract, or has attached objects, which are
            not judged.
    """
    kind = path.suffix.lower()
    if kind in (".xml", ".mjcf"):
        world, included = read_mjcf(path)
        return world, tuple((f"{path.name} includes", one) for one in included)
    text = read_text(path, limit=MAX_BYTES)
    if kind == ".scene":
        return _moveit(read_scene_text(path, text), links, robot_size), ()
    document = read_yaml(text, file=path)
    if isinstance(document.data, dict) and "world" in document.data:
        return _moveit(document, links, robot_size), ()
    return _ours(document, path, robot_size)


def _ours(
    document: YamlDocument, path: Path, robot_size: float
) -> tuple[Scene, tuple[tuple[str, Path], ...]]:
    model = checked(document, SceneModel)
    frame = Frame(model.length_unit, np.eye(3), np.zeros(3))
    reading = Reading(document, frame, path.parent, hashlib.sha256())
    builder = ObstacleBuilder(reading, robot_size)
    scene = Scene(builder.build_all(model.obstacles, ("obstacles",)))
    return scene, files_of_obstacles(model.obstacles, path.parent)


def _moveit(document: YamlDocument, links: Collection[str], robot_size: float) -> Scene:
    """The collision objects of a PlanningScene, all solids of one as one obstacle each.

    Its allowed collision matrix is not read: the SRDF says which links may touch.
    """
    whole = Place(document, (), document.data)
    attached = whole.get("robot_state", {}).get("attached_collision_objects", [])
    if attached.value:
        fault = "has attached objects, which are not judged yet"
        raise attached.invalid(fault)
    if whole["world"].get("octomap", {}).get("octomap", {}).get("data", []).value:
        fault = "has an octomap, which is not read"
        raise whole["world"].invalid(fault)
    if whole.get("is_diff", default=False).value:
        fault = "is what changes in a scene, expected a whole one (is_diff: false)"
        raise whole["is_diff"].invalid(fault)
    found: list[Obstacle] = []
    things = whole["world"].get("collision_objects", []).items()
    _check_frames(things, links, whole.get("fixed_frame_transforms", []).items())
    for thing in things:
        found += [_sized(one, robot_size) for one in _solids(thing)]
    with whole["world"].naming():
        return Scene(tuple(found))


def _sized(obstacle: Obstacle, robot_size: float) -> Obstacle:
    """An obstacle, a mesh with a note where its size is that of another unit."""
    if not isinstance(obstacle, Mesh):
        return obstacle
    size = float(np.linalg.norm(np.ptp(obstacle.vertices, axis=0)))
    low, high = TOLERANCES.mesh_size_low, TOLERANCES.mesh_size_high
    if low * robot_size <= size <= high * robot_size:
        return obstacle
    note = f"is {size:.3g} m large beside a robot of {robot_size:.3g} m, as a "
    note += "PlanningScene has it, in metres; is it in another unit?"
    return replace(obstacle, notes=(*obstacle.notes, note))


def _check_frames(
    things: Sequence[Place], links: Collection[str], placed: Sequence[Place]
) -> None:
    """Refuse frames that differ, stand elsewhere or are other links'.

    All objects stand in the root link's.
    """
    names = (one.get("child_frame_id", "") for one in placed if _stands_aside(one))
    elsewhere = {*links, *(str(name.value).lstrip("/") for name in names)} - {""}
    frames = [(one, one.get("header", {}).get("frame_id", "")) for one in things]
    for thing, frame in frames:
        one = str(frame.value)
        if frame.value != frames[0][1].value or one.lstrip("/") in elsewhere:
            fault = f"is in the frame {one[:60]!r}, expected that of the root link"
            raise thing.invalid(fault)


def _stands_aside(placed: Place) -> bool:
    """Whether a TransformStamped shifts or turns."""
    transform = placed.get("transform", {})
    shift = _named(transform.get("translation", [0, 0, 0]), "xyz")
    turn = _named(transform.get("rotation", [0, 0, 0, 1]), "xyzw")
    return bool(shift.any() or turn[:3].any())


def _solids(thing: Place) -> list[Obstacle]:
    name = thing["id"].value
    if not isinstance(name, str) or not name:
        fault = "is no name"
        raise thing["id"].invalid(fault)
    base, shapes = _pose(thing.get("pose", {})), list[tuple[Reader, Place, Place]]()
    for kind, plural, reader in KINDS:
        some = thing.get(plural, []).items()
        poses = thing.get(f"{kind}_poses", []).items()
        if len(some) != len(poses):
            fault = f"{name!r} has not one pose for each of its {plural}"
            raise thing.invalid(fault)
        shapes += [(reader, *both) for both in zip(some, poses, strict=True)]
    count = len(shapes)
    if not count:
        fault = f"{name!r} has no shape"
        raise thing.invalid(fault)
    names = [name if count == 1 else f"{name}/{k}" for k in range(1, count + 1)]
    found = list[Obstacle]()
    for one, (reader, shape, pose) in zip(names, shapes, strict=True):
        with shape.naming():
            found.append(reader(shape, one, base @ _pose(pose)))
    return found


def _primitive(shape: Place, name: str, placement: FloatArray) -> Obstacle:
    kinds = {1: "box", 2: "sphere", 3: "cylinder"}
    kind = shape["type"].value
    kind = kinds.get(kind, kind) if type(kind) in (int, float) else kind
    turn, centre = placement[:3, :3], placement[:3, 3]
    sizes = shape["dimensions"]
    match kind:
        case "box":
            return Box(name, centre, turn, sizes.numbers(3) / 2.0)
        case "sphere":
            return Sphere(name, centre, float(sizes.numbers(1)[0]))
        case "cylinder":
            height, radius = sizes.numbers(2).tolist()
            return Cylinder(name, centre, turn[:, 2], height / 2.0, radius)
    fault = f"is {kind!r}, expected {', '.join(kinds.values())}"
    raise shape["type"].invalid(fault)


def _plane(plane: Place, name: str, placement: FloatArray) -> Obstacle:
    """What lies below a x + b y + c z + d = 0."""
    a, b, c, d = plane["coef"].numbers(4)
    length = float(np.linalg.norm((a, b, c)))
    if not length > 0.0:
        fault = "has no direction"
        raise plane.invalid(fault)
    normal = placement[:3, :3] @ (np.array([a, b, c]) / length)
    foot = placement[:3, 3] - d / length * normal
    return HalfSpace(name, foot, normal)


def _mesh(mesh: Place, name: str, placement: FloatArray) -> Obstacle:
    """Triangles, in metres; an inside is theirs if they are closed."""
    corners = [_named(one, "xyz") for one in mesh["vertices"].items()]
    triangles = [_triangle(one, len(corners)) for one in mesh["triangles"].items()]
    vertices = np.reshape(corners, (-1, 3)) @ placement[:3, :3].T + placement[:3, 3]
    return Mesh(name, vertices, np.array(triangles, np.int64).reshape(-1, 3))


def _triangle(triangle: Place, count: int) -> FloatArray:
    """Numbers of its three corners, of so many vertices."""
    named = isinstance(triangle.value, dict)
    place = triangle["vertex_indices"] if named else triangle
    found = place.numbers(3)
    if not ((found >= 0) & (found < count) & (found % 1 == 0)).all():
        fault = f"is {found.tolist()}, expected three numbers of {count} vertices"
        raise place.invalid(fault)
    return found


KINDS: Final[tuple[tuple[str, str, Reader], ...]] = (
    ("primitive", "primitives", _primitive),
    ("plane", "planes", _plane),
    ("mesh", "meshes", _mesh),
)
"""What a collision object is made of: each kind, the key of all, and what reads one."""


def _pose(pose: Place) -> FloatArray:
    """T_world_object, shape (4, 4): position, quaternion x y z w, listed or named."""
    placement = np.eye(4)
    placement[:3, 3] = _named(pose.get("position", [0, 0, 0]), "xyz")
    quaternion = _named(pose.get("orientation", [0, 0, 0, 1]), "xyzw")
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) <= TOLERANCES.quaternion:
        fault = f"has an orientation of length {length:g}, expected 1"
        raise pose.invalid(fault)
    placement[:3, :3] = rotation_from_quaternion(quaternion / length)
    return placement


def _named(place: Place, keys: str) -> FloatArray:
    if not isinstance(place.value, dict):
        return place.numbers(len(keys))
    values = [place[key].value for key in keys]
    return Place(place.document, place.at, values).numbers(len(keys))
