"""Joint limits of a motion: extremes over its intervals, not at its rows only.

The angles and x0 are linear over an interval, and psi = arccos(cos theta cos alpha) is
quasi-convex below 90 deg, so every extreme lies at a row (docs/certificate.md).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.kinematics import link_angles
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.records import Check, Verdict

CHUNK: Final = 65_536
"""Rows treated at once, so that memory stays bounded."""


@dataclass(frozen=True)
class Extremes:
    """Largest |alpha|, |theta| and psi [rad], range of x0 [m], over a motion."""

    alpha: float
    theta: float
    psi: float
    x0_min: float
    x0_max: float


def _largest(
    trajectory: Trajectory, measure: Callable[[slice], FloatArray]
) -> tuple[float, int, int]:
    """Largest value of a measure (rows, N), its row and its joint from 1."""
    worst, row, joint = -np.inf, 0, 0
    for first in range(0, trajectory.n_samples, CHUNK):
        values = measure(slice(first, first + CHUNK))
        if not values.size:
            continue
        at, column = np.unravel_index(int(np.argmax(values)), values.shape)
        if not values[at, column] <= worst:
            worst = float(values[at, column])
            row, joint = first + int(at), int(column) + 1
    return worst, row, joint


def extremes(trajectory: Trajectory) -> Extremes:
    """The extreme values of a motion."""
    alpha, theta = trajectory.alpha, trajectory.theta
    return Extremes(
        alpha=_largest(trajectory, lambda part: np.abs(alpha[part]))[0],
        theta=_largest(trajectory, lambda part: np.abs(theta[part]))[0],
        psi=_largest(trajectory, lambda part: link_angles(alpha[part], theta[part]))[0],
        x0_min=float(trajectory.x0.min()),
        x0_max=float(trajectory.x0.max()),
    )


def _angle_check(
    name: str,
    symbol: str,
    limit: float,
    trajectory: Trajectory,
    measure: Callable[[slice], FloatArray],
) -> Check:
    worst, row, joint = _largest(trajectory, measure)
    kept = worst <= limit + TOLERANCES.joint_limit
    return Check(
        name=name,
        verdict=Verdict.CERTIFIED if kept else Verdict.REFUTED,
        count=trajectory.alpha.size,
        worst=worst,
        limit=limit,
        unit="rad",
        where=f"{symbol}{joint}",
        moment=row,
    )


def _base_check(problem: PlanningProblem, trajectory: Trajectory) -> Check:
    """The end of the rail that x0 comes nearest to, or passes farthest."""
    low, high = problem.manipulator.base_range
    down, up = int(np.argmin(trajectory.x0)), int(np.argmax(trajectory.x0))
    below, above = low - trajectory.x0[down], trajectory.x0[up] - high
    row, limit = (down, low) if below > above else (up, high)
    kept = max(below, above) <= TOLERANCES.base_limit
    return Check(
        name="base on its rail",
        verdict=Verdict.CERTIFIED if kept else Verdict.REFUTED,
        count=trajectory.n_samples,
        worst=float(trajectory.x0[row]),
        limit=limit,
        unit="m",
        moment=row,
    )


def check_limits(problem: PlanningProblem, trajectory: Trajectory) -> tuple[Check, ...]:
    """Box of theta and alpha, cone of psi, rail, and the change if it is limited.

    Args:
        problem: Names the arm and its limits.
        trajectory: What is judged.

    Returns:
        One row each. The limits hold at every instant between the rows as well.
    """
    arm, alpha, theta = problem.manipulator, trajectory.alpha, trajectory.theta

    def change(part: slice) -> FloatArray:
        rows = slice(part.start, part.stop + 1)
        steps = np.diff(alpha[rows], axis=0), np.diff(theta[rows], axis=0)
        return np.maximum(np.abs(steps[0]), np.abs(steps[1]))

    box, step = arm.max_joint_angle, problem.max_row_change
    checks = [
        _angle_check(
            "alpha in its box",
            "alpha",
            box,
            trajectory,
            lambda part: np.abs(alpha[part]),
        ),
        _angle_check(
            "theta in its box",
            "theta",
            box,
            trajectory,
            lambda part: np.abs(theta[part]),
        ),
        _angle_check(
            "link angle psi in its cone",
            "psi",
            arm.max_link_angle,
            trajectory,
            lambda part: link_angles(alpha[part], theta[part]),
        ),
        _base_check(problem, trajectory),
    ]
    if step is not None and trajectory.n_samples > 1:
        checks.append(
            _angle_check(
                "change of a joint angle between waypoints",
                "joint ",
                step,
                trajectory,
                change,
            )
        )
    return tuple(checks)
