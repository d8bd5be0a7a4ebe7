"""What is judged of a robot by itself: its poses by Pinocchio, limits of its joints.

The derivative of a piece is a polynomial; its control points bound rates between
waypoints, and it is cut where they do not decide.
"""

import xml.etree.ElementTree as ET
from functools import lru_cache
from math import nan
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.errors import VdsmError
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.bernstein import derivative
from vdsm_pin.proof.paths import Path
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.extremes import largest, range_checks
from vdsm_pin.verification.pinocchio_frames import PinocchioFrames, read_model
from vdsm_pin.verification.records import Check, Verdict

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


POSES: Final = "link poses by Pinocchio against the tree's"
LIMITS: Final = "joint {name!r} in its limits"
POSE_ERROR: Final = 1e-9
"""Where Pinocchio and the tree must agree; [m] or, of rotations, [-]."""

COMPARED: Final = 1000
"""Most waypoints at which poses are compared, spread evenly."""


def pose_check(robot: Robot, path: Path) -> Check:
    """How far Pinocchio's poses of links are off the tree's."""
    step = -(-len(path.knots) // COMPARED)
    rows = np.arange(0, len(path.knots), step)
    try:
        off = pose_difference(robot, path.knots[rows])
    except VdsmError as error:
        where = f"not done: {error}"
        return Check(POSES, Verdict.UNDECIDED, 0, nan, POSE_ERROR, "-", where)
    k = int(np.argmax(off))
    good = bool((off <= POSE_ERROR).all())
    verdict = Verdict.CERTIFIED if good else Verdict.REFUTED
    where = f"{len(robot.frames)} links at {len(rows)} of {len(path.knots)} waypoints"
    count, worst, when = len(rows) * len(robot.frames), float(off[k]), float(rows[k])
    return Check(POSES, verdict, count, worst, POSE_ERROR, "-", where, moment=when)


def checks_by_itself(robot: Robot, path: Path) -> list[Check]:
    """Its poses, and a row for each stated limit, of rates too.

    Limits have slack for the arithmetic of readers.
    """
    n, ends = len(path.knots), np.array([(j.lower, j.upper) for j in robot.joints])
    ends = ends.reshape(-1, 2)
    limited, rows = np.flatnonzero(np.isfinite(ends).all(axis=1)), []
    for joint in [robot.joints[k] for k in limited.tolist()]:
        name, unit, whose = LIMITS.format(name=joint.name), joint.unit, joint.whose
        rows.append(Check(name, Verdict.UNDECIDED, n, nan, nan, unit, whose))
    held = range_checks(path, limited, ends[limited], TOLERANCES.arithmetic, rows)
    return [pose_check(robot, path), *held, *rate_checks(robot.joints, path)]


def rate_checks(joints: tuple[RobotJoint, ...], path: Path) -> list[Check]:
    """A row for each stated limit; none where the motion has no times.

    Straight lines have no acceleration but at their corners, where it is undefined: a
    limit of it is undecided.
    """
    if path.times is None or len(path.knots) == 1:
        return []
    controls, step = path.controls, np.diff(path.times)[:, None, None]
    checks = []
    for order, word in enumerate(("velocity", "acceleration"), start=1):
        limits = np.array([getattr(joint, word) for joint in joints])
        if controls.shape[1] > 1:
            with np.errstate(over="ignore"):  # beyond any limit
                controls = derivative(controls) / step
        for k in np.flatnonzero(np.isfinite(limits)):
            joint = joints[k]
            name = f"joint {joint.name!r} in its {word} limit"
            unit, limit = (
                joint.unit + ("/s" if order == 1 else "/s^2"),
                float(limits[k]),
            )
            verdict, worst, moment = Verdict.UNDECIDED, nan, nan
            where = "straight lines change their rates at once"
            if order <= path.degree:
                most = limit * (1.0 + TOLERANCES.arithmetic)
                found = largest([(0, controls[:, :, k, None])], np.abs, most)
                verdict, worst = found.verdict(most), found.worst(most)
                where, moment = joint.whose, found.moment
            count = path.n_intervals
            row = Check(name, verdict, count, worst, limit, unit, where, moment=moment)
            checks.append(row)
    return checks
