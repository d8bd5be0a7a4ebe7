"""Joint limits of an arm's motion, between its rows too.

The angles and x0 are linear over an interval, and psi = arccos(cos theta cos alpha) is
quasi-convex below 90 deg, so that each is largest at an end (docs/certificate.md).
"""

from collections.abc import Iterator
from dataclasses import replace
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.paths import Path
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.extremes import (
    CHUNK,
    PARTS,
    Largest,
    cut,
    largest,
    pieces_of,
    range_checks,
)
from vdsm_pin.verification.records import Check, Verdict

RAIL: Final = "base on its rail"
RIGHT_ANGLE: Final = np.pi / 2.0
CHANGE: Final = "change of a joint angle between waypoints"


def _largest_change(path: Path) -> Largest:
    """Largest difference of a joint angle between two moments of an interval."""
    found, step = Largest(), CHUNK // PARTS
    for first in range(0, path.n_samples - 1, step):
        numbers = np.arange(first, min(first + step, path.n_samples - 1))
        ends = np.abs(np.diff(path.knots[first : numbers[-1] + 2, 1:], axis=0))
        found = found.larger(ends, numbers)
        if path.degree == 1:
            continue
        controls = path.pieces(numbers)[:, :, 1:]
        wide = np.ptp(controls, axis=1).max(axis=1) > found.seen
        if wide.any():
            fine = cut(controls[wide]).reshape(
                int(wide.sum()), PARTS, -1, ends.shape[1]
            )
            found = found.bounded(np.ptp(fine, axis=(1, 2)))
            edges = np.concatenate([fine[:, :, 0], fine[:, -1:, -1]], axis=1)
            found = found.larger(np.ptp(edges, axis=1), numbers[wide])
    return found


def _psi(joints: FloatArray) -> FloatArray:
    """Link angles; where alpha or theta is past 90 deg, one of 90 deg lies on the way.

    Beyond, psi falls again: 0 where both are 180 deg.
    """
    alpha, theta = joints[:, 1::2], joints[:, 2::2]
    found = link_angles(alpha, theta)
    if np.abs(joints[:, 1:]).max(initial=0.0) > RIGHT_ANGLE:
        nearer = (np.minimum(np.abs(one), RIGHT_ANGLE) for one in (alpha, theta))
        found = np.maximum(found, link_angles(*nearer))
    return found


def _angle_check(
    name: str, where: str, limit: float, count: int, found: Largest
) -> Check:
    most = limit + TOLERANCES.joint_limit
    verdict, worst = found.verdict(most), found.worst(most)
    return Check(name, verdict, count, worst, limit, "rad", where, found.moment)


def check_limits(problem: PlanningProblem, trajectory: Trajectory) -> tuple[Check, ...]:
    """The limits of the arm, and of the change between rows if that is limited.

    Args:
        problem: Names the arm and its limits.
        trajectory: What is judged.

    Returns:
        One row each. The limits hold at every instant between the rows as well.
    """
    checks, step = arm_limits(problem.manipulator, trajectory), problem.max_row_change
    if step is not None and trajectory.n_samples > 1:
        change = _largest_change(trajectory.path)
        name, where = CHANGE, f"joint {change.column // 2 + 1}"
        checks.append(_angle_check(name, where, step, trajectory.alpha.size, change))
    return tuple(checks)


def arm_limits(arm: Manipulator, trajectory: Trajectory) -> list[Check]:
    """A row each of the box of theta and alpha, of the cone of psi and of the rail."""
    path, count = trajectory.path, trajectory.alpha.size
    box, cone, checks = arm.max_joint_angle, arm.max_link_angle, []
    for name, symbol, limit, measure in (
        ("alpha in its box", "alpha", box, lambda q: np.abs(q[:, 1::2])),
        ("theta in its box", "theta", box, lambda q: np.abs(q[:, 2::2])),
        ("link angle psi in its cone", "psi", cone, _psi),
    ):
        found = largest(pieces_of(path), measure, limit + TOLERANCES.joint_limit)
        where = f"{symbol}{found.column + 1}"
        checks.append(_angle_check(name, where, limit, count, found))
    row = Check(RAIL, Verdict.UNDECIDED, trajectory.n_samples, nan, nan, "m")
    ends, slack = np.array([arm.base_range]), TOLERANCES.base_limit
    return [*checks, *range_checks(path, np.zeros(1, int), ends, slack, [row])]


def checks_of_others(scene: Scene) -> Iterator[Check]:
    """Rows of other arms and robots by themselves, over all of their own motions.

    Their moments are not those of the motion judged.
    """
    for one in scene.carriers:
        own = arm_limits(*one.itself.arm) if one.itself.arm else one.itself.checks()
        for row in own:
            yield replace(row, name=f"{one.robot}: {row.name}", moment=nan)
