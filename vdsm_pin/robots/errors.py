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
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.verification.assembly import obstacle_growth


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
