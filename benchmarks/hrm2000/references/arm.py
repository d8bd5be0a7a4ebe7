"""What all references share: the arm in Pinocchio, its limits, the rows of the path."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import coal
import numpy as np
import pinocchio as pin

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_bodies import coal_bodies
from vdsm_pin.verification.coal_hulls import CoalBody, coal_parts
from vdsm_pin.verification.pinocchio_arm import PinocchioArm

BETWEEN = 5e-4
"""Kept beyond the required clearance for what happens between two rows; [m]."""
PUSH_WITHIN = 0.04
"""Clearance below which a link is pushed off; [m]."""
EASE = 0.97
"""Part of the largest link angle from which a joint is pushed back; [-]."""


@dataclass(frozen=True)
class Wanted:
    """Where the tip shall be, row by row.

    Args:
        tips: Shape (r, 3); [m].
        stations: Arc length along the desired path, shape (r,); [m].
        drawn: Whether a row is on the path, shape (r,).
    """

    tips: FloatArray
    stations: FloatArray
    drawn: BoolArray


def wanted(problem: PlanningProblem) -> Wanted:
    """The straight approach, then the path."""
    rows = path_rows(problem.path)
    start, first = problem.path.start, rows.tips[0]
    count = int(np.ceil(np.linalg.norm(first - start) / problem.path.spacing))
    share = np.arange(count)[:, None] / max(count, 1)
    off = np.zeros(count)
    return Wanted(
        np.vstack([start + share * (first - start), rows.tips]),
        np.concatenate([off + rows.stations[0], rows.stations]),
        np.concatenate([off > 0, np.ones(len(rows.tips), dtype=np.bool_)]),
    )


def placement(body: CoalBody) -> pin.SE3:
    """Where a body of Coal is in its frame."""
    turn, shift = body.pose.getRotation(), body.pose.getTranslation()
    return pin.SE3(np.array(turn), np.array(shift))


class Arm:
    """The arm at joint values q = (x0, alpha_1, theta_1, ...)."""

    def __init__(
        self, problem: PlanningProblem, robot: PinocchioArm, clearance: LinkClearance
    ) -> None:
        self.problem, self.robot, self.clearance = problem, robot, clearance
        self.data, arm = robot.model.createData(), problem.manipulator
        links = coal_parts([body.piece for body in arm.convex_bodies[: arm.n_links]])
        assert links is not None  # Coal takes capsules
        self.links = links
        self.p_link_tip = np.array([arm.link_lengths[-1], 0.0, 0.0])
        self.n, self.nq = arm.n_links, 1 + 2 * arm.n_links
        self.cone, box = arm.max_link_angle, arm.max_joint_angle
        self.low = np.concatenate([[arm.base_range[0]], np.full(2 * self.n, -box)])
        self.high = np.concatenate([[arm.base_range[1]], np.full(2 * self.n, box)])
        self.required = problem.required_clearance + BETWEEN

    @cached_property
    def bodies(self) -> list[object]:
        """Every obstacle as Coal sees it."""
        return [b for o in self.problem.scene.obstacles for b in coal_bodies(o)]

    def start(self) -> FloatArray:
        """Joint values at the start."""
        path = self.problem.path
        if path.start_joints is not None:
            return np.array(path.start_joints)
        length, (_, y, z) = self.problem.manipulator.total_length, path.start
        q = np.zeros(self.nq)
        q[1], q[2] = (
            np.arctan2(y, np.sqrt(length**2 - y**2 - z**2)),
            -np.arcsin(z / length),
        )
        q[0] = path.start[0] - np.sqrt(length**2 - y**2 - z**2)
        return q

    def centres(self, q: FloatArray) -> FloatArray:
        """Joint centres of rows of joint values, shape (r, N + 1, 3); [m]."""
        rows = np.atleast_2d(q)
        return joint_centres(
            self.problem.manipulator, rows[:, 0], rows[:, 1::2], rows[:, 2::2]
        )

    def psi(self, q: FloatArray) -> FloatArray:
        """Link angles, shape (N,); [rad]."""
        cosine = np.cos(q[1::2]) * np.cos(q[2::2])
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    def bounded(self, q: FloatArray) -> FloatArray:
        """The nearest joint values within box and rail, then within the cone."""
        q = np.clip(q, self.low, self.high)
        over = np.maximum(1.0, self.psi(q) / (self.cone * (1.0 - 1e-9)))
        q[1::2] /= over
        q[2::2] /= over
        return q

    def valid(self, q: FloatArray) -> bool:
        """Whether limits and clearance hold; every reference asks this."""
        inside = (q >= self.low).all() and (q <= self.high).all()
        if not inside or not (self.psi(q) <= self.cone).all():
            return False
        return bool(self.clearance(self.centres(q)).min() >= self.required)

    def tip(self, q: FloatArray, goal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Way of the tip to a goal and its Jacobian in the base frame."""
        pin.computeJointJacobians(self.robot.model, self.data, q)
        last = self.robot.model.njoints - 1
        return self._point(last, self.p_link_tip, goal)

    def _point(
        self, joint: int, local: FloatArray, goal: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        place = self.data.oMi[joint]
        arm = place.rotation @ local
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        full = pin.getJointJacobian(self.robot.model, self.data, joint, frame)
        return goal - (place.translation + arm), full[:3] - pin.skew(arm) @ full[3:]

    def push(self, q: FloatArray) -> FloatArray:
        """Gradient step off close obstacles and off the edge of the cone."""
        step = np.zeros(self.nq)
        over = np.maximum(0.0, self.psi(q) - EASE * self.cone) / self.cone
        step[1::2] -= over * q[1::2]
        step[2::2] -= over * q[2::2]
        room = self.clearance(self.centres(q))[0]
        request = coal.DistanceRequest()
        for link in np.flatnonzero(room < PUSH_WITHIN):
            joint = 3 + 2 * int(link)  # universe, rail, then yaw and pitch of each link
            pose = self.data.oMi[joint] * placement(self.links[link])
            place = coal.Transform3s(pose.rotation, pose.translation)
            for body in self.bodies:
                result = coal.DistanceResult()
                gap = coal.distance(
                    self.links[link].geometry, place, body.geometry, body.pose,
                    request, result,
                )  # fmt: skip
                if gap < PUSH_WITHIN:
                    point = result.getNearestPoint1()
                    near = self.data.oMi[joint].actInv(point)
                    _, turn = self._point(joint, near, point)
                    step += (PUSH_WITHIN - gap) * (turn.T @ -result.normal)
        return step


class Rows:
    """Rows of a motion as they come."""

    def __init__(self, q: FloatArray, station: float) -> None:
        self.joints, self.stations, self.drawn = [q], [station], [False]

    def add(self, q: FloatArray, station: float, drawn: bool) -> None:
        """One more row.

        Raises:
            NoPlanFound: If a joint turns too far.
        """
        turn = float(np.abs(q - self.joints[-1])[1:].max())
        if not turn <= TOLERANCES.row_change:
            message = f"a joint turns by {np.rad2deg(turn):.2f} deg in one row"
            raise NoPlanFound(message)
        self.joints.append(q)
        self.stations.append(station)
        self.drawn.append(drawn)

    def go(self, q: FloatArray, station: float) -> None:
        """Straight in joint space, off the path, in rows close enough."""
        turn = float(np.abs(q - self.joints[-1]).max())
        count = max(2, int(np.ceil(turn / TOLERANCES.planned_step)))
        begin = self.joints[-1]
        for k in range(1, count + 1):
            self.add(begin + k / count * (q - begin), station, False)

    def trajectory(self) -> Trajectory:
        """All of it."""
        joints = np.array(self.joints)
        return Trajectory(
            np.array(self.drawn), np.array(self.stations), joints[:, 0],
            joints[:, 1::2], joints[:, 2::2],
        )  # fmt: skip


Reach: TypeAlias = Callable[[Arm, FloatArray, FloatArray], FloatArray | None]
"""(arm, joint values before, tip) to joint values, or None."""


def along(arm: Arm, reach: Reach, goal: Wanted | None = None) -> Trajectory:
    """Row after row along the desired path, or any way of the tip.

    Raises:
        NoPlanFound: Where a row is not reached, or is too far from the one before.
    """
    goal = goal or wanted(arm.problem)
    rows = Rows(arm.start(), goal.stations[0])
    for tip, station, drawn in zip(goal.tips, goal.stations, goal.drawn, strict=True):
        q = reach(arm, rows.joints[-1], tip)
        if q is None:
            message = f"no valid row at {station:.3f} m along the path"
            raise NoPlanFound(message)
        rows.add(q, station, bool(drawn))
    return rows.trajectory()
