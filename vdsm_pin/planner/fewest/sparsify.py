"""Knees taken away from a motion along the path, as long as it stays clear.

A joint is put in line with the bent joints before and after it, or with one of its
neighbours, whose other end moves for it, along as much of the path as keeps clearance
and limits. Its neighbours bend more for it, so a gentle curve of many knees becomes a
polygon of few.
"""

import itertools
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import BoolArray
from vdsm_pin.planner.fewest.charts import coordinates, in_line
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners, is_directed, standing
from vdsm_pin.tolerances import TOLERANCES

ROUNDS: Final = 4
"""Rounds over all joints."""
WAYS: Final = (-1, 1, 0)
"""How a joint is made straight, in this order, see `in_line`."""


def sparser(judge: Judge, corners: Corners) -> Corners:
    """The motion with fewer changed angles where the tip draws, every interval clear.

    A motion to a goal draws nothing: it has fewer all the way.

    Args:
        judge: Says what is clear.
        corners: The motion; given by directions, it comes back by projections where all
            of it can be.
    """
    begin = _Bent.of(judge, projected(judge, corners))
    joints = range(1, judge.problem.manipulator.n_links)
    both = [_in_order(judge, begin, order) for order in (joints, joints[::-1])]
    return min(both, key=lambda one: one.knees).corners


class _Bent(NamedTuple):
    """A motion and where it bends."""

    corners: Corners
    bent: BoolArray
    """Whether joints are changed at corners, shape (n, N)."""

    @classmethod
    def of(cls, judge: Judge, corners: Corners) -> "_Bent":
        bends = judge.bends(corners.tips, corners.offsets)
        return cls(corners, bends > TOLERANCES.changed_angle)

    @property
    def knees(self) -> float:
        """See `mean_knees`."""
        knees = (self.bent[:-1] | self.bent[1:]).sum(axis=1)
        length = np.abs(np.diff(self.corners.stations)) * self.corners.drawn
        if not length.any():
            length = np.full(len(knees), 1.0)
        return float(np.average(knees, weights=length))


def mean_knees(judge: Judge, corners: Corners) -> float:
    """Mean number of changed angles where the tip draws, by the length drawn.

    From a corner to the next every joint is bent that is bent at either. Where the tip
    draws nothing, all intervals count alike.
    """
    return _Bent.of(judge, corners).knees


def _in_order(judge: Judge, motion: _Bent, joints: range) -> _Bent:
    """The motion with joints made straight in an order, until none can be."""
    steps, vain, fewest = [*itertools.product(joints, WAYS)], 0, motion.knees
    for joint, way in ROUNDS * steps:
        try:
            corners = _without(judge, motion, joint, way)
        except OutOfTime:
            break
        vain += 1
        if corners is not motion.corners:
            trial = _Bent.of(judge, corners)
            if (knees := trial.knees) < fewest:
                motion, fewest, vain = trial, knees, 0
        if vain == len(steps):
            break
    return motion


def projected(judge: Judge, corners: Corners) -> Corners:
    """Corners given by projections if all links lean ahead and all ways stay clear."""
    if not is_directed(corners.offsets):
        return corners
    arm = judge.problem.manipulator
    centres = standing(arm, corners.tips, corners.offsets)
    if not (np.diff(centres[:, :, 0], axis=1) > 0.0).all():
        return corners
    offsets = coordinates(arm, centres, directed=False)
    trial = replace(corners, offsets=offsets)
    clear = judge.clear(judge.lines(trial, np.arange(len(corners.drawn))))
    return trial if clear.all() else corners


def _without(judge: Judge, motion: _Bent, joint: int, way: int) -> Corners:
    """Corners with a joint straight where that can be; the same object if nowhere.

    Args:
        judge: Says what is clear.
        motion: Its corners, and where they bend.
        joint: The joint, counted from 0.
        way: How it is made straight, see `in_line`.
    """
    arm, corners = judge.problem.manipulator, motion.corners
    tips, bent = corners.tips, motion.bent
    on = np.append(corners.drawn, False) | np.append(False, corners.drawn)
    # Where nothing is drawn, the way to a goal counts. The start is where it is.
    on |= not on.any()
    rows = 1 + np.flatnonzero((on & bent[:, joint])[1:])
    if not len(rows):
        return corners
    before, trial = bent[rows].sum(axis=1), corners.offsets.copy()
    trial[rows] = in_line(arm, tips[rows], trial[rows], joint, way)
    after = judge.bends(tips[rows], trial[rows]) > TOLERANCES.changed_angle
    fewer = after.sum(axis=1) < before
    rows, wanted = rows[fewer], bent.copy()
    wanted[rows] = after[fewer]
    # Who bends others instead from one corner to the next gains nothing.
    if not motion._replace(bent=wanted).knees < motion.knees:
        return corners
    better = np.zeros(len(on), dtype=np.bool_)
    better[rows] = judge.look(tips[rows], trial[rows]).clearances >= judge.required
    asked = better
    while better.any():
        offsets = np.where(better[:, None, None], trial, corners.offsets)
        changed = replace(corners, offsets=offsets)
        touched = (better[:-1] | better[1:]) & (asked[:-1] | asked[1:])
        intervals = np.flatnonzero(touched)
        bad = intervals[~judge.clear(judge.lines(changed, intervals))]
        if not len(bad):
            return changed
        kept = better.copy()
        kept[bad] = kept[bad + 1] = False
        better, asked = kept, better & ~kept
    return corners
