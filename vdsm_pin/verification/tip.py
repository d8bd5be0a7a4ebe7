"""The tip against the desired path, and a motion's ends against start and goal."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray, frozen
from vdsm_pin.geometry.bernstein import derivative
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.drawing import (
    check_coverage,
    check_order,
    coverage,
    drawn_intervals,
    runs,
    wrapped,
)
from vdsm_pin.verification.records import Check, Verdict

CHUNK: Final = 16_384
"""Rows treated at once, so that memory stays bounded."""

PARTS: Final = 16
"""Parts of a smooth piece at most; its chord is that much nearer to it, squared."""

MOST: Final = 65_536
"""Rows of a smooth motion so cut, unless it has more by itself."""


@dataclass(frozen=True)
class TipReport:
    """What is proved of the tip.

    Args:
        checks: One row of evidence each.
        deviation: Bound of the tip's distance from the place on the path that belongs
            to the same instant, over all intervals on the path; 0 without any; [m].
        coverage: Proved part of the path that is drawn, 0 to 1; NaN where there is no
            path; [-].
        undrawn: Stretches not drawn, from and to, shape (k, 2); [m].
    """

    checks: tuple[Check, ...]
    deviation: float
    coverage: float
    undrawn: FloatArray


def tip_positions(manipulator: Manipulator, trajectory: Trajectory) -> FloatArray:
    """The tip at every row, shape (n_samples, 3); [m]."""
    tips = np.zeros((trajectory.n_samples, 3))
    for first in range(0, trajectory.n_samples, CHUNK):
        part = slice(first, first + CHUNK)
        joints = trajectory.x0[part], trajectory.alpha[part], trajectory.theta[part]
        tips[part] = joint_centres(manipulator, *joints)[:, -1]
    return tips


def second_derivatives(manipulator: Manipulator, trajectory: Trajectory) -> FloatArray:
    """Bound M of the tip's second derivative on each interval, shape (n - 1,); [m].

    As of docs/proof.md: each link counts with the square of how fast all joints before
    it turn, and with how fast that changes.
    """
    path, result = trajectory.path, np.zeros(max(0, trajectory.n_samples - 1))
    for first in range(0, result.size, CHUNK):
        rates = derivative(
            path.pieces(np.arange(first, min(first + CHUNK, result.size)))
        )
        most, turns = np.abs(rates).max(axis=1), np.zeros((len(rates), 1))
        turning = np.cumsum(most[:, 1::2] + most[:, 2::2], axis=1) ** 2
        if trajectory.is_smooth:
            more = np.abs(derivative(rates)).max(axis=1)
            turning += np.cumsum(more[:, 1::2] + more[:, 2::2], axis=1)
            turns = more[:, :1]
        part = turning @ manipulator.link_lengths + turns[:, 0]
        result[first : first + CHUNK] = part
    return result


def _parts(trajectory: Trajectory) -> int:
    """Into how many a smooth piece is cut: fewer where there are many."""
    if not trajectory.is_smooth:
        return 1
    return max(1, min(PARTS, MOST // trajectory.n_samples))


def _cut(problem: PlanningProblem, trajectory: Trajectory) -> Trajectory:
    """A smooth motion with its pieces cut finely, so that chords are near them."""
    if not trajectory.is_smooth:
        return trajectory
    parts, path = _parts(trajectory), problem.path
    fine = trajectory.refined(parts)
    # The tip runs the shorter way round between two rows, evenly in time.
    begin, run = wrapped(path, trajectory.path_m), runs(path, trajectory.path_m)
    share = np.arange(parts) / parts
    between = (begin[:-1, None] + run[:, None] * share).reshape(-1)
    return replace(fine, path_m=np.append(between, trajectory.path_m[-1]))


def _corner_deviation(
    path: DesiredPath,
    tips: FloatArray,
    start: FloatArray,
    run: FloatArray,
    intervals: IntArray,
) -> FloatArray:
    """Largest distance of each chord from the path's corners on its way; [m]."""
    result = np.zeros(intervals.size)
    turns = [0.0]
    if path.closed and path.length > 0.0:
        turns = [-path.length, 0.0, path.length]
    stations = np.sort(np.concatenate([path.corner_stations + t for t in turns]))
    low, high = np.minimum(start, start + run), np.maximum(start, start + run)
    first = np.searchsorted(stations, low, side="right")
    last = np.searchsorted(stations, high, side="left")
    for at in np.flatnonzero(last > first):
        corners = stations[first[at] : last[at]]
        share = ((corners - start[at]) / run[at])[:, None]
        k = intervals[at]
        chord = tips[k] + share * (tips[k + 1] - tips[k])
        gap = np.linalg.norm(chord - path.at(wrapped(path, corners)), axis=1)
        result[at] = gap.max()
    return result


def _deviations(
    problem: PlanningProblem, trajectory: Trajectory, tips: FloatArray
) -> FloatArray:
    """Bound of the deviation on each interval, 0 off the path; [m].

    Returns:
        Shape (n - 1,), of a single row (1,).
    """
    result = np.zeros(max(1, trajectory.n_samples - 1))
    intervals = drawn_intervals(trajectory)
    if not intervals.size:
        return result
    path, stations = problem.path, trajectory.path_m
    rows = np.linalg.norm(tips - path.at(wrapped(path, stations)), axis=1)
    if trajectory.n_samples == 1:
        return np.asarray(rows + TOLERANCES.arithmetic)
    run, start = runs(path, stations)[intervals], wrapped(path, stations)[intervals]
    ends = np.maximum(rows[intervals], rows[intervals + 1])
    corners = _corner_deviation(path, tips, start, run, intervals)
    off_chord = second_derivatives(problem.manipulator, trajectory)[intervals] / 8.0
    result[intervals] = np.maximum(ends, corners) + off_chord + TOLERANCES.arithmetic
    return result


def _kept(
    problem: PlanningProblem, trajectory: Trajectory, tips: FloatArray
) -> BoolArray:
    """At which rows the tip is proved to be where the path is then, shape (n,)."""
    goal = problem.path.at(wrapped(problem.path, trajectory.path_m))
    gap = np.linalg.norm(tips - goal, axis=1)
    return np.asarray(gap + TOLERANCES.arithmetic <= problem.tip_tolerance)


def _row_check(
    problem: PlanningProblem, trajectory: Trajectory, tips: FloatArray
) -> Check:
    on, path = np.flatnonzero(trajectory.on_path), problem.path
    worst, moment, kept = float("nan"), float("nan"), False
    if on.size:
        goal = path.at(wrapped(path, trajectory.path_m[on]))
        gap = np.linalg.norm(tips[on] - goal, axis=1)
        at = int(np.argmax(gap))
        worst, moment = float(gap[at]), float(on[at])
        kept = worst + TOLERANCES.arithmetic <= problem.tip_tolerance
    verdict = Verdict.CERTIFIED if kept else Verdict.REFUTED
    return Check(
        name="tip on the desired path at the waypoints",
        verdict=verdict if on.size else Verdict.UNDECIDED,
        count=int(on.size),
        worst=worst,
        limit=problem.tip_tolerance,
        unit="m",
        moment=moment,
    )


def check_tip(problem: PlanningProblem, trajectory: Trajectory) -> TipReport:
    """The tip at its start and goal, and on the path where there is one.

    Args:
        problem: Arm, start, desired path and goal.
        trajectory: What is judged.

    Returns:
        The rows of evidence; of what the problem does not ask for there are none.
    """
    arm = problem.manipulator
    tips = tip_positions(arm, trajectory)
    ends = check_ends(problem, trajectory, tips)
    if problem.tip_path is None:
        return TipReport(ends, 0.0, float("nan"), frozen(np.zeros((0, 2))))
    fine = _cut(problem, trajectory)
    some = tips if fine is trajectory else tip_positions(arm, fine)
    deviations = _deviations(problem, fine, some)
    deviation = float(deviations.max())
    interval = int(np.argmax(deviations)) // _parts(trajectory)
    near = (deviations <= problem.path.spacing).reshape(max(1, len(tips) - 1), -1)
    kept = trajectory.on_path & _kept(problem, trajectory, tips)
    drawing = replace(trajectory, on_path=kept)
    share, undrawn = coverage(problem.path, drawing, np.asarray(near.all(axis=1)))
    checks = (
        *ends,
        _row_check(problem, trajectory, tips),
        *_between_check(problem, trajectory, deviation, interval),
        *check_order(problem, trajectory),
        *check_coverage(problem, share, int((trajectory.on_path & ~kept).sum())),
    )
    return TipReport(checks, deviation, share, undrawn)


def _between_check(
    problem: PlanningProblem, trajectory: Trajectory, deviation: float, interval: int
) -> tuple[Check, ...]:
    """Whether the tip stays within one spacing of the path between waypoints.

    The deviation is a bound from above, so one that is larger proves nothing. A path
    of one point is drawn at a waypoint, so there need not be anything in between.
    """
    drawn = int(drawn_intervals(trajectory).size)
    if not drawn and not problem.path.length > 0.0:
        return ()
    near = drawn > 0 and deviation <= problem.path.spacing
    return (
        Check(
            name="tip near the desired path between the waypoints",
            verdict=Verdict.CERTIFIED if near else Verdict.UNDECIDED,
            count=drawn,
            worst=deviation if drawn else float("nan"),
            limit=problem.path.spacing,
            unit="m",
            where="from here to the next waypoint" if drawn else "",
            moment=interval if drawn else float("nan"),
        ),
    )


def check_ends(
    problem: PlanningProblem, trajectory: Trajectory, tips: FloatArray
) -> tuple[Check, ...]:
    """The first row at the start, the last one at the goal.

    Args:
        problem: With start and goal, where it states them, and how far the tip may be
            off.
        trajectory: What is judged.
        tips: The tip at every row, shape (n_samples, 3); [m].

    Returns:
        A row for the tip and one for the joints, of what is stated.
    """
    checks: list[Check] = []
    for posture, row, end in (
        (problem.begin, 0, "start"),
        (problem.goal, trajectory.n_samples - 1, "goal"),
    ):
        if posture is None:
            continue
        gap = float(np.linalg.norm(tips[row] - posture.tip))
        checks.append(_check(problem, f"tip at its {end}", gap, row))
        if posture.joints is not None:
            ways = _ways(problem, posture.joints, trajectory.part(row, row + 1))
            name = f"joints at their {end}"
            checks.append(_check(problem, name, float(ways.max()), row, ways.size))
    return tuple(checks)


def _ways(problem: PlanningProblem, joints: FloatArray, row: Trajectory) -> FloatArray:
    """How far each joint value is off, as the way that it may move the tip; [m]."""
    levers = np.full(joints.size, problem.manipulator.total_length)
    levers[0] = 1.0
    return np.asarray(levers * np.abs(row.joints[0] - joints))


def _check(
    problem: PlanningProblem, name: str, off: float, row: int, count: int = 1
) -> Check:
    kept = off + TOLERANCES.arithmetic <= problem.tip_tolerance
    return Check(
        name=name,
        verdict=Verdict.CERTIFIED if kept else Verdict.REFUTED,
        count=count,
        worst=off,
        limit=problem.tip_tolerance,
        unit="m",
        moment=row,
    )
