"""What stands in a world of MuJoCo (MJCF), by mujoco (extra `mjcf`)."""

import logging
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, HalfSpace, Sphere
from vdsm_pin.io.source import check_is_file, naming
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.robots.mjcf_size import check_size


def read_mjcf(file: Path) -> tuple[Scene, tuple[Path, ...]]:
    """The geoms of a world that collide, where they stand, and what it includes.

    Raises:
        InvalidFile: If it is too large or mujoco refuses it, a geom rides on a joint,
            or is of another type than plane, sphere, capsule, cylinder and box.
    """
    if find_spec("mujoco") is None:
        problem = "MJCF needs mujoco: pip install 'vdsm-pin[mjcf]'"
        raise InvalidFile(file=file, problem=problem)
    check_is_file(file)
    if not _is_text(str(file)):
        problem = "has a name that is not UTF-8 text, which mujoco does not open"
        raise InvalidFile(file=file, problem=problem)
    included = check_size(file)
    with naming(file):
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


def _is_text(name: str) -> bool:
    return not any("\ud800" <= sign <= "\udfff" for sign in name)


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
        problem = f"is refused by mujoco: {' '.join(str(error).split())[:200]}"
        raise InvalidFile(file=file, problem=problem) from None
    if model.nflex:
        problem = "has a flex, which bends, expected a world that stands still"
        raise InvalidFile(file=file, problem=problem)
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
        problem = f"geom {name!r} rides on a joint, expected a world that stands still"
        raise InvalidFile(file=file, problem=problem)
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
    problem = (
        f"geom {name!r} is a {kind}, expected plane, sphere, capsule, cylinder or box"
    )
    raise InvalidFile(file=file, problem=problem)
