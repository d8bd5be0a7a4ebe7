"""How far a robot's joints, its base and the obstacles may be off, for the proof.

The first joint of a robot's tree is fixed and carries the root link: errors of the base
are errors of its placement, so that links on it are moved too.
"""

from collections.abc import Sequence

import numpy as np

from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.error_box import ErrorBox as ProofBox
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.verification.moving import joined_tree
from vdsm_pin.verification.task import obstacle_growth

BASE = 0
"""Number of the joint between world and root link."""


def check_errors(robot: Robot, scene: Scene, errors: ErrorBox) -> None:
    """Refuse errors of what there is not.

    Raises:
        UnknownName: If they name a joint that does not move, or no obstacle.
        InvalidInput: If they count joints, turn one that slides or the reverse, or turn
            a half-space.
    """
    if errors.joints:
        message = "joint errors of a robot are one number, or by name: JOINT=DEG"
        raise InvalidInput(message)
    joints = {joint.name: joint for joint in robot.joints}
    for one in errors.named:
        if one.name not in joints:
            raise UnknownName(kind="moving joint", name=one.name, known=tuple(joints))
        wrong = one.shift if joints[one.name].turns else one.turn
        if wrong:
            turns = joints[one.name].turns
            way, unit = ("turns", "degrees") if turns else ("slides", "millimetres")
            message = f"joint {one.name!r} {way}: expected its error in {unit}"
            raise InvalidInput(message)
    for obstacle in errors.obstacles:
        if obstacle.name not in scene.names:
            raise UnknownName(kind="obstacle", name=obstacle.name, known=scene.names)
    obstacle_growth(scene.obstacles, errors)


def joint_errors(joints: Sequence[RobotJoint], errors: ErrorBox) -> FloatArray:
    """Largest error of each joint that a trajectory moves, (n_joints,); [rad], [m]."""
    plain = [errors.joint if joint.turns else errors.slide for joint in joints]
    largest = dict(zip((joint.name for joint in joints), plain, strict=True))
    for one in errors.named:  # of one that turns the shift is 0, and the reverse
        largest[one.name] = max(largest[one.name], one.turn, one.shift)
    return np.array([*largest.values()])


def proof_box(robot: Robot, scene: Scene, errors: ErrorBox) -> ProofBox | None:
    """The same for the proof; None for no errors.

    A joint that mimics another one errs by as much as its ratio makes of it.
    """
    if errors == ErrorBox():
        return None
    of_columns = joint_errors(robot.joints, errors)
    n_joints = len(joined_tree(robot.tree, scene).joints)
    joints, shifts, tilts = np.zeros((3, n_joints))
    for k, joint in enumerate(robot.tree.joints):
        if joint.column is not None:
            joints[k] = abs(joint.ratio) * of_columns[joint.column]
    shifts[BASE], tilts[BASE] = errors.base, errors.base_turn
    of_links = [0.0] * len(robot.bodies)
    surfaces = np.array([*of_links, *obstacle_growth(scene.obstacles, errors)])
    return ProofBox(joints, shifts, tilts, surfaces)
