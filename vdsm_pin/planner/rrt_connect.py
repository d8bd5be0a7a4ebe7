"""RRT-Connect in joint space (Kuffner and LaValle 2000), then shortcuts.

Every edge is a straight line of joint values that `clear_line` has found clear. Limits
need no look: between two postures within them all are, since the boxes and cones of
joint angles are convex.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.joint_lines import clear_line
from vdsm_pin.planner.postures import random_postures, within_limits
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem

ROUNDS: Final = 30_000
"""Samples after which the search is given up."""
STEP: Final = 0.05
"""Longest edge: mean way of the arm's points over its length; [-]."""
NEAR: Final = 0.5
"""Part of the samples that are near the line between both ends; [-]."""
SHORTCUTS: Final = 60
"""Pairs of postures between which a shortcut is tried."""

Line: TypeAlias = Callable[[FloatArray, FloatArray], bool]
"""Whether the straight line between two postures is clear."""


class _Tree:
    """A tree of postures, or one for each root.

    Args:
        scale: What a change of each joint value counts for; [1/m], [1/rad].
        roots: Shape (k, 1 + 2N).
    """

    def __init__(self, scale: FloatArray, roots: FloatArray) -> None:
        self.scale, self.count = scale, len(roots)
        self.rows = roots.copy()
        self.parents = list(range(self.count))

    def nearest(self, row: FloatArray) -> int:
        """Number of the posture nearest to another."""
        away = (self.rows[: self.count] - row) * self.scale
        return int(np.argmin(np.einsum("ij,ij->i", away, away)))

    def add(self, row: FloatArray, parent: int) -> int:
        """The number of a new posture."""
        if self.count == len(self.rows):
            self.rows = np.concatenate([self.rows, np.zeros_like(self.rows)])
        self.rows[self.count] = row
        self.parents.append(parent)
        self.count += 1
        return self.count - 1

    def to_root(self, number: int) -> list[FloatArray]:
        """Postures from one to its root."""
        found = [self.rows[number]]
        while self.parents[number] != number:
            number = self.parents[number]
            found.append(self.rows[number])
        return found

    def extended(self, goal: FloatArray, clear: Line) -> int | None:
        """The number of a new posture nearer to a goal; None where it is not clear."""
        number = self.nearest(goal)
        here = self.rows[number]
        size = float(np.linalg.norm((goal - here) * self.scale))
        there = here + min(1.0, STEP / size) * (goal - here)
        return self.add(there, number) if clear(here, there) else None

    def joined(self, goal: FloatArray, clear: Line) -> int | None:
        """The number of the goal, grown to as far as it is clear; None if it is not."""
        number = self.nearest(goal)
        if clear(self.rows[number], goal):
            return self.add(goal, number)
        size = float(np.linalg.norm((goal - self.rows[number]) * self.scale))
        for _ in range(int(size / STEP)):
            more = self.extended(goal, clear)
            if more is None:
                return None
            number = more
        here = self.rows[number]
        return self.add(goal, number) if clear(here, goal) else None


def connected(
    problem: PlanningProblem,
    clearance: LinkClearance,
    begin: FloatArray,
    ends: FloatArray,
    need: float,
) -> FloatArray | None:
    """Rows of a motion to one of some postures; the same question has the same answer.

    Args:
        problem: The arm, its limits and the largest change per row.
        clearance: Clearance of links at given joint centres.
        begin: Joint values q = (x0, alpha1, theta1, ..), shape (1 + 2N,); [m], [rad].
        ends: Postures to end at, shape (k, 1 + 2N).
        need: Clearance to keep; [m].

    Returns:
        Shape (r, 1 + 2N), the first row the beginning, the last row one of the ends;
        None where the search is given up.

    Raises:
        OutOfTime: If the clearance function's time is over.
    """

    def clear(first: FloatArray, last: FloatArray) -> bool:
        return clear_line(problem, clearance, first, last, need) is not None

    rng = np.random.default_rng(0)
    corners = _corners(problem, clear, begin, ends, rng)
    if corners is None:
        return None
    corners = _shortened(corners, clear, rng)
    lines = [_rows(problem, *pair) for pair in pairwise(corners)]
    return np.concatenate([*lines, corners[-1][None]])


def _corners(
    problem: PlanningProblem,
    clear: Line,
    begin: FloatArray,
    ends: FloatArray,
    rng: np.random.Generator,
) -> list[FloatArray] | None:
    """Postures between which the lines are clear, from the beginning to an end."""
    ends = ends[[clear(end, end) for end in ends]] if clear(begin, begin) else ends[:0]
    for end in ends:
        if clear(begin, end):
            return [begin, end]
    arm = problem.manipulator
    lever = (arm.total_length - arm.stations[:-1]) / arm.total_length
    scale = np.append(1.0 / arm.total_length, np.repeat(lever, 2))
    trees = [_Tree(scale, begin[None]), _Tree(scale, ends)]
    for number in range(ROUNDS if len(ends) else 0):
        here, other = trees[number % 2], trees[1 - number % 2]
        sample = random_postures(arm, 1, rng)
        if rng.random() < NEAR:
            part, end = rng.random(), ends[rng.integers(len(ends))]
            middle = (1.0 - part) * begin + part * end
            sample = within_limits(arm, middle + rng.random() * (sample - middle))
        last = here.extended(sample[0], clear)
        if last is None:
            continue
        met = other.joined(here.rows[last], clear)
        if met is not None:
            found = here.to_root(last)[::-1] + other.to_root(met)[1:]
            return found if here is trees[0] else found[::-1]
    return None


def _shortened(
    corners: list[FloatArray], clear: Line, rng: np.random.Generator
) -> list[FloatArray]:
    """The corners without those that a clear line passes by."""
    for _ in range(SHORTCUTS):
        if len(corners) < 3:
            break
        first, last = np.sort(rng.integers(0, len(corners), 2))
        if last - first > 1 and clear(corners[first], corners[last]):
            corners = corners[: first + 1] + corners[last:]
    return corners


def _rows(problem: PlanningProblem, first: FloatArray, last: FloatArray) -> FloatArray:
    """Rows from one corner on, the next one left out."""
    turn = float(np.abs(last[1:] - first[1:]).max())
    count = max(1, int(np.ceil(turn / problem.planned_row_change)))
    share = np.arange(count)[:, None] / count
    return np.asarray((1.0 - share) * first + share * last)
