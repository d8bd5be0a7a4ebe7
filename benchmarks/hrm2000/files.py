"""A draft as files: the problem, its meshes, the witness beside it."""

from functools import singledispatch
from pathlib import Path
from typing import Any, Final

import numpy as np
import trimesh
import yaml

from benchmarks.hrm2000.arms import PAPER
from benchmarks.hrm2000.drafts import Draft
from benchmarks.hrm2000.motions import Witness
from benchmarks.hrm2000.sweeps import required_clearance, scale
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.trajectory_file import write_trajectory

MM: Final = 1e3


def write(folder: Path, name: str, draft: Draft) -> Path:
    """Write NAME.yaml, NAME-MESH.stl and NAME.witness.csv.

    Returns:
        The problem file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    obstacles = []
    for obstacle in draft.obstacles:
        fields = solid(obstacle)
        if isinstance(obstacle, solids.Mesh):
            fields["file"] = f"{name}-{obstacle.name}.stl"
            corners = MM * np.asarray(obstacle.vertices)
            mesh = trimesh.Trimesh(corners, obstacle.triangles, process=False)
            mesh.export(folder / fields["file"])
        obstacles.append({"name": obstacle.name, **fields})
    arm = draft.witness.arm
    data = {
        "vdsm_problem": 1,
        "name": name,
        "length_unit": "mm",
        "manipulator": "hrm8" if arm == PAPER else manipulator(arm),
        "obstacles": obstacles,
        "tip_path": tip_path(draft.witness),
        "required_clearance": MM * required_clearance(arm),
    }
    path = folder / f"{name}.yaml"
    text = yaml.safe_dump(_plain(data), sort_keys=False)
    path.write_text(text, encoding="utf-8")
    write_trajectory(draft.witness.motion, folder / f"{name}.witness.csv")
    return path


def _plain(value: Any) -> Any:
    """Numbers and lists as YAML has them."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in value]
    return float(value) if isinstance(value, np.floating) else value


def manipulator(arm: Manipulator) -> dict[str, Any]:
    """The arm's fields."""
    return {
        "name": arm.name,
        "link_lengths": MM * arm.link_lengths,
        "link_radius": MM * arm.link_radius,
        "max_link_angle_deg": float(np.rad2deg(arm.max_link_angle)),
        "max_joint_angle_deg": float(np.rad2deg(arm.max_joint_angle)),
        "base_range": MM * np.array(arm.base_range),
    }


def tip_path(witness: Witness) -> dict[str, Any]:
    """Start, path, and what is asked of it."""
    first = witness.motion.part(0, 1)
    start: Any = MM * witness.centres[0, -1]
    if not witness.straight:
        joints = {
            "x0": MM * first.x0[0],
            "alpha_deg": np.rad2deg(first.alpha[0]),
            "theta_deg": np.rad2deg(first.theta[0]),
        }
        start = {"joints": joints}
    asked = {} if witness.pointing is None else pointing(witness)
    return {
        "start": start,
        "points": MM * witness.points,
        "closed": witness.closed,
        "spacing": 10.0 * scale(witness.arm),
        "retreat": 100.0 * scale(witness.arm),
        "required_coverage": 1.0,
        **asked,
    }


def pointing(witness: Witness) -> dict[str, Any]:
    """Where the last link shall look."""
    wish = witness.pointing
    assert wish is not None
    fields: dict[str, Any] = {"cone_deg": float(np.rad2deg(wish.cone))}
    if wish.target is not None:
        fields["target"] = MM * wish.target
    elif wish.directions is not None and len(wish.directions) == 1:
        fields["direction"] = wish.directions[0]
    elif wish.directions is not None:
        fields["directions"] = wish.directions[: len(witness.points)]
    return {"pointing": fields}


@singledispatch
def solid(obstacle: object) -> dict[str, Any]:
    """An obstacle's fields but its name."""
    raise NotImplementedError(type(obstacle))


@solid.register
def _(obstacle: solids.Sphere) -> dict[str, Any]:
    return {
        "shape": "sphere",
        "center": MM * obstacle.centre,
        "radius": MM * obstacle.radius,
    }


@solid.register
def _(obstacle: solids.Box) -> dict[str, Any]:
    return {
        "shape": "box",
        "center": MM * obstacle.centre,
        "size": 2.0 * MM * obstacle.half_size,
        "rpy_deg": rpy_deg(obstacle.rotation),
    }


@solid.register(solids.Cylinder)
@solid.register(solids.Capsule)
def _(obstacle: solids.Cylinder | solids.Capsule) -> dict[str, Any]:
    return {
        "shape": type(obstacle).__name__.lower(),
        "axis": obstacle.axis,
        "center": MM * obstacle.centre,
        "radius": MM * obstacle.radius,
        "length": 2.0 * MM * obstacle.half_length,
    }


@solid.register
def _(obstacle: solids.HalfSpace) -> dict[str, Any]:
    point, normal = MM * obstacle.point, obstacle.normal
    return {"shape": "half_space", "point": point, "normal": normal}


@solid.register
def _(obstacle: solids.Mesh) -> dict[str, Any]:
    return {"shape": "mesh", "check_size": False}


def rpy_deg(rotation: FloatArray) -> FloatArray:
    """Roll, pitch and yaw of a rotation, R = Rz Ry Rx; [deg]."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    return np.rad2deg([roll, pitch, yaw])
