"""Cells of space that a tip can pass, and the cheapest way through them.

A cell costs its size, and more the narrower it is there for the body; where nobody
knows yet, it is thought wide. Dijkstra's cheapest way is halved cell by cell until all
of it is known to be clear.
"""

from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.feasibility import curled_reach
from vdsm_pin.planner.fewest.tip_room import LEAST, NARROW, TipRoom
from vdsm_pin.planner.impossible.octree import (
    DEPTH,
    Octree,
    adjoining,
    doubt_to,
    holders,
)

DETOUR: Final = 0.01
"""Doubtful cells on ways that cost so much more than the best are halved too; [-]."""
LONGEST: Final = 2.0
"""Length of a way, over the arm's, from which on that is no more; [-]."""
MORE: Final = 5.0
"""How many times more that is at the largest number of cells; [-]."""
AVOIDED: Final = 30.0
"""Cost of the cells near a place to be avoided, in their own, for each time that it is;
[-]."""
AROUND: Final = 3.0
"""How near that is, over the body's radius; [-]."""
CAP: Final = 0.6
"""Room below this part of what is narrow costs no more; [-]."""


class TipCells(Octree):
    """Cells over all places a tip can be.

    Args:
        room: Clearance function and limits.
        most: Cells at which the search for a way ends.
        corner: Lowest corner of the whole, shape (3,); [m].
        side: Side of the whole; [m].
    """

    def __init__(
        self, room: TipRoom, most: int, corner: FloatArray, side: float
    ) -> None:
        self.room, self.most = room, most
        self.radius, self.reach = room.arm.most_radius, curled_reach(room.arm)
        self.longest = LONGEST * room.arm.total_length
        self.avoided: list[FloatArray] = []
        super().__init__(corner, side)

    def look(self, codes: IntArray, levels: IntArray) -> tuple[FloatArray]:
        """What the tip has to spare at the centre of each cell, shape (n,); [m]."""
        centre, half = self.boxes(codes, levels)
        # From within a solid a tip that is clear is at least so far away.
        least = -self.radius - self.room.required
        clearances = np.maximum(self.room.spare(centre), least)
        out = np.hypot(centre[:, 1], centre[:, 2]) - self.reach
        clearances[out > np.sqrt(2.0) * half] = -np.inf
        return (np.asarray(clearances),)

    def costs(self) -> tuple[FloatArray, BoolArray]:
        """Cost of passing each cell, inf where it is shut; whether it is in doubt."""
        centre, half = self.boxes(self.codes, self.levels)
        (clearances,), radius = self.known, np.sqrt(3.0) * half
        shut = clearances + radius < 0.0
        doubt = ~shut & (clearances < half) & (half > LEAST * self.radius)
        shut |= ~doubt & (clearances < 0.0)
        # A cell in doubt is taken for as wide as it may be.
        clearances = np.where(doubt, clearances + radius, clearances)
        narrow = NARROW * self.radius
        cost = 2.0 * half * (1.0 + (narrow / np.maximum(clearances, CAP * narrow)) ** 2)
        around = AROUND * self.radius + half
        times = np.zeros(len(half))
        for place in self.avoided:
            times += np.linalg.norm(centre - place, axis=1) < around
        cost *= np.where(doubt | (times == 0.0), 1.0, AVOIDED * times)
        return np.where(shut, np.inf, cost), doubt

    def holders(self, points: FloatArray) -> IntArray:
        """Cells that hold points within the whole, shape (n,)."""
        place = (points - self.corner) / self.side * 2.0**DEPTH
        return holders(self.codes, np.clip(place, 0, 2**DEPTH - 1).astype(np.int64))

    def cheapest(self, start: FloatArray, goal: FloatArray) -> FloatArray | None:
        """Points on the cheapest way that is clear, shape (k, 3); None without one."""
        while True:
            cost, doubt = self.costs()
            ends = self.holders(np.stack([start, goal]))
            open_ = np.isfinite(cost)
            open_[ends] = True
            cost[ends] = np.where(np.isfinite(cost[ends]), cost[ends], 0.0)
            first, neighbours = adjoining(self.codes, self.levels, open_)
            there = doubt_to(ends[:1], first, neighbours, cost)
            best = float(there[ends[1]])
            if not np.isfinite(best):
                return None
            back = doubt_to(ends[1:], first, neighbours, cost)
            # The more cells there are, the more are halved at once.
            detour = DETOUR * (1.0 + MORE * self.codes.size / self.most)
            detour *= min(best, self.longest)
            halved = doubt & (there + back <= best + detour + cost)
            route = self._traced(int(ends[1]), int(ends[0]), there, first, neighbours)
            if not doubt[route].any():
                points = np.vstack([start, self._through(route), goal])
                halved = self._blocked(route, points)
                if not halved.any():
                    return points
            if self.codes.size > self.most:
                return None
            self.split(np.flatnonzero(halved))

    def _blocked(self, route: IntArray, points: FloatArray) -> BoolArray:
        """Cells to halve, as a way through them is blocked near a corner of theirs.

        Args:
            route: Cells of the way, shape (k,).
            points: Where it enters and leaves them, shape (k + 1, 3); [m].
        """
        near = self.room.near.spare(points[:-1], points[1:]) < 0.0
        half = self.side / 2.0 ** (self.levels[route] + 1.0)
        picked = np.zeros(self.codes.size, dtype=np.bool_)
        picked[route[near & (half > LEAST * self.radius)]] = True
        return picked

    def _through(self, route: IntArray) -> FloatArray:
        """Centres of the faces that a way passes, shape (k - 1, 3); [m]."""
        centre, half = self.boxes(self.codes[route], self.levels[route])
        low = np.maximum((centre - half[:, None])[:-1], (centre - half[:, None])[1:])
        high = np.minimum((centre + half[:, None])[:-1], (centre + half[:, None])[1:])
        return np.asarray((low + high) / 2.0)

    @staticmethod
    def _traced(
        at: int, to: int, there: FloatArray, first: IntArray, neighbours: IntArray
    ) -> IntArray:
        """Cells of the way that a search found, from its source on."""
        route = [at]
        while route[-1] != to:
            near = neighbours[first[route[-1]] : first[route[-1] + 1]]
            route.append(int(near[np.argmin(there[near])]))
        return np.array(route[::-1])
