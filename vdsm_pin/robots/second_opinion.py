"""Pinocchio and Coal about a robot: poses from the same URDF, distances of pairs."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Piece
from vdsm_pin.robots.hulls import coal_hull, is_solid
from vdsm_pin.robots.model import Robot
from vdsm_pin.verification.coal_bodies import CoalBody, turn_z_to

KEPT: Final = 8
"""Robots whose models are kept for their next motion."""


def pose_difference(robot: Robot, q: FloatArray) -> FloatArray:
    """How far Pinocchio's link poses are off the tree's at each row, shape (n_rows,).

    The largest difference of an entry of T_world_link, over all links; [m] or [-].

    Args:
        robot: Its URDF is read again, by Pinocchio.
        q: Shape (n_rows, n_columns); [rad], [m].

    Raises:
        VerificationFailed: If Pinocchio refuses the URDF or has no such link.
    """
    import pinocchio as pin

    model = _model(robot.text)
    data, values = model.createData(), robot.tree.values(q)
    poses, worst = robot.poses(q), np.zeros(len(q))
    numbers = {name: model.getFrameId(name, pin.BODY) for name in robot.frames}
    missing = [name for name, number in numbers.items() if number >= model.nframes]
    if missing:
        message = f"Pinocchio has no link {missing[0]!r}"
        raise VerificationFailed(message)
    for row in range(len(q)):
        full = _configuration(pin, model, robot, values[row])
        pin.framesForwardKinematics(model, data, full)
        for name, number in numbers.items():
            off = np.abs(data.oMf[number].homogeneous - poses[name][row]).max()
            worst[row] = max(worst[row], off)
    return worst


@lru_cache(maxsize=KEPT)
def _model(text: str) -> Any:
    """Pinocchio's model of a URDF.

    Raises:
        VerificationFailed: If Pinocchio refuses it.
    """
    import pinocchio as pin

    try:
        return pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        message = f"Pinocchio refuses the URDF: {error}"
        raise VerificationFailed(message) from None


def _configuration(pin: Any, model: Any, robot: Robot, values: FloatArray) -> Any:
    """Pinocchio's q, which has a cosine and a sine for a joint without limits."""
    full = pin.neutral(model)
    for joint, value in zip(robot.tree.joints, values, strict=True):
        if not model.existJointName(joint.name):
            continue
        number = model.getJointId(joint.name)
        at = model.idx_qs[number]
        if model.nqs[number] == 2:
            full[at], full[at + 1] = np.cos(value), np.sin(value)
        elif model.nqs[number] == 1:
            full[at] = value
    return full


@lru_cache(maxsize=KEPT)
def link_shapes(robot: Robot) -> tuple[tuple[CoalBody, ...] | None, ...]:
    """Coal's shapes of each body of a robot, in its link's frame."""
    return tuple(coal_parts(body.pieces) for body in robot.bodies)


def coal_parts(pieces: Sequence[Piece]) -> tuple[CoalBody, ...] | None:
    """Convex pieces of a link as Coal's shapes; None where Coal cannot take one."""
    import coal

    found = []
    for piece in pieces:
        if isinstance(piece, FlatCylinder):
            shape = coal.Cylinder(piece.radius, 2.0 * piece.half_length)
            pose = coal.Transform3s(turn_z_to(piece.axis), np.array(piece.centre))
        elif isinstance(piece, Hull) and len(piece.points) == 1:
            shape = coal.Sphere(piece.radius)
            pose = coal.Transform3s(np.eye(3), np.array(piece.points[0]))
        elif isinstance(piece, Hull) and is_solid(piece.points):
            shape = coal_hull(piece.points)
            pose = coal.Transform3s(np.eye(3), np.zeros(3))
        else:
            return None
        found.append(CoalBody(shape, pose))
    return tuple(found)


def placed(T_world_link: FloatArray, body: CoalBody) -> CoalBody:
    """A shape of a link where the link stands."""
    import coal

    link = coal.Transform3s(T_world_link[:3, :3].copy(), T_world_link[:3, 3].copy())
    return CoalBody(body.geometry, link * body.pose)
