"""Velocity and acceleration limits of a robot's joints, where times are stated too.

The derivative of a piece is a polynomial; its control points bound it between
waypoints, and it is cut where they do not decide.
"""

from math import nan

import numpy as np

from vdsm_pin.geometry.bernstein import derivative
from vdsm_pin.proof.paths import Path
from vdsm_pin.robots.model import RobotJoint
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.extremes import largest
from vdsm_pin.verification.records import Check, Verdict


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
