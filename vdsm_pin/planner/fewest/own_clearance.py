"""Whether an arm's own bodies keep off each other in a motion in the chart.

Most arms have no bodies that can meet unless the arm turns far
(`problem/own_pairs.py`): postures that turn less are not looked at.
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.arm.kinematics import joint_angles
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.charts import Intervals
from vdsm_pin.planner.start import start_centres
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

HALVINGS: Final = 14
"""Times an interval is halved; what is not known to be apart then counts as too near.
"""
FINE: Final = 0.1
"""Part of the way of the body below which they count as apart between two places where
they are; [-]."""
SWELL: Final = 1.1
"""An arm may turn farther within an interval than at its ends, over these; [-].

Random pairs of hrm8 turn 1.05 times as far between directions that are 0.2 apart, and
no farther between projections; directions that are 0.5 to 1 apart turn up to 2.3 times
as far, and intervals are cut shorter than that.
"""


class _Place(NamedTuple):
    """Joint angles [rad] and what pairs have beyond what they keep, (r, p); [m]."""

    alpha: FloatArray
    theta: FloatArray
    spare: FloatArray

    def take(self, chosen: BoolArray | IntArray) -> "_Place":
        return _Place._make(values[chosen] for values in self)


class OwnClearance:
    """Looks at bodies of one arm that can come too near to each other.

    Where the start has less than is kept, ways from it and to it need keep no more.

    Args:
        problem: The arm, and where it starts.
        slack: Kept for what happens between two rows; where the straight arm has less
            than twice that to spare, half of what it has; [m].
        finest: Way of the body below which intervals are not looked at; [m].
    """

    def __init__(self, problem: PlanningProblem, slack: float, finest: float) -> None:
        self.finest = FINE * finest
        self.arm, self.pairs = problem.manipulator, problem.own_pairs
        self.turn, straight = self.pairs.turn, np.zeros((1, self.arm.n_links))
        self.start, self.lacked = start_centres(problem), np.zeros(len(self.pairs.kept))
        if self.turn < np.inf:
            most = self.pairs.spare(straight, straight)[0] / 2.0
            self.reserve = most.clip(0.0, slack)
            if np.isfinite(self.start).all():
                self.lacked = -self._at(self.start[None]).spare[0].clip(max=0.0)

    def too_near(self, centres: FloatArray, bends: FloatArray) -> BoolArray:
        """Postures whose own bodies are too near to each other, shape (n,).

        Args:
            centres: Joint centres, shape (n, N + 1, 3), NaN where a link is too short.
            bends: Link angles, shape (n, N), NaN there; [rad].
        """
        found = np.zeros(len(centres), dtype=np.bool_)
        near = np.flatnonzero(bends.sum(axis=1) >= self.turn)
        if near.size:
            spare = self._at(centres[near]).spare
            lacked = self.lacked * self._starts(centres[near])[:, None]
            found[near] = (spare + lacked < -TOLERANCES.on_boundary).any(axis=1)
        return found

    def apart(
        self,
        intervals: Intervals,
        ends: tuple[FloatArray, FloatArray],
        bends: FloatArray,
        asked: BoolArray,
    ) -> BoolArray:
        """Which intervals keep own bodies apart all the way, shape (n,).

        Args:
            intervals: Straight lines in the chart.
            ends: Joint centres where they begin and end, shape (n, N + 1, 3); [m].
            bends: The larger link angles of both ends, shape (n, N); [rad].
            asked: Which of them are asked for, shape (n,).
        """
        kept = np.ones(len(asked), dtype=np.bool_)
        number = np.flatnonzero(asked & (SWELL * bends.sum(axis=1) >= self.turn))
        if not number.size:
            return kept
        low, high = np.zeros(len(number)), np.ones(len(number))
        begin, end = (self._at(centres[number]) for centres in ends)
        starts = self._starts(ends[0]) | self._starts(ends[1])
        least = -self.lacked * starts[:, None] - TOLERANCES.on_boundary
        for _ in range(HALVINGS):
            need = least[number]
            near = ((begin.spare < need) | (end.spare < need)).any(axis=1)
            kept[number[near]] = False
            way = np.abs(end.alpha - begin.alpha) + np.abs(end.theta - begin.theta)
            moved = way @ self.pairs.levers.T
            sure = begin.spare + end.spare >= moved + 2.0 * need
            sure |= moved <= self.finest
            open_ = kept[number] & ~sure.all(axis=1)
            if not open_.any():
                return kept
            number, low, high = number[open_], low[open_], high[open_]
            begin, end, middle = begin.take(open_), end.take(open_), (low + high) / 2.0
            inner = self._at(intervals.centres(self.arm, number, middle))
            number, low = np.tile(number, 2), np.append(low, middle)
            high = np.append(middle, high)
            begin, end = (
                _Place._make(np.concatenate(both) for both in zip(*two, strict=True))
                for two in ((begin, inner), (inner, end))
            )
        kept[number] = False
        return kept

    def _starts(self, centres: FloatArray) -> BoolArray:
        """Which postures are the start that lacks something, shape (n,)."""
        if not self.lacked.any():
            return np.zeros(len(centres), dtype=np.bool_)
        away = np.abs(centres - self.start).max(axis=(1, 2))
        return np.asarray(away <= TOLERANCES.joint_centre)

    def _at(self, centres: FloatArray) -> _Place:
        """Postures, as bodies see them; one that is no arm lacks everything."""
        spare = np.full((len(centres), len(self.reserve)), -np.inf)
        angles = np.zeros((2, len(centres), self.arm.n_links))
        real = np.isfinite(centres).all(axis=(1, 2))
        if real.any():
            angles[:, real] = joint_angles(self.arm, centres[real])
            spare[real] = self.pairs.spare(*angles[:, real]) - self.reserve
        return _Place(angles[0], angles[1], spare)
