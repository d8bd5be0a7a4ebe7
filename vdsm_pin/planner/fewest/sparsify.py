"""Knees taken away from a motion along the path, as long as it stays clear.

A joint is put in line with the bent joints before and after it, along as much of the
path as keeps clearance and limits. Its neighbours bend more for it, so a gentle curve
of many knees becomes a polygon of few.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.planner.fewest.charts import Projections
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Intervals, Knots
from vdsm_pin.tolerances import TOLERANCES

ROUNDS: Final = 3
"""Rounds over all joints."""


@compiled
def lined_up(
    offsets: FloatArray, stations: FloatArray, joint: int, straight: float
) -> FloatArray:
    """Arms with one joint in line with the bent joints before and after it.

    Args:
        offsets: D_1..D_{N+1}, shape (n, N + 1, 2); [m].
        stations: Arc length of the joints, shape (N + 1,); [m].
        joint: The joint, counted from 0.
        straight: Change of slope that counts as none; [-].

    Returns:
        Shape (n, N + 1, 2); [m].
    """
    result = offsets.copy()
    last = stations.size - 1
    bent = np.zeros(last + 1, dtype=np.bool_)
    for r in range(offsets.shape[0]):
        row = result[r]
        for i in range(1, last):
            turn = 0.0
            for c in range(2):
                after = (row[i + 1, c] - row[i, c]) / (stations[i + 1] - stations[i])
                before = (row[i, c] - row[i - 1, c]) / (stations[i] - stations[i - 1])
                turn = max(turn, abs(after - before))
            bent[i] = turn > straight
        low, high = joint - 1, joint + 1
        while low > 0 and not bent[low]:
            low -= 1
        while high < last and not bent[high]:
            high += 1
        span = stations[high] - stations[low]
        for i in range(low + 1, high):
            share = (stations[i] - stations[low]) / span
            for c in range(2):
                row[i, c] = (1.0 - share) * row[low, c] + share * row[high, c]
    return result


def sparser(judge: Judge, knots: Knots) -> Knots:
    """The motion with fewer changed angles where the tip draws, every interval clear.

    Args:
        judge: Says what is clear.
        knots: The motion; given by directions, it comes back by projections where all
            of it can be.
    """
    knots = projected(judge, knots)
    arm = judge.problem.manipulator
    if knots.offsets.shape[2] == 3:
        return knots
    on = np.append(knots.drawn, False) | np.append(False, knots.drawn)
    for _ in range(ROUNDS):
        before = knots
        for joint in range(1, arm.n_links):
            knots = _without(judge, knots, joint, on)
        if knots is before:
            break
    return knots


def projected(judge: Judge, knots: Knots) -> Knots:
    """Knots given by projections if all links lean ahead and all ways stay clear."""
    every = knots.pick(np.arange(len(knots.drawn)))
    if not every.directed:
        return knots
    arm, count = judge.problem.manipulator, len(knots.tips)
    still = Intervals(knots.tips, knots.tips, knots.offsets, knots.offsets)
    centres = still.centres(arm, np.arange(count), np.zeros(count))
    if not (np.diff(centres[:, :, 0], axis=1) > 0.0).all():
        return knots
    offsets = Projections().of_centres(arm, centres)
    trial = replace(knots, offsets=offsets)
    clear = judge.clear(judge.lines(trial, np.arange(len(knots.drawn))))
    return trial if clear.all() else knots


def _without(judge: Judge, knots: Knots, joint: int, on: BoolArray) -> Knots:
    """Knots with a joint straight where that can be; the same object if nowhere."""
    arm = judge.problem.manipulator
    trial = knots.offsets.copy()
    rows = np.flatnonzero(on)
    trial[rows] = lined_up(
        knots.offsets[rows], arm.stations, joint, TOLERANCES.straight_slope
    )
    _, before, _ = judge.look(knots.tips[rows], knots.offsets[rows])
    room, after, _ = judge.look(knots.tips[rows], trial[rows])
    better = np.zeros(len(on), dtype=np.bool_)
    better[rows] = (room >= judge.required) & (after < before)
    # The start is where it is.
    better[0] = False
    while better.any():
        offsets = np.where(better[:, None, None], trial, knots.offsets)
        changed = replace(knots, offsets=offsets)
        touched = np.flatnonzero(better[:-1] | better[1:])
        bad = touched[~judge.clear(judge.lines(changed, touched))]
        if not len(bad):
            return changed
        better = _narrowed(better, bad)
    return knots


def _narrowed(better: BoolArray, bad: IntArray) -> BoolArray:
    """Knots to change, without those at intervals that are not clear."""
    kept = better.copy()
    kept[bad] = kept[bad + 1] = False
    return kept
