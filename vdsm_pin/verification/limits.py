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

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bernstein import part
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.records import Check, Verdict, combine

CHUNK: Final = 65_536
"""Rows treated at once, so that memory stays bounded."""

PARTS: Final = 32
"""Parts of a smooth piece whose control points are looked at: they lie within a
thousandth of its bulge of the curve."""


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

    def larger(
        self, values: FloatArray, moments: FloatArray | IntArray, n_angles: int = 1
    ) -> "_Largest":
        """This, or the largest of values (m, n) seen at moments (m,).

        So many columns belong to one joint.
        """
        at, column = np.unravel_index(int(np.argmax(values)), values.shape)
        if values[at, column] <= self.seen:
            return self
        joint = int(column) // n_angles + 1
        return _Largest(float(values[at, column]), float(moments[at]), joint)

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


def _largest(trajectory: Trajectory, measure: Measure) -> _Largest:
    """Largest value of a measure over a motion."""
    found = _Largest()
    for first in range(0, trajectory.n_samples, CHUNK):
        rows = trajectory.part(first, first + CHUNK)
        found = found.larger(measure(rows.joints), first + np.arange(rows.n_samples))
    bound = found.seen
    for k, pieces in _wide(trajectory, measure, found.seen):
        # Ends of parts are moments of the motion, their other control points are not.
        values = measure(pieces.reshape(-1, pieces.shape[2]))
        bound = max(bound, float(values.max()))
        begins = values.reshape(*pieces.shape[:2], -1)[:, 0]
        moments = np.repeat(k, PARTS) + np.tile(np.arange(PARTS) / PARTS, len(k))
        found = found.larger(begins, moments)
    return replace(found, bound=bound)


def _wide(
    trajectory: Trajectory, measure: Measure, seen: float
) -> Iterator[tuple[IntArray, FloatArray]]:
    """The smooth pieces that may go beyond what was seen, cut into parts.

    Yields:
        Their numbers, shape (m,), and the control points of their parts, shape (m *
        PARTS, degree + 1, 1 + 2N).
    """
    inner = trajectory.inner
    for first in range(0, len(inner), CHUNK // PARTS):
        some = inner[first : first + CHUNK // PARTS]
        values = measure(some.reshape(-1, some.shape[2])).reshape(len(some), -1)
        k = first + np.flatnonzero(values.max(axis=1) > seen)
        if k.size:
            yield k, _parts(trajectory, k)


def _parts(trajectory: Trajectory, k: IntArray) -> FloatArray:
    """Control points of the parts of some pieces, one piece after the other."""
    pieces = np.repeat(trajectory.pieces(k), PARTS, axis=0)
    edges = np.tile(np.arange(PARTS), len(k))
    return part(pieces, edges / PARTS, (edges + 1) / PARTS)


def _largest_change(trajectory: Trajectory) -> _Largest:
    """Largest difference of a joint angle between two moments of an interval."""
    found, step = _Largest(), CHUNK // PARTS
    for first in range(0, trajectory.n_samples - 1, step):
        rows = trajectory.part(first, first + step + 1)
        ends = np.abs(np.diff(rows.joints[:, 1:], axis=0))
        found = found.larger(ends, first + np.arange(len(ends)), n_angles=2)
    bound = found.seen
    for first in range(0, len(trajectory.inner), step):
        numbers = np.arange(first, min(first + step, len(trajectory.inner)))
        controls = trajectory.pieces(numbers)[:, :, 1:]
        k = numbers[np.ptp(controls, axis=1).max(axis=1) > found.seen]
        if not k.size:
            continue
        pieces = _parts(trajectory, k)[:, :, 1:].reshape(
            len(k), PARTS, -1, controls.shape[2]
        )
        bound = max(bound, float(np.ptp(pieces, axis=(1, 2)).max()))
        edges = np.concatenate([pieces[:, :, 0], pieces[:, -1:, -1]], axis=1)
        found = found.larger(np.ptp(edges, axis=1), k, n_angles=2)
    return replace(found, bound=bound)


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
