"""Velocity and acceleration limits of a robot's joints, where times are stated too.

The derivative of a piece is a polynomial; its control points bound it between
waypoints, and it is cut where they do not decide.
"""

from math import nan
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bernstein import derivative, part
from vdsm_pin.proof.paths import Path
from vdsm_pin.robots.model import RobotJoint
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.records import Check, Verdict

CUTS: Final = 20
"""How often a piece is halved that its control points do not decide."""


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
            verdict, value, moment = largest_of(controls[:, :, k], float(limits[k]))
            count, limit = path.n_intervals, float(limits[k])
            check = Check(name, verdict, count, value, limit, unit, joint.whose, moment)
            checks.append(check)
    return checks


def largest_of(controls: FloatArray, limit: float) -> tuple[Verdict, float, float]:
    """Whether polynomials (m, n) keep within a limit, the value that decides, when.

    Args:
        controls: Their control points.
        limit: Of their magnitudes.

    Returns:
        Verdict, the largest magnitude seen or proved, and its moment, NaN where none.
    """
    most = limit * (1.0 + TOLERANCES.arithmetic)
    number = np.arange(len(controls))
    start, width, bound = np.zeros(len(controls)), 1.0, 0.0
    for _ in range(CUTS):
        ends = np.abs(controls[:, [0, -1]])
        k, side = np.unravel_index(int(np.argmax(ends)), ends.shape)
        if not ends[k, side] <= most:
            moment = float(number[k] + start[k] + side * width)
            return Verdict.REFUTED, float(ends[k, side]), moment
        largest = np.abs(controls).max(axis=1)
        open_ = ~(largest <= most)
        bound = max(bound, float(largest[~open_].max(initial=0.0)))
        if not open_.any() or controls.shape[1] == 1:
            return Verdict.CERTIFIED, bound, nan
        width *= 0.5
        halves = np.repeat(controls[open_], 2, axis=0)[:, :, None]
        first = np.tile([0.0, 0.5], int(open_.sum()))
        controls = part(halves, first, first + 0.5)[:, :, 0]
        number = np.repeat(number[open_], 2)
        start = np.repeat(start[open_], 2) + width * np.tile(
            [0.0, 1.0], len(first) // 2
        )
    return Verdict.UNDECIDED, float(np.abs(controls).max()), float(number[0] + start[0])
