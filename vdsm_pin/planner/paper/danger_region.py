"""The danger region: a convex section grown to where joint centres may not go.

It is the hull of the section's corners grown by one radius (body radius, required
clearance, margin), so its boundary is made of exact arcs and straight sides. A joint
that would fall inside slides along an auxiliary line onto the boundary (paper, 4.3);
the tip walks along the boundary (4.2.3).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

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
class DangerRegion:
    """Convex hull of corners, grown by a radius above 0, in a projection plane.

    Args:
        name: Name of the obstacle.
        corners: Counterclockwise, shape (n, 2), n >= 1; [m].
        radius: [m].
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
    def sides(self) -> FloatArray:
        """Straight parts of the boundary, shape (n, 2 ends, 2); [m]."""
        return frozen(sides_of(self.corners, self.radius))

    @property
    def core(self) -> Core:
        """The region, as compiled code takes it."""
        return Core(self.corners, self.radius)

    def grown(self, margin: float) -> "DangerRegion":
        """The same region, farther out by a margin; [m]."""
        return DangerRegion(self.name, self.corners, self.radius + margin)

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
        return covered(self.corners, self.radius, self.centre, touch, read_only(points))

    def walk(self, start: FloatArray, end: FloatArray, sense: int) -> FloatArray:
        """The taut way from start round the region to end.

        Args:
            start: Outside or on the boundary, shape (2,); [m].
            end: Outside or on the boundary, shape (2,); [m].
            sense: 1 counterclockwise, -1 clockwise.

        Returns:
            Polyline from start to end, shape (m, 2); [m].
        """
        return walk_round(
            self.corners,
            self.radius,
            self.centre,
            read_only(start),
            read_only(end),
            sense,
            ARC_STEP,
        )
