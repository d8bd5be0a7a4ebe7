"""A planning problem to a problem file, with the files of its meshes beside it.

Lengths are written in metres with all their digits. Angles and frames are turned into
degrees and the file's frame, so what is read back may differ in the last digit:
whoever is bound to the file takes the problem as it is read from it.
"""

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field
from functools import singledispatchmethod
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from vdsm_pin.arm.manipulator import BUILT_IN, Manipulator, built_in
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import FloatArray, rpy_from_rotation
from vdsm_pin.io.atomic import write_bytes, write_text
from vdsm_pin.io.errors_field import stated_errors
from vdsm_pin.io.motion_field import FLOATING
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem, Posture
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.scaling import OtherRatios, Scaling, ScalingCentre
from vdsm_pin.problem.scene import Moving, Obstacle
from vdsm_pin.tolerances import TOLERANCES

Fields = dict[str, Any]

AXES: Final = "xyz"


def write_problem(path: Path, problem: PlanningProblem) -> None:
    """Write a problem file, and the files that it names beside it.

    Args:
        path: The problem file. Meshes and clouds go to STEM-1.obj, STEM-2.npy, ...
        problem: What is written.

    Raises:
        InvalidInput: If the problem has what no problem file says, such as obstacles
            that are carried by another robot.
        InvalidFile: If a file cannot be written.
    """
    writer = _Writer(problem, path.stem)
    text = yaml.safe_dump(
        _plain(writer.fields()),
        sort_keys=False,
        allow_unicode=True,
        default_flow_style=None,
    )
    for name, content in writer.beside.items():
        write_bytes(path.parent / name, content)
    write_text(path, text)


@dataclass
class _Writer:
    """What a problem file says, and the files that it names.

    Args:
        problem: What is written.
        stem: Name of the problem file without its ending.
        beside: Content of the files that it names, by their names.
    """

    problem: PlanningProblem
    stem: str
    beside: dict[str, bytes] = field(default_factory=dict)

    def fields(self) -> Fields:
        """The fields of the file."""
        task, pose = self.problem, self.problem.T_world_base
        whole: Fields = {"vdsm_problem": 1, "name": task.name, "length_unit": "m"}
        if not np.array_equal(pose, np.eye(4)):
            turned = np.rad2deg(rpy_from_rotation(pose[:3, :3]))
            whole["base"] = {"position": pose[:3, 3], "rpy_deg": turned}
        whole["manipulator"] = self._arm(task.manipulator)
        whole["obstacles"] = [self._obstacle(one) for one in task.scene.obstacles]
        whole |= {
            "tip_path": task.tip_path and self._path(task.tip_path),
            "start": task.start and self._posture(task.start),
            "goal": task.goal and self._goal(task.goal),
            "ratios": task.scaling and _ratios(task.scaling),
            "errors": stated_errors(task.errors, 1.0, task.manipulator.n_links),
            "required_clearance": task.required_clearance,
            "required_self_clearance": task.required_self_clearance,
        }
        if task.tip_tolerance != TOLERANCES.tip_on_path:
            whole["tip_tolerance"] = task.tip_tolerance
        if task.max_row_change is not None:
            whole["max_change_per_row_deg"] = np.rad2deg(task.max_row_change)
        return _given(whole)

    def _arm(self, arm: Manipulator) -> str | Fields:
        if arm.name in BUILT_IN and arm == built_in(arm.name):
            return arm.name
        lengths, cables = arm.link_lengths.copy(), arm.cables
        if arm.tool:
            lengths[-1] -= arm.tool.length
        return _given(
            {
                "name": arm.name,
                "link_lengths": lengths,
                "link_radius": arm.link_radius if arm.radii is None else arm.radii,
                "max_link_angle_deg": np.rad2deg(arm.max_link_angle),
                "max_joint_angle_deg": np.rad2deg(arm.max_joint_angle),
                "base_range": arm.base_range,
                "cables": {
                    "hole_radius": cables.hole_radius,
                    "half_gap": cables.half_gap,
                    "hole_angles_deg": np.rad2deg(cables.hole_angles),
                },
                "tool": arm.tool and vars(arm.tool),
                "feed": arm.feed and vars(arm.feed),
                "bodies": [self._body(body) for body in arm.bodies],
                "ignore_pairs": arm.ignore_pairs,
            }
        )

    def _body(self, body: LinkBody) -> Fields:
        parts = {"parts": body.parts} if isinstance(body.solid, solids.Mesh) else {}
        return {
            "name": body.name,
            "link": body.link,
            **self._solid(body.solid),
            **parts,
        }

    def _obstacle(self, obstacle: Obstacle) -> Fields:
        if isinstance(obstacle, Moving):
            solid, motion = obstacle.solid, self._motion(obstacle)
            return {"name": obstacle.name, **self._solid(solid), "motion": motion}
        world = obstacle.placed(self.problem.T_world_base)
        return {"name": obstacle.name, **self._solid(world)}

    def _motion(self, obstacle: Moving) -> Fields:
        """Knots in the file's frame, of an obstacle that moves as files say it."""
        carrier, pose = obstacle.carrier, self.problem.T_world_base
        if carrier.robot:
            message = (
                f"obstacle {obstacle.name!r} is a part of {carrier.robot!r}; problems "
                "with other robots are not written"
            )
            raise InvalidInput(message)
        path, first = carrier.path, np.asarray(carrier.tree.joints[0].placement)
        floats = obstacle.frame == FLOATING == path.knots.shape[1]
        upright = floats and np.allclose(first[:3, :3], pose[:3, :3].T, atol=1e-12)
        if not upright or path.degree != 1:
            message = f"obstacle {obstacle.name!r} moves in a way no problem file says"
            raise InvalidInput(message)
        places = path.knots[:, :3] + pose[:3, 3]
        turns = np.rad2deg(path.knots[:, :2:-1])
        return {"times_s": path.own_times, "positions": places, "rpy_deg": turns}

    def _path(self, path: DesiredPath) -> Fields:
        start = Posture(path.start, path.start_joints)
        return _given(
            {
                "start": self._posture(start),
                "points": self._points(path.points),
                "closed": path.closed,
                "spacing": path.spacing,
                "approach": path.approach.value,
                "retreat": "home" if path.home else path.retreat,
                "blocked": path.blocked.value,
                "required_coverage": path.required_coverage,
                "order": path.order.value,
                "insertion": self._points(path.insertion),
                "pointing": path.pointing and self._pointing(path.pointing, path),
            }
        )

    def _pointing(self, pointing: Pointing, path: DesiredPath) -> Fields:
        fields: Fields = {"cone_deg": np.rad2deg(pointing.cone)}
        rotation = self.problem.T_world_base[:3, :3]
        if pointing.target is not None:
            fields["target"] = self._points(pointing.target)
        elif pointing.directions is not None:
            turned = pointing.directions @ rotation.T
            one = len(turned) == 1
            which = "direction" if one else "directions"
            fields[which] = turned[0] if one else turned[: len(path.points)]
        return fields

    def _goal(self, goal: Posture) -> Fields:
        found = self._posture(goal)
        return found if goal.joints is not None else {"tip": found}

    def _posture(self, posture: Posture) -> Any:
        """Joint values where they are known, else the tip in the file's frame."""
        if posture.joints is None:
            return self._points(posture.tip)
        degrees = np.rad2deg(posture.joints[1:])
        joints = {"alpha_deg": degrees[::2], "theta_deg": degrees[1::2]}
        return {"joints": {"x0": posture.joints[0], **joints}}

    def _points(self, points: FloatArray) -> FloatArray:
        """Points of the base's frame in that of the file, shape (..., 3); [m]."""
        pose = self.problem.T_world_base
        return points @ pose[:3, :3].T + pose[:3, 3]

    def _file(self, ending: str, content: bytes) -> Fields:
        """The fields of what stands in a file of its own, in metres, at its place."""
        name = f"{self.stem}-{len(self.beside) + 1}{ending}"
        self.beside[name] = content
        return {"file": name, "length_unit": "m", "check_size": False}

    @singledispatchmethod
    def _solid(self, solid: Any) -> Fields:
        """The fields of a solid in the file's frame but its name."""
        message = f"{solid.name!r}: no problem file has a {type(solid).__name__}"
        raise InvalidInput(message)

    @_solid.register
    def _(self, solid: solids.Sphere) -> Fields:
        return {"shape": "sphere", "center": solid.centre, "radius": solid.radius}

    @_solid.register(solids.Cylinder)
    @_solid.register(solids.Capsule)
    def _(self, solid: solids.Cylinder | solids.Capsule) -> Fields:
        return {
            "shape": type(solid).__name__.lower(),
            "axis": solid.axis,
            "center": solid.centre,
            "radius": solid.radius,
            "length": 2.0 * solid.half_length,
        }

    @_solid.register
    def _(self, solid: solids.Box) -> Fields:
        turned = np.rad2deg(rpy_from_rotation(solid.rotation))
        size = 2.0 * solid.half_size
        return {"shape": "box", "center": solid.centre, "size": size, "rpy_deg": turned}

    @_solid.register
    def _(self, solid: solids.Prism) -> Fields:
        for k, axis in enumerate(AXES):
            order = np.roll(np.arange(3), -1 - k)
            if np.allclose(solid.rotation, np.eye(3)[:, order], atol=1e-12):
                origin = solid.origin[order]
                low, high = solid.span + origin[2]
                polygon = solid.polygon + origin[:2]
                ends = {"from": low, "to": high}
                return {"shape": "prism", "axis": axis, "polygon": polygon, **ends}
        message = f"{solid.name!r}: prisms in problem files are along x, y or z"
        raise InvalidInput(message)

    @_solid.register
    def _(self, solid: solids.HalfSpace) -> Fields:
        return {"shape": "half_space", "point": solid.point, "normal": solid.normal}

    @_solid.register
    def _(self, solid: solids.Mesh) -> Fields:
        corners = [f"v {x!r} {y!r} {z!r}\n" for x, y, z in solid.vertices.tolist()]
        faces = [f"f {a} {b} {c}\n" for a, b, c in (solid.triangles + 1).tolist()]
        text = "".join([*corners, *faces]).encode()
        fields = {"shape": "mesh", **self._file(".obj", text)}
        return fields if solid.solid is None else fields | {"solid": solid.solid}

    @_solid.register
    def _(self, solid: solids.PointCloud) -> Fields:
        cloud = self._file(".npy", _npy(solid.points))
        return {"shape": "points", **cloud, "radius": solid.radius}

    @_solid.register
    def _(self, solid: solids.Voxels) -> Fields:
        cells = self._file(".npy", _npy(solid.centres @ solid.rotation))
        turned = np.rad2deg(rpy_from_rotation(solid.rotation))
        size = 2.0 * solid.half_size
        return {"shape": "voxels", **cells, "size": size, "rpy_deg": turned}


def _ratios(scaling: Scaling) -> Fields:
    if isinstance(scaling, OtherRatios):
        return {"values": scaling.values}
    if isinstance(scaling, ScalingCentre):
        return {"scaling_centre": scaling.centre, "joint": scaling.joint}
    return {"cylinder_radius": scaling.radius, "cylinder_axis": scaling.axis}


def _npy(points: FloatArray) -> bytes:
    content = BytesIO()
    np.save(content, points)
    return content.getvalue()


def _given(values: Mapping[str, Any]) -> Fields:
    """Those that say something: no None, and no list or mapping without entries."""
    return {
        key: one
        for key, one in values.items()
        if one is not None and not (isinstance(one, Sized) and len(one) == 0)
    }


def _plain(value: Any) -> Any:
    """Numbers, lists and mappings as YAML has them."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
