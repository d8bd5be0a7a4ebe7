"""What is drawn of the desired path, how much of it, and in which order."""

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray, frozen
from vdsm_pin.problem.desired_path import DesiredPath, Order
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.records import Check, Verdict

HALF_LAP: Final = 1e-9
"""Steps so near to half a lap are decided in exact arithmetic; [-]."""

FINE: Final = 200
"""Bits behind the point of a length that is known exactly, in metres."""

SAME_LAP: Final = Fraction(1, 2**100)
"""Steps so near to half a lap are half a lap; [-]."""


def wrapped(path: DesiredPath, stations: FloatArray) -> FloatArray:
    """Stations modulo the length where the path is closed, clamped elsewhere."""
    if path.closed and path.length > 0.0:
        return np.mod(stations, path.length)
    return np.minimum(np.maximum(stations, 0.0), path.length)


def runs(path: DesiredPath, stations: FloatArray) -> FloatArray:
    """How far each interval advances along the path, shape (n - 1,); [m].

    On a closed path the shorter way round, and forwards where both are as long.
    """
    run = np.diff(stations)
    if not (path.closed and path.length > 0.0):
        return np.asarray(np.diff(wrapped(path, stations)))
    laps = run / path.length - 0.5
    whole = np.ceil(laps)
    unsure = np.flatnonzero(np.abs(laps - np.round(laps)) < HALF_LAP)
    if unsure.size:
        length = exact_length(path)
        for k in unsure.tolist():
            whole[k] = _laps_taken_off(stations[k : k + 2].tolist(), length)
    return np.asarray(run - path.length * whole)


def exact_length(path: DesiredPath) -> Fraction:
    """Arc length of a path, too short by less than 2^-`FINE` m a side; [m]."""
    total = 0
    for begin, end in pairwise(path.corners.tolist()):
        sides = (Fraction(b) - Fraction(a) for a, b in zip(begin, end, strict=True))
        total += math.isqrt(math.floor(sum(side**2 for side in sides) * 4**FINE))
    return Fraction(total, 2**FINE)


def _laps_taken_off(stations: Sequence[float], length: Fraction) -> int:
    """Laps in a step beyond half a lap, where doubles cannot tell."""
    begin, end = map(Fraction, stations)
    laps = (end - begin) / length - Fraction(1, 2)
    nearest = round(laps)
    return nearest if abs(laps - nearest) < SAME_LAP else math.ceil(laps)


def drawn_intervals(trajectory: Trajectory) -> IntArray:
    """Intervals whose two rows are on the path; the one interval of a single row."""
    on = trajectory.on_path
    both = on if trajectory.n_samples == 1 else on[:-1] & on[1:]
    return np.flatnonzero(both)


def _stretches(
    path: DesiredPath, trajectory: Trajectory, near: BoolArray
) -> FloatArray:
    """The drawn stretches in order, inside [0, length], disjoint, shape (k, 2); [m]."""
    intervals = drawn_intervals(trajectory)
    intervals = intervals[near[intervals]]
    if not intervals.size or trajectory.n_samples == 1:
        return np.zeros((0, 2))
    start = wrapped(path, trajectory.path_m)[intervals]
    end = start + runs(path, trajectory.path_m)[intervals]
    low, high = np.minimum(start, end), np.maximum(start, end)
    parts = [np.column_stack([low, high])]
    if path.closed:
        turn = path.length
        parts += [np.column_stack([low + t, high + t]) for t in (-turn, turn)]
    spans: FloatArray = np.clip(np.concatenate(parts), 0.0, path.length)
    spans = spans[spans[:, 1] > spans[:, 0]]
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    if not spans.size:
        return spans
    reach = np.maximum.accumulate(spans[:, 1])
    fresh = np.concatenate([[True], spans[1:, 0] > reach[:-1]])
    last = np.concatenate([np.flatnonzero(fresh)[1:] - 1, [len(spans) - 1]])
    return np.asarray(np.column_stack([spans[fresh, 0], reach[last]]))


def coverage(
    path: DesiredPath, trajectory: Trajectory, near: BoolArray | None = None
) -> tuple[float, FloatArray]:
    """Proved part of the path that is drawn, and the stretches that are not.

    Args:
        path: The desired path.
        trajectory: Whose intervals with both rows on the path say that they draw it.
        near: Of which intervals that is proved, shape (n - 1,), of a single row (1,);
            None for all.

    Returns:
        Coverage in [0, 1], rounded downwards, and gaps longer than
        `TOLERANCES.on_path_length`, from and to, shape (k, 2); [m].
    """
    if not path.length > 0.0:  # one point: drawn by any waypoint there
        return float(trajectory.on_path.any()), frozen(np.zeros((0, 2)))
    every = np.ones(max(1, trajectory.n_samples - 1), np.bool_)
    spans = _stretches(path, trajectory, every if near is None else near)
    edges = np.concatenate([[0.0], spans.ravel(), [path.length]]).reshape(-1, 2)
    gaps = edges[edges[:, 1] - edges[:, 0] > TOLERANCES.on_path_length]
    share = float(np.sum(spans[:, 1] - spans[:, 0])) / path.length
    # A sum of n terms below the length is off by less than n ulp of it.
    ulps = 4.0 * (len(spans) + 1) * float(np.finfo(float).eps)
    return min(1.0, max(0.0, share - ulps)), frozen(gaps)


def progress(problem: PlanningProblem, trajectory: Trajectory) -> FloatArray:
    """How far each waypoint on the path lies beyond the one before it; [m].

    Between neighbours as the interval runs; where the tip has left the path in between,
    on a closed one the way forward.

    Args:
        problem: With the desired path, and how far the tip may be off: stations no
            farther apart are the same place.
        trajectory: With the waypoints.

    Returns:
        Shape (m - 1,), for the m waypoints on the path.
    """
    path, on = problem.path, np.flatnonzero(trajectory.on_path)
    steps = np.diff(wrapped(path, trajectory.path_m[on]))
    if path.closed and path.length > 0.0:
        ahead = np.mod(steps, path.length)
        # A hair backwards is not once round.
        steps = np.where(
            path.length - ahead <= problem.tip_tolerance, ahead - path.length, ahead
        )
    neighbours = np.diff(on) == 1
    run = runs(path, trajectory.path_m)[on[:-1][neighbours]]
    steps[neighbours] = run
    return np.asarray(steps)


def check_order(problem: PlanningProblem, trajectory: Trajectory) -> tuple[Check, ...]:
    """Whether the path is drawn from its start to its end, nowhere backwards.

    No waypoint lies behind any before it, however small the steps back are. A closed
    path may be begun anywhere. Whoever leaves it must come back within one turn of
    where it was begun: a piece drawn later than one behind it is out of order.

    Args:
        problem: With the desired path.
        trajectory: What is judged.

    Returns:
        One row; none where any order will do.
    """
    path, on = problem.path, np.flatnonzero(trajectory.on_path)
    if path.order is Order.FREE:
        return ()
    steps, same = progress(problem, trajectory), problem.tip_tolerance
    total = np.append(0.0, np.cumsum(steps))
    behind = np.maximum.accumulate(total) - total
    back, first = float(behind.max()), int(np.argmax(behind))
    left = bool((np.diff(on) > 1).any())
    if path.closed and left and back <= same:
        back = max(back, float(total.max()) - path.length)
        first = int(np.argmax(total > path.length + same))
    kept = back <= same  # as where nothing is drawn
    verdict = Verdict.CERTIFIED if kept else Verdict.REFUTED
    return (
        Check(
            name="tip draws the path in the order given",
            verdict=verdict if on.size else Verdict.UNDECIDED,
            count=int(on.size),
            worst=back if on.size else float("nan"),
            limit=same,
            unit="m",
            where="" if kept else "drawn backwards or again from here",
            moment=float("nan") if kept else float(on[first]),
        ),
    )


def check_coverage(
    problem: PlanningProblem, share: float, off: int = 0
) -> tuple[Check, ...]:
    """Whether as much is drawn as the problem asks for.

    Args:
        problem: With the required coverage.
        share: Proved coverage; [-].
        off: Number of waypoints that say they are on the path and are not.

    Returns:
        One row; none where the problem asks for nothing: it could not fail.
    """
    needed = problem.path.required_coverage
    if not needed > 0.0:
        return ()
    enough = share >= needed - TOLERANCES.coverage
    return (
        Check(
            name="coverage of the desired path",
            verdict=Verdict.CERTIFIED if enough else Verdict.INCOMPLETE,
            count=1,
            worst=share,
            limit=needed,
            unit="share",
            where=f"waypoints off it do not count: {off}" if off else "",
        ),
    )
