"""The tip path of a problem file to a `DesiredPath` in the base frame."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io import problem_schema as schema
from vdsm_pin.io.frames import Frame, radians
from vdsm_pin.io.obstacle_builder import without_repeats
from vdsm_pin.io.yaml_reader import YamlDocument
from vdsm_pin.kinematics import joint_centres, link_angles
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.problem import Approach, Blocked, DesiredPath, Order
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import MAX_ROWS

DEFAULT_SPACING: Final = 0.010
"""The paper's spacing of waypoints; [m]."""


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
            self._spacing(model.spacing),
            Approach(model.approach),
            float(self.frame.metres(model.retreat)),
            Blocked(model.blocked),
            model.required_coverage,
            start_joints,
            Order(model.order),
        )
        self._check_rows(path)
        return path

    def _spacing(self, spacing: float | None) -> float:
        return DEFAULT_SPACING if spacing is None else float(self.frame.metres(spacing))

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
                if not abs(value) <= limit + np.rad2deg(TOLERANCES.joint_limit):
                    problem = f"is {value:g} deg, the joint's limit is {limit:g} deg"
                    raise self.document.invalid((*at, name, i), problem)
        alpha, theta = radians([model.alpha_deg, model.theta_deg])
        psi = link_angles(alpha, theta)
        worst = int(np.argmax(psi))
        if not psi[worst] <= self.arm.max_link_angle + TOLERANCES.joint_limit:
            problem = (
                f"has a link angle psi of {np.rad2deg(psi[worst]):.4g} deg at joint "
                f"{worst + 1}, the limit is {np.rad2deg(self.arm.max_link_angle):.4g}"
            )
            raise self.document.invalid(at, problem)
        return np.concatenate([[x0], np.column_stack([alpha, theta]).reshape(-1)])

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
