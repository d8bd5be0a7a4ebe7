"""Joint limits of a motion: extremes over its intervals, not at its rows only.

The angles and x0 are linear over an interval, and psi = arccos(cos theta cos alpha) is
quasi-convex below 90 deg, so every extreme lies at a row (docs/certificate.md). Where
smooth pieces join the rows, they are cut finely, and the control points of each part
bound what lies between: each of these measures is largest at one of them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.kinematics import link_angles
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.records import Check, Verdict, combine

CHUNK: Final = 65_536
"""Rows treated at once, so that memory stays bounded."""

PARTS: Final = 32
"""Parts of a smooth piece whose control points are looked at: they lie within a
thousandth of its bulge of the curve."""


@dataclass(frozen=True)
class Extremes:
    """Largest |alpha|, |theta| and psi [rad], range of x0 [m], over a motion."""

    alpha: float
    theta: float
    psi: float
    x0_min: float
    x0_max: float


@dataclass(frozen=True)
class _Largest:
    """The largest value of a measure at rows, and a bound of it between them.

    Args:
        seen: At a row; its moment in waypoints; and the joint, from 1.
        bound: From above over the whole motion.
    """

    seen: float = -np.inf
    moment: float = np.nan
    joint: int = 0
    bound: float = -np.inf

    def verdict(self, limit: float) -> Verdict:
        """What this says of a limit."""
        if self.bound <= limit:
            return Verdict.CERTIFIED
        return Verdict.UNDECIDED if self.seen <= limit else Verdict.REFUTED

    def worst(self, limit: float) -> float:
        """The value that decides."""
        return self.bound if self.bound <= limit else self.seen


Measure: TypeAlias = Callable[[FloatArray], FloatArray]
"""Of rows of joint values (m, 1 + 2N), shape (m, n); largest at an end of a line."""


def _stretches(trajectory: Trajectory) -> Iterator[tuple[int, int, Trajectory]]:
    """Parts of a motion: the first row, rows for each of its own, and the part."""
    parts = PARTS if trajectory.is_smooth else 1
    step = CHUNK // parts
    for first in range(0, trajectory.n_samples, step):
        yield first, parts, trajectory.part(first, first + step + 1).refined(parts)


def _largest(trajectory: Trajectory, measure: Measure) -> _Largest:
    """Largest value of a measure over a motion."""
    found, bound = _Largest(), -np.inf
    for first, parts, rows in _stretches(trajectory):
        values = measure(rows.joints)
        at, column = np.unravel_index(int(np.argmax(values)), values.shape)
        if not values[at, column] <= found.seen:
            moment = first + float(at) / parts
            found = _Largest(float(values[at, column]), moment, int(column) + 1)
        bound = max(bound, float(values.max()))
        if rows.is_smooth:
            between = rows.inner.reshape(-1, rows.inner.shape[2])
            bound = max(bound, float(measure(between).max()))
    return replace(found, bound=bound)


def _largest_change(trajectory: Trajectory) -> _Largest:
    """Largest difference of a joint angle between two moments of an interval."""
    found, bound = _Largest(), -np.inf
    for first, parts, rows in _stretches(trajectory):
        n = (rows.n_samples - 1) // parts
        if not n:
            continue
        pieces = rows.controls[:, :, 1:].reshape(n, -1, 2 * rows.n_links)
        bound = max(bound, float(np.ptp(pieces, axis=1).max()))
        edges = np.arange(n)[:, None] * parts + np.arange(parts + 1)
        seen = np.ptp(rows.joints[edges][:, :, 1:], axis=1)
        at, column = np.unravel_index(int(np.argmax(seen)), seen.shape)
        if not seen[at, column] <= found.seen:
            joint = int(column) // 2 + 1
            found = _Largest(float(seen[at, column]), float(first + at), joint)
    return replace(found, bound=bound)


def extremes(trajectory: Trajectory) -> Extremes:
    """The extreme values of a motion."""
    return Extremes(
        alpha=_largest(trajectory, _alpha).seen,
        theta=_largest(trajectory, _theta).seen,
        psi=_largest(trajectory, _psi).seen,
        x0_min=float(trajectory.x0.min()),
        x0_max=float(trajectory.x0.max()),
    )


def _alpha(joints: FloatArray) -> FloatArray:
    return np.abs(joints[:, 1::2])


def _theta(joints: FloatArray) -> FloatArray:
    return np.abs(joints[:, 2::2])


def _psi(joints: FloatArray) -> FloatArray:
    return link_angles(joints[:, 1::2], joints[:, 2::2])


def _angle_check(
    name: str, symbol: str, limit: float, count: int, found: _Largest
) -> Check:
    most = limit + TOLERANCES.joint_limit
    return Check(
        name=name,
        verdict=found.verdict(most),
        count=count,
        worst=found.worst(most),
        limit=limit,
        unit="rad",
        where=f"{symbol}{found.joint}",
        moment=found.moment,
    )


def _base_check(problem: PlanningProblem, trajectory: Trajectory) -> Check:
    """The end of the rail that x0 comes nearest to, or passes farthest."""
    low, high = problem.manipulator.base_range
    below = _largest(trajectory, lambda joints: low - joints[:, :1])
    above = _largest(trajectory, lambda joints: joints[:, :1] - high)
    verdicts = [one.verdict(TOLERANCES.base_limit) for one in (below, above)]
    down = below.seen > above.seen
    worst = (below if down else above).worst(TOLERANCES.base_limit)
    return Check(
        name="base on its rail",
        verdict=combine(tuple(verdicts)),
        count=trajectory.n_samples,
        worst=low - worst if down else high + worst,
        limit=low if down else high,
        unit="m",
        moment=(below if down else above).moment,
    )


def check_limits(problem: PlanningProblem, trajectory: Trajectory) -> tuple[Check, ...]:
    """Box of theta and alpha, cone of psi, rail, and the change if it is limited.

    Args:
        problem: Names the arm and its limits.
        trajectory: What is judged.

    Returns:
        One row each. The limits hold at every instant between the rows as well.
    """
    arm, count = problem.manipulator, trajectory.alpha.size
    box, step = arm.max_joint_angle, problem.max_row_change
    cone = arm.max_link_angle
    alpha, theta, psi = (_largest(trajectory, m) for m in (_alpha, _theta, _psi))
    checks = [
        _angle_check("alpha in its box", "alpha", box, count, alpha),
        _angle_check("theta in its box", "theta", box, count, theta),
        _angle_check("link angle psi in its cone", "psi", cone, count, psi),
        _base_check(problem, trajectory),
    ]
    if step is not None and trajectory.n_samples > 1:
        name, found = "change of a joint angle between waypoints", "joint "
        change = _largest_change(trajectory)
        checks.append(_angle_check(name, found, step, count, change))
    return tuple(checks)
