"""What stands in a world of MuJoCo (MJCF), by mujoco (extra `mjcf`)."""

import logging
import math
import xml.etree.ElementTree as ET
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, HalfSpace, Sphere
from vdsm_pin.io.source import check_is_file, naming_file, read_bytes
from vdsm_pin.io.xml_reader import read_xml
from vdsm_pin.problem.scene import Obstacle, Scene


def read_mjcf(file: Path) -> tuple[Scene, tuple[Path, ...]]:
    """The geoms of a world that collide, where they stand, and what it includes.

    Raises:
        InvalidFile: If it is too large or mujoco refuses it, a geom rides on a joint,
            or is of another type than plane, sphere, capsule, cylinder and box.
    """
    if find_spec("mujoco") is None:
        fault = "MJCF needs mujoco: pip install 'vdsm-pin[mjcf]'"
        raise InvalidFile(file=file, fault=fault)
    check_is_file(file)
    if any("\ud800" <= sign <= "\udfff" for sign in str(file)):
        fault = "has a name that is not UTF-8 text, which mujoco does not open"
        raise InvalidFile(file=file, fault=fault)
    included = check_size(file)
    with naming_file(file):
        return Scene(tuple(_solids(file))), included


def load_mujoco() -> Any:
    """The module, whose warnings then go to Python's log and to no file.

    By itself mujoco appends them to MUJOCO_LOG.TXT in the current folder.

    Raises:
        ImportError: If it is not installed.
    """
    import mujoco

    mujoco.set_mju_user_warning(logging.getLogger("mujoco").warning)
    return mujoco


def _solids(file: Path) -> list[Obstacle]:
    """What collides in the world of a file."""
    mujoco = load_mujoco()
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        names = [
            mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, k)
            for k in range(model.ngeom)
        ]
    # What it cannot hold in memory, and names that are no text, end in other errors.
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        fault = f"is refused by mujoco: {' '.join(str(error).split())[:200]}"
        raise InvalidFile(file=file, fault=fault) from None
    if model.nflex:
        fault = "has a flex, which bends, expected a world that stands still"
        raise InvalidFile(file=file, fault=fault)
    paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    return [
        _solid(file, model, data, k, names[k])
        for k in range(model.ngeom)
        if model.geom_contype[k] or model.geom_conaffinity[k] or k in paired
    ]


def _solid(file: Path, model: Any, data: Any, k: int, name: str | None) -> Obstacle:
    import mujoco

    kind = mujoco.mjtGeom(model.geom_type[k]).name.removeprefix("mjGEOM_").lower()
    name = name or f"{kind} {k}"
    if model.body_weldid[model.geom_bodyid[k]] != 0:
        fault = f"geom {name!r} rides on a joint, expected a world that stands still"
        raise InvalidFile(file=file, fault=fault)
    centre, size = np.array(data.geom_xpos[k]), np.array(model.geom_size[k])
    turn = np.array(data.geom_xmat[k]).reshape(3, 3)
    match kind:
        case "plane":
            return HalfSpace(name, centre, turn[:, 2])
        case "sphere":
            return Sphere(name, centre, float(size[0]))
        case "capsule":
            return Capsule(name, centre, turn[:, 2], float(size[1]), float(size[0]))
        case "cylinder":
            return Cylinder(name, centre, turn[:, 2], float(size[1]), float(size[0]))
        case "box":
            return Box(name, centre, turn, size)
    fault = (
        f"geom {name!r} is a {kind}, expected plane, sphere, capsule, cylinder or box"
    )
    raise InvalidFile(file=file, fault=fault)


MAX_BYTES: Final = 64 << 20
"""Largest file that is read; [bytes]."""

MOST: Final = 50_000
"""Elements of a world, each as often as it is repeated."""

DEEPEST: Final = 100
"""Most files that include one another in turn."""

REPEATED: Final = ("replicate", "composite", "flexcomp")
"""Elements whose `count` says how often what is in them stands there."""


def check_size(file: Path) -> tuple[Path, ...]:
    """Refuse a world with more elements than are read.

    Returns:
        The files that it includes or attaches, each once.

    Raises:
        InvalidFile: If it has more, or is no XML.
    """
    seen: dict[Path, None] = {}
    count = _elements(file, file.parent, seen, 0)
    if not count <= MOST:
        fault = (
            f"has {count:.6g} elements, each counted as often as `replicate` and the "
            f"like repeat it, expected at most {MOST}"
        )
        raise InvalidFile(file=file, fault=fault)
    return tuple(seen)[1:]


def _elements(file: Path, folder: Path, seen: dict[Path, None], depth: int) -> float:
    """Elements of a file and of all that it includes or attaches.

    Args:
        file: The file.
        folder: Of the world, from where files are named.
        seen: Files that were counted; mujoco includes none twice.
        depth: How many files include it, one within another.

    Raises:
        InvalidFile: If that are more than are read.
    """
    if file in seen or not file.is_file():  # which mujoco tells
        return 0.0
    if depth > DEEPEST:
        fault = f"is included by {depth} files, one within another"
        raise InvalidFile(file=file, fault=f"{fault}, expected {DEEPEST} at most")
    seen[file] = None
    root = read_xml(read_bytes(file, limit=MAX_BYTES), file)

    def named(element: ET.Element) -> float:
        return _elements(folder / element.get("file", ""), folder, seen, depth + 1)

    models = sum(map(named, root.iter("model")))
    total, left = 0.0, [(root, 1.0)]
    while left:
        element, times = left.pop()
        times *= _count(element)
        total += times
        if element.tag == "include":
            total += times * named(element)
        elif element.tag == "attach":
            total += times * models
        left += [(child, times) for child in element]
    return total


def _count(element: ET.Element) -> float:
    """How often what is in an element stands there; 1 where that cannot be read."""
    if element.tag in REPEATED:
        with suppress(ValueError):
            counts = map(float, element.get("count", "1").split())
            return math.prod(max(1.0, count) for count in counts)
    return 1.0
