"""Damped least squares on Pinocchio, pushed off the obstacles by Coal's distances."""

import coal
import numpy as np
import pinocchio as pin

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.robot_model import RobotModel
from vdsm_pin.verification.coal_bodies import coal_bodies

DAMPING = 1e-6
CLOSE_ENOUGH = 1e-4  # m
MOST_STEPS = 20
PUSH_WITHIN = 0.05  # m


def follow(robot: RobotModel, problem: PlanningProblem, tips: FloatArray) -> int:
    """Follow the tip positions from the straight arm.

    Returns:
        Number of positions reached; clearance is sought, not assured.
    """
    bodies = [b for o in problem.scene.obstacles for b in coal_bodies(o)]
    q, reached = pin.neutral(robot.model), 0
    for tip in tips:
        for _ in range(MOST_STEPS):
            error, turn = _tip_error(robot, q, tip)
            if np.linalg.norm(error) < CLOSE_ENOUGH:
                reached += 1
                break
            square = turn @ turn.T + DAMPING * np.eye(3)
            push = _push(robot, bodies, q)
            rest = push - turn.T @ np.linalg.solve(square, turn @ push)
            q = q + turn.T @ np.linalg.solve(square, error) + rest
    return reached


def _tip_error(
    robot: RobotModel, q: FloatArray, tip: FloatArray
) -> tuple[FloatArray, FloatArray]:
    model, data = robot.model, robot.data
    pin.computeJointJacobians(model, data, q)
    return _point(robot, model.njoints - 1, robot.p_link_tip, tip)


def _point(
    robot: RobotModel, joint: int, local: FloatArray, goal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Way to the goal and the point's Jacobian in the base frame."""
    place = robot.data.oMi[joint]
    arm = place.rotation @ local
    full = pin.getJointJacobian(
        robot.model, robot.data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    return goal - (place.translation + arm), full[:3] - pin.skew(arm) @ full[3:]


def _push(robot: RobotModel, bodies: list[object], q: FloatArray) -> FloatArray:
    """Gradient step of the clearances below `PUSH_WITHIN`."""
    step = np.zeros(robot.model.nv)
    request = coal.DistanceRequest()
    for link, (capsule, local) in enumerate(
        zip(robot.capsules, robot.T_link_capsule, strict=True)
    ):
        joint = 3 + 2 * link  # universe, rail, then yaw and pitch of each link
        pose = robot.data.oMi[joint] * pin.SE3(local)
        place = coal.Transform3s(pose.rotation, pose.translation)
        for body in bodies:
            result = coal.DistanceResult()
            gap = coal.distance(
                capsule, place, body.geometry, body.pose, request, result
            )
            if gap < PUSH_WITHIN:
                near = robot.data.oMi[joint].actInv(result.getNearestPoint1())
                _, turn = _point(robot, joint, near, np.zeros(3))
                step += (PUSH_WITHIN - gap) * (turn.T @ -result.normal)
    return 0.5 * step
