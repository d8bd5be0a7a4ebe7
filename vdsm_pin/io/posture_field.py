"""Where an arm stands in a problem file, its start and its goal: to a `Posture`."""

from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np
from pydantic import Discriminator, Field, Tag

from vdsm_pin.arm.kinematics import joint_centres, link_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.frames import Builder, radians
from vdsm_pin.io.schema_types import FileModel, Number, Vector
from vdsm_pin.io.yaml_reader import Location
from vdsm_pin.problem.planning_problem import Posture
from vdsm_pin.tolerances import TOLERANCES


class JointsModel(FileModel):
    """Joint values of the whole arm."""

    x0: Number = Field(description="Base position on the rail [length_unit].")
    alpha_deg: list[Number] = Field(description="Yaw of joints 1..N [deg].")
    theta_deg: list[Number] = Field(description="Pitch of joints 1..N [deg].")


class StartJointsModel(FileModel):
    """The start given by its joint values."""

    joints: JointsModel = Field(description="Joint values at the start.")


Start: TypeAlias = Annotated[
    Annotated[Vector, Tag("point")] | Annotated[StartJointsModel, Tag("joint values")],
    Discriminator(lambda at: "point" if isinstance(at, list) else "joint values"),
]


class GoalModel(FileModel):
    """Where a motion without tip path ends, one of the two."""

    tip: Vector | None = Field(
        default=None, description="Where the tip is at the end [length_unit]."
    )
    joints: JointsModel | None = Field(
        default=None, description="Joint values at the end."
    )


@dataclass(frozen=True)
class PostureBuilder(Builder):
    """Converts where the arm begins and ends, and refuses where it cannot stand."""

    arm: Manipulator

    def start(self, model: list[float] | StartJointsModel, at: Location) -> Posture:
        """Where a motion begins: the tip of the straight arm, or joint values.

        Raises:
            InvalidFile: If the arm cannot stand there.
        """
        if isinstance(model, StartJointsModel):
            return self._posture(model.joints, (*at, "joints"))
        tip = self.frame.point(model)
        self._check_straight(tip, at)
        return Posture(tip)

    def goal(self, model: GoalModel, at: Location) -> Posture:
        """Where a motion ends: the tip, or joint values.

        Raises:
            InvalidFile: If both or neither are given, or the arm cannot stand there.
        """
        if (model.tip is None) == (model.joints is None):
            count = "both" if model.joints else "neither"
            fault = f"has {count} of tip and joints, expected one of them"
            raise self.invalid(at, fault)
        if model.joints is not None:
            return self._posture(model.joints, (*at, "joints"))
        tip = self.frame.point(model.tip)
        self._check_reach(tip, (*at, "tip"))
        return Posture(tip)

    def _posture(self, model: JointsModel, at: Location) -> Posture:
        joints = self._joints(model, at)
        return Posture(self._tip(joints), joints)

    def _joints(self, model: JointsModel, at: Location) -> FloatArray:
        n, x0 = self.arm.n_links, float(self.frame.metres(model.x0))
        if not self._on_rail(x0):
            fault = f"is {self.frame.shown(x0)}, expected {self._rail()}"
            raise self.invalid((*at, "x0"), fault)
        angles = {"alpha_deg": model.alpha_deg, "theta_deg": model.theta_deg}
        limit = np.rad2deg(self.arm.max_joint_angle)
        for name, values in angles.items():
            self.check_count((*at, name), values, n, "values", "joint")
            for i, value in enumerate(values):
                if not abs(value) <= limit + np.rad2deg(TOLERANCES.joint_limit):
                    fault = f"is {value:g}°, the joint's limit is {limit:g}°"
                    raise self.invalid((*at, name, i), fault)
        alpha, theta = radians([model.alpha_deg, model.theta_deg])
        psi = link_angles(alpha, theta)
        worst = int(np.argmax(psi))
        if not psi[worst] <= self.arm.max_link_angle + TOLERANCES.joint_limit:
            fault = (
                f"has a link angle psi of {np.rad2deg(psi[worst]):.4g}° at joint "
                f"{worst + 1}, the limit is {np.rad2deg(self.arm.max_link_angle):.4g}°"
            )
            raise self.invalid(at, fault)
        return np.concatenate([[x0], np.column_stack([alpha, theta]).reshape(-1)])

    def _tip(self, joints: FloatArray) -> FloatArray:
        alpha, theta = joints[None, 1::2], joints[None, 2::2]
        tip: FloatArray = joint_centres(self.arm, joints[:1], alpha, theta)[0, -1]
        return tip

    def _check_reach(self, tip: FloatArray, at: Location) -> None:
        length, away = self.arm.total_length, float(np.hypot(tip[1], tip[2]))
        if not away < length:
            fault = (
                f"lies {self.frame.shown(away)} from the rail, the arm is "
                f"{self.frame.shown(length)} long"
            )
            raise self.invalid(at, fault)

    def _check_straight(self, start: FloatArray, at: Location) -> None:
        """A start given by the tip alone stands for the straight arm."""
        self._check_reach(start, at)
        advice = "; give start as {joints: ...} instead"
        length, away = self.arm.total_length, float(np.hypot(start[1], start[2]))
        along = float(np.sqrt(length**2 - away**2))
        angles = {
            "link angle psi": (np.arctan2(away, along), self.arm.max_link_angle),
            "yaw alpha": (np.arctan2(start[1], along), self.arm.max_joint_angle),
            "pitch theta": (np.arcsin(start[2] / length), self.arm.max_joint_angle),
        }
        for name, (angle, limit) in angles.items():
            if not abs(angle) <= limit + TOLERANCES.joint_limit:
                fault = (
                    f"needs a {name} of {np.rad2deg(abs(angle)):.4g}° of the "
                    f"straight arm, the limit is {np.rad2deg(limit):.4g}°{advice}"
                )
                raise self.invalid(at, fault)
        x0 = float(start[0]) - along
        if not self._on_rail(x0):
            fault = (
                f"puts the base of the straight arm at x0 = {self.frame.shown(x0)}, "
                f"expected {self._rail()}{advice}"
            )
            raise self.invalid(at, fault)

    def _on_rail(self, x0: float) -> bool:
        low, high = self.arm.base_range
        return low - TOLERANCES.base_limit <= x0 <= high + TOLERANCES.base_limit

    def _rail(self) -> str:
        low, high = self.arm.base_range
        return f"{self.frame.shown(low)} to {self.frame.shown(high)}, the rail's range"
