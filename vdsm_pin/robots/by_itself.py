"""What is judged of a robot by itself: its poses by Pinocchio, limits of its joints.

The derivative of a piece is a polynomial; its control points bound rates between
waypoints, and it is cut where they do not decide.
"""

from math import nan
from typing import Final

import numpy as np

from vdsm_pin.errors import VdsmError
from vdsm_pin.geometry.bernstein import derivative
from vdsm_pin.proof.paths import Path
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.robots.second_opinion import pose_difference
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.extremes import largest, range_check
from vdsm_pin.verification.records import Check, Verdict

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
    count, told = len(rows) * len(robot.frames), (POSE_ERROR, "-", where)
    return Check(POSES, verdict, count, float(off[k]), *told, float(rows[k]))


def checks_by_itself(robot: Robot, path: Path) -> list[Check]:
    """Its poses, and a row for each stated limit, of rates too.

    Limits have slack for the arithmetic of readers.
    """
    slack, held = TOLERANCES.arithmetic, []
    for k, joint in enumerate(robot.joints):
        ends = joint.lower, joint.upper
        if np.isfinite(ends).all():
            name, n = LIMITS.format(name=joint.name), len(path.knots)
            row = Check(name, Verdict.UNDECIDED, n, nan, nan, joint.unit, joint.whose)
            held.append(range_check(path, k, ends, slack, row))
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
            unit = joint.unit + ("/s" if order == 1 else "/s^2")
            if order > path.degree:
                where = "straight lines change their rates at once"
                none = Verdict.UNDECIDED, path.n_intervals, nan
                checks.append(Check(name, *none, float(limits[k]), unit, where))
                continue
            limit, each = float(limits[k]), [(0, controls[:, :, k, None])]
            most = limit * (1.0 + TOLERANCES.arithmetic)
            found = largest(each, np.abs, most)
            told = found.verdict(most), path.n_intervals, found.worst(most), limit
            checks.append(Check(name, *told, unit, joint.whose, found.moment))
    return checks
