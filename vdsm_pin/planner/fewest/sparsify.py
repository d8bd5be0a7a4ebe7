"""Knees taken away from a motion along the path, as long as it stays clear.

A joint is put in line with the bent joints before and after it, along as much of the
path as keeps clearance and limits. Its neighbours bend more for it, so a gentle curve
of many knees becomes a polygon of few.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.planner.fewest.charts import coordinates, in_line
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners, is_directed, standing

ROUNDS: Final = 3
"""Rounds over all joints."""


def sparser(judge: Judge, corners: Corners) -> Corners:
    """The motion with fewer changed angles where the tip draws, every interval clear.

    Args:
        judge: Says what is clear.
        corners: The motion; given by directions, it comes back by projections where all
            of it can be.
    """
    corners = projected(judge, corners)
    arm = judge.problem.manipulator
    on = np.append(corners.drawn, False) | np.append(False, corners.drawn)
    for _ in range(ROUNDS):
        before = corners
        for joint in range(1, arm.n_links):
            corners = _without(judge, corners, joint, on)
        if corners is before:
            break
    return corners


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


def _without(judge: Judge, corners: Corners, joint: int, on: BoolArray) -> Corners:
    """Corners with a joint straight where that can be; the same object if nowhere."""
    arm = judge.problem.manipulator
    trial = corners.offsets.copy()
    rows = np.flatnonzero(on)
    trial[rows] = in_line(arm, corners.tips[rows], corners.offsets[rows], joint)
    _, before, _ = judge.look(corners.tips[rows], corners.offsets[rows])
    clearances, after, _ = judge.look(corners.tips[rows], trial[rows])
    better = np.zeros(len(on), dtype=np.bool_)
    better[rows] = (clearances >= judge.required) & (after < before)
    # The start is where it is.
    better[0] = False
    while better.any():
        offsets = np.where(better[:, None, None], trial, corners.offsets)
        changed = replace(corners, offsets=offsets)
        touched = np.flatnonzero(better[:-1] | better[1:])
        bad = touched[~judge.clear(judge.lines(changed, touched))]
        if not len(bad):
            return changed
        better = _narrowed(better, bad)
    return corners


def _narrowed(better: BoolArray, bad: IntArray) -> BoolArray:
    """Corners to change, without those at intervals that are not clear."""
    kept = better.copy()
    kept[bad] = kept[bad + 1] = False
    return kept
