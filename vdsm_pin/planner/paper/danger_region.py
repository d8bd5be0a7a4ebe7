"""The danger region: a convex section grown to where joint centres may not go.

It is the hull of the section's corners grown by one radius (that of the section, the
body's, required clearance, margin), so its boundary is made of exact arcs and straight
sides. A joint that would fall inside slides along an auxiliary line onto the boundary
(paper, 4.3); the tip walks along the boundary (4.2.3). An obstacle's section is such a
region itself, not grown yet.

Seen along X, the straight arm is a ray from P_1, and the region throws a shadow: a tip
outside it is reached straight.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
import shapely

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, freeze, frozen, read_only
from vdsm_pin.planner.paper.region_kernels import (
    Core,
    core_distances,
    core_gaps,
    sides_of,
)
from vdsm_pin.planner.paper.way_kernels import covered, walk_round
from vdsm_pin.tolerances import TOLERANCES

ARC_STEP: Final = float(np.deg2rad(0.25))
"""Turn between two corners of a walk along an arc; [rad]."""


@dataclass(frozen=True)
class Visit:
    """Waypoints first to last (included) of the path that lie in the shadow in a row.

    Args:
        first: First waypoint.
        last: Last waypoint.
        entry: Edge by which the path came in, 1 or -1; 0 if it begins inside.
        exit: Edge by which it leaves; 0 if it ends inside.
    """

    first: int
    last: int
    entry: int
    exit: int


@dataclass(frozen=True)
class DangerRegion:
    """Convex hull of corners, grown by a radius, in a projection plane.

    Args:
        name: Name of the obstacle.
        corners: Counterclockwise, shape (n, 2), n >= 1; [m].
        radius: 0 or more, of what is walked round or covers anything above 0; [m].
        centres: Of the obstacles that it stands for, where there are several, shape
            (k, 2); [m].
    """

    name: str
    corners: FloatArray
    radius: float
    centres: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the array."""
        freeze(self, "corners")

    @cached_property
    def centre(self) -> FloatArray:
        """Mean of the corners, shape (2,); [m]."""
        return frozen(self.corners.mean(axis=0))

    @cached_property
    def middle(self) -> FloatArray:
        """Centre of the corners' bounding circle, shape (2,); [m]."""
        circle = shapely.minimum_bounding_circle(shapely.MultiPoint(self.corners))
        return frozen(np.array(circle.centroid.coords[0]))

    @cached_property
    def sides(self) -> FloatArray:
        """Straight parts of the boundary, shape (n, 2 ends, 2); [m]."""
        return frozen(sides_of(self.corners, self.radius))

    @property
    def core(self) -> Core:
        """The region, as compiled code takes it."""
        return Core(self.corners, self.radius)

    def grown(self, margin: float) -> "DangerRegion":
        """The same region, farther out by a margin; [m]."""
        return replace(self, radius=self.radius + margin)

    def rounded(self, rounding: float) -> "DangerRegion":
        """A larger region with blunter corners.

        The corners shrink towards the middle by that part while the radius grows to
        make up for it: 0 leaves the region alone, 1 gives its enclosing circle.
        """
        if rounding == 0.0 or len(self.corners) == 1:
            return self
        offset = self.corners - self.middle
        reach = float(np.linalg.norm(offset, axis=1).max())
        if rounding == 1.0:
            offset = offset[:1] * 0.0
        corners = self.middle + (1.0 - rounding) * offset
        return replace(self, corners=corners, radius=self.radius + rounding * reach)

    def core_distance(self, chains: FloatArray) -> FloatArray:
        """Distance of polylines to the core, shape (n, m, 2) to (n,); [m]."""
        return np.asarray(self.link_distances(chains).min(axis=1))

    def link_distances(self, chains: FloatArray) -> FloatArray:
        """Distance of each link of polylines to the core, (n, m, 2) to (n, m - 1)."""
        return core_distances(self.corners, read_only(chains))

    def contains(self, points: FloatArray) -> BoolArray:
        """Whether points lie inside, shape (n, 2) to (n,); the boundary is outside."""
        gaps = core_gaps(self.corners, read_only(points))
        return np.asarray(gaps < self.radius - TOLERANCES.on_boundary)

    def covers(self, points: FloatArray) -> BoolArray:
        """Whether points outside lie behind the region as seen from P_1, (n,)."""
        touch = self.radius - TOLERANCES.on_boundary
        return covered(self.core, self.centre, touch, read_only(points))

    def visits(self, points: FloatArray) -> list[Visit]:
        """Stays in the shadow along a sequence of points outside or inside, (n, 2)."""
        covered, inside = self.covers(points), self.contains(points)
        x, y = self.centre
        # Left or right of the ray from P_1 through the region's centre.
        side = np.where(x * points[:, 1] - y * points[:, 0] > 0.0, 1, -1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], covered, [False]])))
        found = []
        for first, last in zip(edges[::2], edges[1::2] - 1, strict=True):
            entry = exit_ = 0
            if first > 0 and not inside[first - 1]:
                entry = int(side[first - 1])
            if last + 1 < len(points) and not inside[last + 1]:
                exit_ = int(side[last + 1])
            found.append(Visit(int(first), int(last), entry, exit_))
        return found

    def walk(self, start: FloatArray, end: FloatArray, sense: int) -> FloatArray:
        """The taut way from start round the region to end.

        Args:
            start: Outside or on the boundary, shape (2,); [m].
            end: Outside or on the boundary, shape (2,); [m].
            sense: 1 counterclockwise, -1 clockwise.

        Returns:
            Polyline from start to end, shape (m, 2); [m].
        """
        ends = read_only(start), read_only(end)
        return walk_round(self.core, self.centre, *ends, sense, ARC_STEP)
