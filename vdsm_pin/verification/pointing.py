"""The last link's axis against its cone, at every instant on the path.

Between two rows joints move by a polynomial, and never faster than the largest control
point of its derivative says. The axis turns no faster than all joints before
it together, and the cone's axis no faster than the tip or the station moves. So the
angle between the two is at most the mean of the angles at both ends of a slice and half
of what both turn in it. Slices are halved until that is within the cone.

Errors widen the angle by no more than `AimError` says. What the nominal motion keeps is
then proved for every motion within them, or undecided.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import row_centres
from vdsm_pin.geometry import bernstein
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.problem.error_boxes import NO_ERRORS, ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import AimError, angles_between
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.drawing import drawn_intervals, runs, wrapped
from vdsm_pin.verification.records import Check, Verdict

NAME: Final = "last link's axis within its cone on the path"
CHUNK: Final = 4_096
"""Intervals treated at once, so that memory stays bounded."""
ROUNDS: Final = 24
"""Halvings of a slice at which it is left undecided."""
NARROW: Final = 1e-3
"""Width to which the largest angle is told; [rad]."""
ROUNDING: Final = 1e-12
"""Bound of all rounding in an angle to a vector of a metre; [rad m]."""


@dataclass(frozen=True)
class _Slices:
    """Parts of intervals: where, and at both ends the angle and the aim's length."""

    interval: IntArray
    low: FloatArray
    high: FloatArray
    angle: FloatArray
    next_angle: FloatArray
    size: FloatArray
    next_size: FloatArray

    def take(self, kept: BoolArray) -> "_Slices":
        return _Slices(*(getattr(self, one.name)[kept] for one in fields(self)))


class _Motion:
    """Some intervals of a trajectory on the path.

    Args:
        problem: Arm and path.
        trajectory: The motion.
        first: First row of each interval, shape (k,).
        after: Its last row; the first one again where that stands alone, shape (k,).
        errors: What the angles of `seen` and `bounds` allow for.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        trajectory: Trajectory,
        first: IntArray,
        after: IntArray,
        errors: ErrorBox,
    ) -> None:
        self.arm, self.path = problem.manipulator, problem.path
        moves = after > first
        self.pieces = np.repeat(trajectory.joints[first, None], 2, axis=1)
        if moves.any():
            pieces = trajectory.path.pieces(first[moves])
            shape = len(first), pieces.shape[1], pieces.shape[2]
            self.pieces = np.broadcast_to(self.pieces[:, :1], shape).copy()
            self.pieces[moves] = pieces
        rates = np.abs(bernstein.derivative(self.pieces)).max(axis=1)
        self.station = wrapped(self.path, trajectory.path_m)[first]
        steps = np.append(runs(self.path, trajectory.path_m), 0.0)
        self.run = np.where(after > first, steps[first], 0.0)
        turns = rates[:, 1::2] + rates[:, 2::2]
        self.turning = turns.sum(axis=1)
        levers = self.arm.total_length - self.arm.stations[:-1]
        self.speed = rates[:, 0] + turns @ levers
        self.swerve = self._steepest() * np.abs(self.run)
        assert self.path.pointing is not None
        self.error = AimError.of(self.path.pointing, self.arm, errors)
        self.far = np.abs(self.pieces[..., 0]).max(initial=0.0)

    def _widening(self, size: FloatArray) -> FloatArray:
        """How much errors widen the angle to aims of some length; [rad]."""
        return self.error.widening(size, self.far)

    def _steepest(self) -> float:
        """Largest change of the directions per length of path; [1/m]."""
        pointing = self.path.pointing
        assert pointing is not None
        if pointing.directions is None or len(pointing.directions) == 1:
            return 0.0
        sides = np.diff(self.path.corner_stations)
        change = np.linalg.norm(np.diff(pointing.directions, axis=0), axis=1)
        return float((change / sides).max(initial=0.0))

    def seen(
        self, interval: IntArray, share: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Angles to the aims with errors (NaN: no aim), and the aims' lengths."""
        rows = bernstein.value(self.pieces[interval], share)
        centres = row_centres(self.arm, rows)
        station = self.station[interval] + share * self.run[interval]
        aims = self.path.aims(centres[:, -1], wrapped(self.path, station))
        axes = centres[:, -1] - centres[:, -2]
        size = np.linalg.norm(aims, axis=1)
        return angles_between(axes, aims) + self._widening(size), size

    def bounds(self, slices: _Slices) -> FloatArray:
        """Largest angle within slices, from above; inf where none is known; [rad]."""
        k, width = slices.interval, slices.high - slices.low
        pointing = self.path.pointing
        assert pointing is not None
        drift = self.speed if pointing.target is not None else self.swerve
        moved = drift[k] * width
        nearest = (slices.size + slices.next_size - moved) / 2.0
        clear = nearest > 0.0
        nearest = np.where(clear, nearest, 1.0)
        turned = self.turning[k] * width + moved / nearest
        middle = (slices.angle + slices.next_angle) / 2.0
        ends = self._widening(slices.size) + self._widening(slices.next_size)
        middle += self._widening(nearest) - ends / 2.0
        bound = middle + turned / 2.0 + ROUNDING * (1.0 + 1.0 / nearest)
        return np.where(clear & np.isfinite(bound), bound, np.inf)

    def halved(self, slices: _Slices) -> _Slices:
        """Both halves of slices."""
        middle = (slices.low + slices.high) / 2.0
        angle, size = self.seen(slices.interval, middle)
        two = np.concatenate
        return _Slices(
            two([slices.interval, slices.interval]),
            two([slices.low, middle]),
            two([middle, slices.high]),
            two([slices.angle, angle]),
            two([angle, slices.next_angle]),
            two([slices.size, size]),
            two([size, slices.next_size]),
        )

    def whole(self) -> _Slices:
        """Every interval as one slice."""
        number = np.arange(len(self.pieces))
        none, all_ = np.zeros(len(number)), np.ones(len(number))
        begin, end = self.seen(number, none), self.seen(number, all_)
        return _Slices(number, none, all_, begin[0], end[0], begin[1], end[1])


@dataclass
class _Worst:
    """The largest angle seen, the largest bound of one, and where; [rad]."""

    seen: float = 0.0
    at: float = np.nan
    bound: float = 0.0
    bound_at: float = np.nan

    def look(self, slices: _Slices, first: IntArray) -> None:
        """Take the angles at which slices begin and end into account."""
        angles = np.stack([slices.angle, slices.next_angle])
        # An angle to nothing is no angle; a bound is found for it or there is none.
        angles = np.where(np.isfinite(angles), angles, -1.0)
        side, row = np.unravel_index(int(np.argmax(angles)), angles.shape)
        if angles[side, row] > self.seen:
            self.seen = float(angles[side, row])
            share = (slices.low, slices.high)[int(side)][row]
            self.at = float(first[slices.interval[row]] + share)

    def settle(self, bounds: FloatArray, slices: _Slices, first: IntArray) -> None:
        """Take bounds of slices that are not looked at any further."""
        if not bounds.size:
            return
        row = int(np.argmax(bounds))
        if bounds[row] > self.bound:
            self.bound = float(bounds[row])
            self.bound_at = float(first[slices.interval[row]] + slices.low[row])


def _intervals(trajectory: Trajectory) -> Iterator[tuple[IntArray, IntArray]]:
    """First and last rows of the intervals on the path, and of rows that are alone."""
    on = trajectory.on_path
    drawn = drawn_intervals(trajectory)
    beside = np.zeros(on.size + 1, dtype=np.bool_)
    beside[drawn] = beside[drawn + 1] = True
    alone = np.flatnonzero(on & ~beside[: on.size])
    first, after = np.append(drawn, alone), np.append(drawn + 1, alone)
    after = np.minimum(after, on.size - 1)
    for begin in range(0, first.size, CHUNK):
        part = slice(begin, begin + CHUNK)
        yield first[part], after[part]


def check_pointing(
    problem: PlanningProblem,
    trajectory: Trajectory,
    deadline: Deadline = NO_LIMIT,
    errors: ErrorBox = NO_ERRORS,
) -> tuple[Check, ...]:
    """The row of evidence, none where the last link may look anywhere.

    Args:
        problem: Arm and path.
        trajectory: What is judged.
        deadline: When to give up.
        errors: What it is proved for besides the motion itself.

    Raises:
        OutOfTime: If the time is over.
    """
    if problem.tip_path is None or problem.tip_path.pointing is None:
        return ()
    limit = problem.tip_path.pointing.cone + TOLERANCES.joint_limit
    worst, count = _largest(problem, trajectory, NO_ERRORS, deadline)
    refuted, kept = worst.seen > limit, worst.bound <= limit
    if count and kept and not refuted and errors != NO_ERRORS:
        # Past the cone with errors is no counterexample: the bound of them is not met.
        worst, _ = _largest(problem, trajectory, errors, deadline)
        kept = worst.bound <= limit and worst.seen <= limit
    verdict = Verdict.UNDECIDED
    if count and (refuted or kept):
        verdict = Verdict.REFUTED if refuted else Verdict.CERTIFIED
    value, moment = worst.bound, worst.bound_at
    if worst.seen > limit:
        value, moment = worst.seen, worst.at
    return (
        Check(
            name=NAME,
            verdict=verdict,
            count=count,
            worst=value if count and np.isfinite(value) else float("nan"),
            limit=problem.tip_path.pointing.cone,
            unit="rad",
            moment=moment if count else float("nan"),
        ),
    )


def _largest(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    deadline: Deadline,
) -> tuple[_Worst, int]:
    """The largest angle on the path with errors, and the number of intervals."""
    assert problem.tip_path is not None and problem.tip_path.pointing is not None
    limit = problem.tip_path.pointing.cone + TOLERANCES.joint_limit
    worst, count = _Worst(), 0
    for first, after in _intervals(trajectory):
        count += first.size
        motion = _Motion(problem, trajectory, first, after, errors)
        _look(motion, first, limit, worst, deadline)
    return worst, count


def _look(
    motion: _Motion, first: IntArray, limit: float, worst: _Worst, deadline: Deadline
) -> None:
    """Bound the angle over some intervals, as narrowly as is wanted."""
    slices = motion.whole()
    for round_ in range(ROUNDS + 1):
        deadline.check()
        worst.look(slices, first)
        bounds = motion.bounds(slices)
        wide = (bounds > limit) | (bounds > worst.seen + NARROW)
        if worst.seen > limit or round_ == ROUNDS:
            wide[:] = False
        worst.settle(bounds[~wide], slices.take(~wide), first)
        if not wide.any():
            return
        slices = motion.halved(slices.take(wide))
