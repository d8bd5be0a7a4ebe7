"""Which tips are cut off from the start: proved, as no way for the tip leads there.

Whatever the arm does, its tip keeps the body's radius and the required clearance from
every obstacle and stays within reach. Space is cut into cells; a cell is shut where no
tip can be. A tip whose cell cannot be entered from the start's through cells that are
not shut is cut off. Only cells on the most promising ways are halved, so a hole of the
body's width is found or closed without looking closely at the rest.
"""

import itertools
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray, distinct
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.planner.feasibility import curled_reach
from vdsm_pin.planner.octree import (
    DEPTH,
    DOUBTFUL,
    OPEN,
    SHUT,
    Octree,
    adjoining,
    doubt_to,
    holders,
)
from vdsm_pin.planner.upper_clearance import nearest_bounds, upper_bounds_to
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES

MOST_CELLS: Final = 60_000
"""Cells at which a search ends; it has taken a second or two by then."""
LIGHT: Final = 0.02
"""Doubt of a cell whose centre is clear over that of another; [-]."""
LIKELY: Final = 0.5
"""Cells at least so much as close as the closest on a way are halved first; [-]."""
CORNERS: Final = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
DETOUR: Final = 1.001
"""Ways with so much of the best one's doubt are looked at with it; [-]."""


class _Cells(Octree):
    """The octree over all places a tip can be."""

    def __init__(self, problem: PlanningProblem, deadline: Deadline) -> None:
        self.deadline = deadline
        arm = problem.manipulator
        low, high = arm.base_range
        solids = [obstacle.pieces for obstacle in problem.scene.obstacles]
        self.convex = pack_pieces([solid for solid in solids if len(solid) == 1])
        self.others = pack_pieces([solid for solid in solids if len(solid) != 1])
        # A way may begin and end beside its tips, and keep as much less near them.
        beside = problem.tip_tolerance
        keep = arm.least_radius + problem.required_clearance - beside
        self.inside = TOLERANCES.bracket_gap - keep
        self.reach = curled_reach(arm) + beside
        ahead = arm.total_length + beside
        self.x_low, self.x_high = low - ahead, high + ahead
        side = max(self.x_high - self.x_low, 2.0 * self.reach)
        super().__init__(np.array([self.x_low, -side / 2.0, -side / 2.0]), side)

    @property
    def state(self) -> IntArray:
        """What is proved of each cell, shape (n,)."""
        return np.asarray(self.known[0])

    @property
    def middle(self) -> FloatArray:
        """What its centre has to spare, shape (n,); [m]."""
        return np.asarray(self.known[1])

    def _excess(self, upper: FloatArray) -> FloatArray:
        """Distances, known from above, less what a tip must keep; 0 counts inside."""
        self.deadline.check()
        return np.asarray(np.maximum(upper, 0.0) + self.inside)

    def look(self, codes: IntArray, levels: IntArray) -> tuple[FloatArray, ...]:
        """What is known of cells, and what their centres have to spare, shape (n,)."""
        centre, half = self.boxes(codes, levels)
        out, inside = self._extent(centre, half)
        radius = np.sqrt(3.0) * half
        upper, nearest = nearest_bounds(self.convex, centre[~out], self.deadline.end)
        other, _ = nearest_bounds(self.others, centre[~out], self.deadline.end)
        middle = np.full(len(codes), np.inf)
        middle[~out] = self._excess(np.minimum(upper, other))
        shut = out | (middle + radius < 0.0)
        state = np.where(inside & (middle >= radius), OPEN, DOUBTFUL)
        # Outside a convex solid some corner is farther than the centre by half a side.
        value = self._excess(upper)
        worth = ~shut[~out] & ((value + half[~out] < 0.0) | (value <= self.inside))
        some = np.flatnonzero(~out)[worth]
        shut[some] = self._in_one(centre[some], half[some], nearest[worth])
        return np.where(shut, SHUT, state), np.minimum(middle, self.side)

    def _extent(self, centre: FloatArray, half: FloatArray) -> tuple[BoolArray, ...]:
        """Whether cells are beyond reach as a whole, and whether within as a whole."""
        off = np.abs(centre[:, 1:])
        least = np.hypot(*np.maximum(off - half[:, None], 0.0).T)
        most = np.hypot(*(off + half[:, None]).T)
        low, high = centre[:, 0] - half, centre[:, 0] + half
        out = (least > self.reach) | (low > self.x_high) | (high < self.x_low)
        inside = (most <= self.reach) & (low >= self.x_low) & (high <= self.x_high)
        return np.asarray(out), np.asarray(inside)

    def _in_one(
        self, centre: FloatArray, half: FloatArray, obstacle: IntArray
    ) -> BoolArray:
        """Whether all corners of cells are too close to one convex obstacle each.

        The distance to a convex solid is largest at a corner.
        """
        corners = (centre[:, None] + half[:, None, None] * CORNERS).reshape(-1, 3)
        which = np.repeat(obstacle, len(CORNERS))
        upper = upper_bounds_to(self.convex, corners, which, self.deadline.end)
        return np.asarray((self._excess(upper).reshape(-1, 8) < 0.0).all(axis=1))

    def holders(self, points: FloatArray) -> IntArray:
        """Cells that hold points, shape (n,); -1 outside of all."""
        place = np.floor((points - self.corner) / self.side * 2.0**DEPTH)
        inside = ((place >= 0.0) & (place < 2.0**DEPTH)).all(axis=1)
        found = np.full(len(points), -1)
        found[inside] = holders(self.codes, place[inside].astype(np.int64))
        return found

    def sizes(self) -> FloatArray:
        """Side of every cell; [m]."""
        return np.asarray(self.side / 2.0**self.levels)

    def closest(self, chosen: IntArray) -> IntArray:
        """Of some cells those that come near the closest to an obstacle."""
        middle = self.middle[chosen]
        least = float(middle.min())
        return chosen[middle <= LIKELY * least] if least < 0.0 else chosen


def cut_off(
    problem: PlanningProblem,
    tips: FloatArray,
    deadline: Deadline = NO_LIMIT,
) -> BoolArray:
    """Which tips no way leads to from the start, see `CutOffProof`; shape (n,)."""
    return CutOffProof(problem, tips).proved(deadline)


class CutOffProof:
    """Which tips no way leads to from the start; proved, but not every such tip found.

    Args:
        problem: Arm, scene, start, required clearance.
        tips: Shape (n, 3); [m].
    """

    def __init__(self, problem: PlanningProblem, tips: FloatArray) -> None:
        self.problem, self.tips = problem, tips
        self._cells: _Cells | None = None

    def proved(self, deadline: Deadline) -> BoolArray:
        """Which tips are cut off, shape (n,); cells that are known are kept.

        Cells are halved until every tip is reached or cut off, or there are too many.

        Args:
            deadline: When to stop; asked again the search goes on from there.

        Raises:
            OutOfTime: If the time is over.
        """
        if self._cells is None:
            self._cells = _Cells(self.problem, deadline)
        cells = self._cells
        cells.deadline = deadline
        while True:
            deadline.check()
            known, likely = self._looked(cells)
            if not likely.size:
                return known
            cells.split(cells.closest(likely))

    def _looked(self, cells: _Cells) -> tuple[BoolArray, IntArray]:
        """Which tips are cut off by what is known, and the cells to halve next."""
        start = cells.holders(self.problem.path.start[None])
        if start[0] < 0:  # no arm stands there
            return np.zeros(len(self.tips), dtype=np.bool_), start[:0]
        goals = cells.holders(self.tips)
        # A cell whose centre is clear hardly ever ends a way.
        light = np.where(cells.middle < 0.0, 1.0, LIGHT)
        doubt = np.where(cells.state == DOUBTFUL, cells.sizes() * light, 0.0)
        first, neighbours = adjoining(cells.codes, cells.levels, cells.state != SHUT)
        there = doubt_to(start, first, neighbours, doubt)
        need = np.where(goals >= 0, there[goals], 0.0)
        closed = np.asarray(~np.isfinite(need))
        open_ = distinct(goals[(need > 0.0) & ~closed])
        if not open_.size or cells.codes.size > MOST_CELLS:
            return closed, open_[:0]
        through = there + doubt_to(open_, first, neighbours, doubt) - doubt
        good = (cells.state == DOUBTFUL) & (cells.levels < DEPTH)
        good &= through <= DETOUR * float(there[open_].min())
        return closed, np.flatnonzero(good)
