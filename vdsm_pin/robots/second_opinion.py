"""Pinocchio and Coal about a robot: poses from the same URDF, distances of pairs."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final

import numpy as np

from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Piece
from vdsm_pin.robots.hulls import coal_hull
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.srdf import Base
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

    model = _model(robot.text, robot.base)
    data, values = model.createData(), robot.tree.values(q)
    ours = robot.poses(q)[:, [*robot.frames.values()]]
    theirs = np.zeros_like(ours)
    numbers = {name: model.getFrameId(name, pin.BODY) for name in robot.frames}
    missing = [name for name, number in numbers.items() if number >= model.nframes]
    if missing:
        message = f"Pinocchio has no link {missing[0]!r}"
        raise VerificationFailed(message)
    for row in range(len(q)):
        full = _configuration(pin, model, robot, values[row])
        pin.framesForwardKinematics(model, data, full)
        theirs[row] = [data.oMf[number].homogeneous for number in numbers.values()]
    return np.asarray(np.abs(theirs - ours).max(axis=(1, 2, 3)))


@lru_cache(maxsize=KEPT)
def _model(text: str, base: Base | None) -> Any:
    """Pinocchio's model of a URDF on its base.

    Raises:
        VerificationFailed: If Pinocchio refuses it.
    """
    import pinocchio as pin

    text = _bare(text)
    free = {"planar": pin.JointModelPlanar, "floating": pin.JointModelFreeFlyer}
    try:
        if base is None:
            return pin.buildModelFromXML(text)
        return pin.buildModelFromXML(text, free[base.kind](), base.name)
    except (ValueError, RuntimeError) as error:
        message = f"Pinocchio refuses the URDF: {error}"
        raise VerificationFailed(message) from None


def _bare(text: str) -> str:
    """A URDF without what places no link: solids, masses and limits.

    Pinocchio's reader writes about shapes that it does not know to the terminal, and
    refuses joints without limits.
    """
    document = ET.fromstring(text)
    for link in document.findall("link"):
        for element in list(link):
            link.remove(element)
    for joint in document.findall("joint"):
        for limit in joint.findall("limit"):
            joint.remove(limit)
        if joint.get("type") in ("revolute", "prismatic"):
            ET.SubElement(
                joint, "limit", lower="0", upper="0", effort="0", velocity="0"
            )
    return ET.tostring(document, encoding="unicode")


def _configuration(pin: Any, model: Any, robot: Robot, values: FloatArray) -> Any:
    """Pinocchio's q of the values of the tree's joints.

    It has a cosine and a sine for an angle without limits, a quaternion for a frame
    that floats.
    """
    names = [joint.name for joint in robot.tree.joints]
    value = dict(zip(names, values.tolist(), strict=True))
    full = pin.neutral(model)
    for number in range(1, model.njoints):
        name, at, count = model.names[number], model.idx_qs[number], model.nqs[number]
        if count == 1:
            own = [value[name]]
        elif count == 2:
            own = [np.cos(value[name]), np.sin(value[name])]
        else:
            own = [value[f"{name}/x"], value[f"{name}/y"]]
            if count == 4:
                theta = value[f"{name}/theta"]
                own += [np.cos(theta), np.sin(theta)]
            else:
                turns = (value[f"{name}/{part}"] for part in ("roll", "pitch", "yaw"))
                turn = pin.Quaternion(rotation_from_rpy(np.array([*turns])))
                own += [value[f"{name}/z"], *turn.coeffs()]
        full[at : at + count] = own
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
        elif isinstance(piece, Hull) and len(piece.points) == 2:
            way = piece.points[1] - piece.points[0]
            length = float(np.linalg.norm(way))
            if not length > 0.0:
                return None
            shape = coal.Capsule(piece.radius, length)
            middle = piece.points.mean(axis=0)
            pose = coal.Transform3s(turn_z_to(way / length), middle)
        elif isinstance(piece, Hull) and (shape := coal_hull(piece.points)):
            pose = coal.Transform3s(np.eye(3), np.zeros(3))
        else:
            return None
        found.append(CoalBody(shape, pose))
    return tuple(found)
