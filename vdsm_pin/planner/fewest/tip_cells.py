"""Cells of space that a tip can pass, and the cheapest way through them.

A cell costs its size, and more the narrower it is there for the body; where nobody
knows yet, it is thought wide. Dijkstra's cheapest way is halved cell by cell until all
of it is known to be clear. A cell is passed at its centre or, where that is too near
an obstacle, at a place in it farther away: slots far thinner than cells are found so.
"""

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.broad_phase import BroadPhase
from vdsm_pin.planner.feasibility import curled_reach
from vdsm_pin.planner.octree import (
    DEPTH,
    Octree,
    adjoining,
    doubt_to,
    holders,
)
from vdsm_pin.problem.held import TIP

LEAST: Final = 0.05
"""Cells smaller than this part of the body's radius are not halved; [-]."""
NARROW: Final = 0.3
"""Room below this part of the body's radius makes a way costly; [-]."""


class TipRoom(NamedTuple):
    """What a tip has to spare, at points and on lines.

    Args:
        arm: The arm.
        clearance: The clearance function, exact also where it is too small.
        required: Clearance that the tip must keep; [m].
    """

    arm: Manipulator
    clearance: BroadPhase
    required: float

    @property
    def near(self) -> "TipRoom":
        """The same, exact only where the room is not above what is narrow."""
        radius = self.arm.most_radius
        # Surfaces are never farther below than all of the body.
        clearance = replace(self.clearance, floor=-2.0 * radius)
        return self._replace(clearance=clearance.up_to(self.required + NARROW * radius))

    def spare(self, points: FloatArray, ends: FloatArray | None = None) -> FloatArray:
        """At points, or on lines from them to ends, (n, 3) each to (n,); [m]."""
        ends = points if ends is None else ends
        clearances = self.clearance(np.stack([points, ends], axis=1), TIP)[:, 0]
        return np.asarray(clearances - self.required)

    def narrowest(self, route: FloatArray) -> FloatArray:
        """The inner place of a route with the least clearance, shape (3,); [m]."""
        inner = route[1:-1] if len(route) > 2 else route
        return np.asarray(inner[int(np.argmin(self.spare(inner)))])


DETOUR: Final = 0.01
"""Doubtful cells on ways that cost so much more than the best are halved too; [-]."""
LONGEST: Final = 2.0
"""Length of a way, over the arm's, from which on that is no more; [-]."""
MORE: Final = 5.0
"""How many times more that is at the largest number of cells; [-]."""
AVOIDED: Final = 5.0
"""Cost of the cells near a place to be avoided, in their own, for each time that it is;
[-]."""
AROUND: Final = 2.0
"""How near that is, over the body's radius; [-]."""
CAP: Final = 0.6
"""Room below this part of what is narrow costs no more; [-]."""
SMALL: Final = 1.0
"""Half the side, over the body's radius, of the largest cells that are passed at
another place than their centre: larger ones are halved; [-]."""
PROBE: Final = 0.02
"""Step along which the slope of the room is measured, over half a cell's side; [-]."""


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

    def look(self, codes: IntArray, levels: IntArray) -> tuple[FloatArray, ...]:
        """What the tip has to spare at centres, at places, and these places; [m].

        Returns:
            Shapes (n,), (n,) and (n, 3).
        """
        centre, half = self.boxes(codes, levels)
        # From within a solid a tip that is clear is at least so far away.
        least = -self.radius - self.room.required
        spare = np.maximum(self.room.spare(centre), least)
        out = np.hypot(centre[:, 1], centre[:, 2]) - self.reach
        spare[out > np.sqrt(2.0) * half] = -np.inf
        best, place = spare.copy(), centre.copy()
        some = (spare < 0.0) & (spare > least) & (spare + np.sqrt(3.0) * half >= 0.0)
        if some.any():
            place[some], best[some] = self._away(centre[some], half[some], spare[some])
        return spare, best, place

    def _away(
        self, centre: FloatArray, half: FloatArray, spare: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """A place of each cell on the line up the room's slope, and the room there.

        Args:
            centre: Of the cells, shape (n, 3); [m].
            half: Half their sides, shape (n,); [m].
            spare: Room at the centres, shape (n,); [m].
        """
        probes = centre[:, None] + PROBE * half[:, None, None] * np.eye(3)
        slope = self.room.spare(probes.reshape(-1, 3)).reshape(-1, 3) - spare[:, None]
        slope = np.where(np.isfinite(slope), slope, 0.0)
        most = np.abs(slope).max(axis=1, keepdims=True)
        way = slope / np.where(most > 0.0, most, 1.0) * half[:, None]
        far = np.linalg.norm(way, axis=1)
        # The room rises by as much as one goes, then falls by as much.
        rise = self.room.spare(centre + way) - spare
        part = np.clip((1.0 + rise / np.maximum(far, PROBE * half)) / 2.0, 0.0, 1.0)
        place = centre + part[:, None] * way
        best = self.room.spare(place)
        worse = ~(best > spare)
        place[worse], best[worse] = centre[worse], spare[worse]
        return place, best

    def costs(self, shortest: bool = False) -> tuple[FloatArray, BoolArray]:
        """Cost of passing each cell, inf where it is shut; whether it is in doubt.

        Args:
            shortest: Whether what is narrow costs no more than what is wide.
        """
        centre, half = self.boxes(self.codes, self.levels)
        (spare, best, _), radius = self.known, np.sqrt(3.0) * half
        shut = spare + radius < 0.0
        passed = (spare < 0.0) & (best >= 0.0) & (half <= SMALL * self.radius)
        doubt = ~(shut | passed) & (spare < half) & (half > LEAST * self.radius)
        shut |= ~doubt & (best < 0.0)
        # A cell that is not clear at its centre is taken for as wide as it may be.
        clearances = np.where(doubt | passed, spare + radius, best)
        narrow = NARROW * self.radius
        tight = (narrow / np.maximum(clearances, CAP * narrow)) ** 2
        cost = 2.0 * half * (1.0 if shortest else 1.0 + tight)
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

    def cheapest(
        self, start: FloatArray, goal: FloatArray, most: int, shortest: bool = False
    ) -> FloatArray | None:
        """Points on the cheapest way that is clear, shape (k, 3).

        None if there is none, or none is found with so many cells.
        """
        while True:
            cost, doubt = self.costs(shortest)
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
                cells, points = self._through(route)
                points = np.vstack([start, points, goal])
                halved = self._blocked(route, cells, points)
                if not halved.any():
                    return points
            if self.codes.size > most:
                return None
            self.split(np.flatnonzero(halved))

    def _through(self, route: IntArray) -> tuple[FloatArray, FloatArray]:
        """Where a way passes its cells, and where these points are in their order.

        It goes through the centres of the faces between cells that are clear at their
        centres, and through the clear places of the others but for the first and last.

        Returns:
            Numbers in the route, a half more on the face to the next cell, shape (m,),
            and points, shape (m, 3); [m].
        """
        centre, half = self.boxes(self.codes[route], self.levels[route])
        low = np.maximum((centre - half[:, None])[:-1], (centre - half[:, None])[1:])
        high = np.minimum((centre + half[:, None])[:-1], (centre + half[:, None])[1:])
        aside = self.known[0][route] < 0.0
        aside[[0, -1]] = False
        faces = np.flatnonzero(~aside[:-1] & ~aside[1:])
        order = np.concatenate([faces + 0.5, np.flatnonzero(aside)])
        points = [(low + high)[faces] / 2.0, self.known[2][route[aside]]]
        by = np.argsort(order)
        return order[by], np.concatenate(points)[by]

    def _blocked(
        self, route: IntArray, order: FloatArray, points: FloatArray
    ) -> BoolArray:
        """Cells to halve, as a way is blocked in them or between them.

        Args:
            route: Cells of the way, shape (k,).
            order: Where the inner points are, see `_through`, shape (m,).
            points: Of the way, both ends included, shape (m + 2, 3); [m].
        """
        near = self.room.near.spare(points[:-1], points[1:]) < 0.0
        first = np.ceil(np.append(0.0, order)).astype(np.int64)
        last = np.floor(np.append(order, len(route) - 1.0)).astype(np.int64)
        number = np.arange(len(route))
        within = (first[near, None] <= number) & (number <= last[near, None])
        half = self.side / 2.0 ** (self.levels[route] + 1.0)
        picked = np.zeros(self.codes.size, dtype=np.bool_)
        picked[route[within.any(axis=0) & (half > LEAST * self.radius)]] = True
        return picked

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
