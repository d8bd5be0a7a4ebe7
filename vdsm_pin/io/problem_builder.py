"""A checked problem file to a planning problem: units, frames, defaults, and sense."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.io import problem_schema as schema
from vdsm_pin.io.obstacle_builder import Frame, ObstacleBuilder, without_repeats
from vdsm_pin.io.yaml_reader import YamlDocument
from vdsm_pin.kinematics import joint_centres
from vdsm_pin.manipulator import (
    BUILT_IN,
    CableLayout,
    Manipulator,
    built_in,
    paper_hole_angles,
)
from vdsm_pin.problem import Approach, Blocked, DesiredPath, Order, PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import MAX_ROWS
from vdsm_pin.units import UNITS_PER_METRE

DEFAULT_HOLE_RADIUS: Final = 0.8
"""Radius of the circle of cable holes over the body radius; [-]."""

DEFAULT_HALF_GAP: Final = 0.1
"""Half gap of a joint over the shortest link; [-]."""

DEFAULT_STROKE: Final = 2.0
"""Stroke of the rail either way over the arm's length; [-]."""


@dataclass(frozen=True)
class BuiltProblem:
    """A planning problem and the files it was made from besides its own.

    Args:
        problem: In the base frame; [m], [rad].
        mesh_contents: Bytes of the mesh files in the order of the obstacles.
    """

    problem: PlanningProblem
    mesh_contents: tuple[bytes, ...]


def build_problem(
    model: schema.ProblemModel, document: YamlDocument, *, name: str, folder: Path
) -> BuiltProblem:
    """The planning problem that a file describes.

    Args:
        model: The file's content, each value checked by itself.
        document: The same with line numbers, for messages.
        name: Name of the problem where the file gives none.
        folder: Where relative mesh paths start.

    Returns:
        The problem and the meshes' bytes.

    Raises:
        InvalidFile: If values that are each in range make no sense together.
    """
    frame, T_world_base = _frame(model)
    arm = ManipulatorBuilder(document, frame).build(model.manipulator)
    self_clearance = float(frame.metres(model.required_self_clearance))
    _check_links_apart(arm, self_clearance, frame, document)
    obstacles = ObstacleBuilder(document, folder, frame, arm.total_length)
    scene = obstacles.build_all(model.obstacles)
    problem = PlanningProblem(
        model.name or name,
        arm,
        scene,
        PathBuilder(document, frame, arm).build(model.tip_path),
        float(frame.metres(model.required_clearance)),
        T_world_base,
        self_clearance,
    )
    return BuiltProblem(problem, tuple(obstacles.mesh_contents))


def _frame(model: schema.ProblemModel) -> tuple[Frame, FloatArray]:
    rotation = rotation_from_rpy(np.deg2rad(model.base.rpy_deg))
    position = np.array(model.base.position) / UNITS_PER_METRE[model.length_unit]
    T_world_base = np.eye(4)
    T_world_base[:3, :3], T_world_base[:3, 3] = rotation, position
    return Frame(model.length_unit, rotation, position), T_world_base


def _check_links_apart(
    arm: Manipulator, self_clearance: float, frame: Frame, document: YamlDocument
) -> None:
    """A link between two others must keep them apart while the arm is straight."""
    needed = 2.0 * arm.link_radius + self_clearance
    for i in range(1, arm.n_links - 1):
        if not arm.link_lengths[i] > needed:
            problem = (
                f"is {frame.shown(arm.link_lengths[i])}, expected above "
                f"{frame.shown(needed)}: twice the body radius and the self-clearance, "
                "else the links on either side of it always touch"
            )
            raise document.invalid(("manipulator", "link_lengths", i), problem)


@dataclass(frozen=True)
class ManipulatorBuilder:
    """Converts the arm."""

    document: YamlDocument
    frame: Frame

    def build(self, model: str | schema.ManipulatorModel) -> Manipulator:
        """The arm by name or by its numbers.

        Raises:
            InvalidFile: If the name is unknown or the numbers do not fit together.
        """
        if isinstance(model, str):
            if model not in BUILT_IN:
                problem = f"is {model!r}; known: {', '.join(BUILT_IN)}, or a mapping"
                raise self.document.invalid(("manipulator",), problem)
            return built_in(model)
        lengths = self.frame.metres(model.link_lengths)
        stroke = DEFAULT_STROKE * float(lengths.sum())
        low, high = -stroke, stroke
        if model.base_range is not None:
            low, high = (float(x) for x in self.frame.metres(model.base_range))
            if not low < high:
                problem = f"is {model.base_range}, expected the smaller value first"
                raise self.document.invalid(("manipulator", "base_range"), problem)
        try:
            return Manipulator(
                model.name,
                lengths,
                float(self.frame.metres(model.link_radius)),
                float(np.deg2rad(model.max_link_angle_deg)),
                float(np.deg2rad(model.max_joint_angle_deg)),
                (low, high),
                self._cables(model),
            )
        except InvalidInput as error:
            raise self.document.invalid(("manipulator",), str(error)) from None

    def _cables(self, model: schema.ManipulatorModel) -> CableLayout:
        count, shortest = len(model.link_lengths), min(model.link_lengths)
        hole_radius = DEFAULT_HOLE_RADIUS * model.link_radius
        half_gap = DEFAULT_HALF_GAP * shortest
        angles = paper_hole_angles(count)
        if (cables := model.cables) is not None:
            at = ("manipulator", "cables")
            hole_radius, half_gap = cables.hole_radius, cables.half_gap
            if not hole_radius < model.link_radius:
                problem = (
                    f"is {hole_radius:g}, expected below the body radius "
                    f"{model.link_radius:g}"
                )
                raise self.document.invalid((*at, "hole_radius"), problem)
            if not 2.0 * half_gap < shortest:
                problem = (
                    f"is {half_gap:g}, expected below half the shortest link "
                    f"{shortest:g}"
                )
                raise self.document.invalid((*at, "half_gap"), problem)
            if cables.hole_angles_deg is not None:
                if len(cables.hole_angles_deg) != count:
                    found = len(cables.hole_angles_deg)
                    problem = f"has {found} rows, expected {count}, one per link"
                    raise self.document.invalid((*at, "hole_angles_deg"), problem)
                angles = np.deg2rad(cables.hole_angles_deg)
        metres = self.frame.metres([hole_radius, half_gap])
        return CableLayout(float(metres[0]), float(metres[1]), angles)


@dataclass(frozen=True)
class PathBuilder:
    """Converts the tip path and refuses starts and spacings that make no sense."""

    document: YamlDocument
    frame: Frame
    arm: Manipulator

    def build(self, model: schema.TipPathModel) -> DesiredPath:
        """The desired path in the base frame.

        Raises:
            InvalidFile: If the arm cannot stand at the start, the path leaves the
                extent for which distances are proved, or would need too many rows.
        """
        start_joints: FloatArray | None = None
        if isinstance(model.start, schema.StartJointsModel):
            start_joints = self._start_joints(model.start.joints)
            start = self._tip(start_joints)
        else:
            start = self.frame.point(model.start)
            self._check_straight(start)
        points = self.frame.point(model.points)
        self._check_extent(points)
        path = DesiredPath(
            start,
            without_repeats(points, closed=model.closed),
            model.closed,
            0.010 if model.spacing is None else float(self.frame.metres(model.spacing)),
            Approach(model.approach),
            float(self.frame.metres(model.retreat)),
            Blocked(model.blocked),
            model.required_coverage,
            start_joints,
            Order(model.order),
        )
        self._check_rows(path)
        return path

    def _start_joints(self, model: schema.JointsModel) -> FloatArray:
        at = ("tip_path", "start", "joints")
        n, low_high = self.arm.n_links, self.arm.base_range
        x0 = float(self.frame.metres(model.x0))
        if not low_high[0] <= x0 <= low_high[1]:
            problem = f"is {self.frame.shown(x0)}, expected {self._rail()}"
            raise self.document.invalid((*at, "x0"), problem)
        angles = {"alpha_deg": model.alpha_deg, "theta_deg": model.theta_deg}
        limit = np.rad2deg(self.arm.max_joint_angle)
        for name, values in angles.items():
            if len(values) != n:
                problem = f"has {len(values)} values, expected {n}, one per joint"
                raise self.document.invalid((*at, name), problem)
            for i, value in enumerate(values):
                if not abs(value) <= limit:
                    problem = f"is {value:g} deg, the joint's limit is {limit:g} deg"
                    raise self.document.invalid((*at, name, i), problem)
        pairs = np.deg2rad([model.alpha_deg, model.theta_deg]).T
        return np.concatenate([[x0], pairs.reshape(-1)])

    def _tip(self, joints: FloatArray) -> FloatArray:
        alpha, theta = joints[None, 1::2], joints[None, 2::2]
        tip: FloatArray = joint_centres(self.arm, joints[:1], alpha, theta)[0, -1]
        return tip

    def _check_straight(self, start: FloatArray) -> None:
        """A start given by the tip alone stands for the straight arm."""
        at, advice = ("tip_path", "start"), "; give start as {joints: ...} instead"
        length, away = self.arm.total_length, float(np.hypot(start[1], start[2]))
        if not away < length:
            problem = (
                f"lies {self.frame.shown(away)} from the rail, the arm is "
                f"{self.frame.shown(length)} long"
            )
            raise self.document.invalid(at, problem)
        along = float(np.sqrt(length**2 - away**2))
        angles = {
            "link angle psi": (np.arctan2(away, along), self.arm.max_link_angle),
            "yaw alpha": (np.arctan2(start[1], along), self.arm.max_joint_angle),
            "pitch theta": (np.arcsin(-start[2] / length), self.arm.max_joint_angle),
        }
        for name, (angle, limit) in angles.items():
            if not abs(angle) <= limit + TOLERANCES.joint_limit:
                problem = (
                    f"needs a {name} of {np.rad2deg(abs(angle)):.4g} deg of the "
                    f"straight arm, the limit is {np.rad2deg(limit):.4g} deg{advice}"
                )
                raise self.document.invalid(at, problem)
        x0, (low, high) = float(start[0]) - along, self.arm.base_range
        if not low - TOLERANCES.base_limit <= x0 <= high + TOLERANCES.base_limit:
            problem = (
                f"puts the base of the straight arm at x0 = {self.frame.shown(x0)}, "
                f"expected {self._rail()}{advice}"
            )
            raise self.document.invalid(at, problem)

    def _rail(self) -> str:
        low, high = self.arm.base_range
        return f"{self.frame.shown(low)} to {self.frame.shown(high)}, the rail's range"

    def _check_extent(self, points: FloatArray) -> None:
        reach, limit = np.linalg.norm(points, axis=1), TOLERANCES.scene_extent
        if not (reach <= limit).all():
            worst = int(np.argmax(reach))
            problem = (
                f"lies {self.frame.shown(float(reach[worst]))} from the base, expected "
                f"at most {self.frame.shown(limit)}"
            )
            raise self.document.invalid(("tip_path", "points", worst), problem)

    def _check_rows(self, path: DesiredPath) -> None:
        approach = float(np.linalg.norm(path.points[0] - path.start))
        rows = (path.length + approach) / path.spacing
        if not rows <= MAX_ROWS:
            problem = (
                f"is {self.frame.shown(path.spacing)}, which cuts "
                f"{self.frame.shown(path.length + approach)} of path into more than "
                f"{MAX_ROWS} rows"
            )
            raise self.document.invalid(("tip_path", "spacing"), problem)
