"""Pinocchio about a robot: poses from the same URDF."""

import xml.etree.ElementTree as ET
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.robots.model import Robot
from vdsm_pin.verification.pinocchio_frames import PinocchioFrames, read_model

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
    known, ours = _known(robot), robot.poses(q)[:, [*robot.frames.values()], :3]
    theirs = known.links.poses(known.configurations(robot.tree.values(q)))
    return np.asarray(np.abs(theirs - ours).max(axis=(1, 2, 3)))


class _Known(NamedTuple):
    """A robot as Pinocchio has it.

    Args:
        links: The frames of its links.
        neutral: Its q of joints at 0.
        joints: Where each joint's part of q starts, and the tree's joints that it is:
            one, or those of a joint that is planar or floats.
    """

    links: PinocchioFrames
    neutral: FloatArray
    joints: list[tuple[int, int, list[int]]]

    def configurations(self, values: FloatArray) -> FloatArray:
        """Pinocchio's q of values of the tree's joints, a row each.

        It has a cosine and a sine for an angle without limits, a quaternion for a frame
        that floats.
        """
        import pinocchio as pin

        full = np.tile(self.neutral, (len(values), 1))
        for at, count, joints in self.joints:
            own = values[:, joints]
            if count == 1:
                full[:, at] = own[:, 0]
                continue
            if count in (2, 4):
                shifts, angle = own[:, :-1], own[:, -1]
                own = np.column_stack([shifts, np.cos(angle), np.sin(angle)])
            else:
                turns = [pin.Quaternion(rotation_from_rpy(row)) for row in own[:, 3:]]
                own = np.column_stack([own[:, :3], [one.coeffs() for one in turns]])
            full[:, at : at + count] = own
        return full


@lru_cache(maxsize=KEPT)
def _known(robot: Robot) -> _Known:
    """A robot as Pinocchio has it.

    Raises:
        VerificationFailed: If Pinocchio refuses the URDF or has no such link.
    """
    import pinocchio as pin

    free = {"planar": pin.JointModelPlanar, "floating": pin.JointModelFreeFlyer}
    base = robot.base
    root = () if base is None else (free[base.kind](), base.name)
    model = read_model(_bare(robot.text), *root)
    place = {joint.name: k for k, joint in enumerate(robot.tree.joints)}
    parts = {
        4: ("/x", "/y", "/theta"),
        7: ("/x", "/y", "/z", "/roll", "/pitch", "/yaw"),
    }
    joints = []
    for number in range(1, model.njoints):
        name, at, count = model.names[number], model.idx_qs[number], model.nqs[number]
        own = [place[name + part] for part in parts.get(count, ("",))]
        joints.append((at, count, own))
    links = PinocchioFrames.of(model, robot.frames)
    return _Known(links, np.array(pin.neutral(model)), joints)


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
