"""Step 5 taken apart at one waypoint: the cross through P'_i and its four points."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.joint_paths import SideRule
from vdsm_pin.planner.paper.region_kernels import leave_along

DIRECTIONS: Final = np.array([[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]])
"""From P'_i up, down, to larger and to smaller y."""

NAMES: Final = "up", "down", "right", "left"
"""The same in words."""


JOINED: Final = 1e-9
"""Points this near are one; [m]."""

ARC_POINTS: Final = 24
"""Of a way along a circle."""


@dataclass(frozen=True)
class Cross:
    """How one joint gets its place in the projection (Eq. 8-10).

    Args:
        joint: Its number, from 1.
        proportional: P'_i, shape (2,); [m].
        former: P_i at the waypoint before, shape (2,); [m].
        place: P_i, shape (2,); [m].
        region: The danger region of this joint, grown by its margin.
        points: Where the cross through P'_i meets the boundary, as `DIRECTIONS`, shape
            (4, 2); NaN where P'_i is outside; [m].
    """

    joint: int
    proportional: FloatArray
    former: FloatArray
    place: FloatArray
    region: DangerRegion
    points: FloatArray

    @property
    def moved(self) -> bool:
        """Whether P'_i lies in the danger region."""
        return bool(np.isfinite(self.points).all())

    @property
    def nearest(self) -> int:
        """Which of the four points is nearest to the former P_i: the paper's words."""
        return int(np.argmin(np.linalg.norm(self.points - self.former, axis=1)))

    @property
    def way(self) -> FloatArray:
        """From P'_i to P_i: on the circle about P_1 or straight, shape (n, 2); [m]."""
        ends = np.stack([self.proportional, self.place])
        radii = np.linalg.norm(ends, axis=1)
        if not abs(radii[1] - radii[0]) < JOINED:
            return ends
        begin, end = np.unwrap(np.arctan2(ends[:, 1], ends[:, 0]))
        turns = np.linspace(begin, end, ARC_POINTS)
        return np.asarray(radii[0] * np.column_stack([np.cos(turns), np.sin(turns)]))

    @property
    def taken(self) -> str:
        """Which point became P_i."""
        gaps = np.linalg.norm(self.points - self.place, axis=1)
        best = int(np.argmin(gaps))
        return NAMES[best] if gaps[best] < JOINED else "on another line"


def crosses(
    arm: Manipulator, rule: SideRule, former: FloatArray, planar: FloatArray
) -> tuple[Cross, ...]:
    """All joints from the one next to the tip down to joint 2.

    Args:
        arm: The arm with its ratios.
        rule: How joints get out of the region on this side.
        former: P_1..P_{N+1} at the waypoint before, shape (N + 1, 2); [m].
        planar: The same at this waypoint.
    """
    found = []
    for i in range(arm.n_links, 1, -1):
        proportional = arm.ratio(i, i + 1) * planar[i]
        margin = max(rule.margins[i - 2], rule.margins[i - 1])
        region = rule.region.grown(float(margin))
        points = np.full((4, 2), np.nan)
        if region.contains(proportional[None])[0]:
            points = np.stack([leave(region, proportional, u) for u in DIRECTIONS])
        place = former[i - 1], planar[i - 1]
        found.append(Cross(i, proportional, *place, region, points))
    return tuple(found)


def leave(region: DangerRegion, point: FloatArray, way: FloatArray) -> FloatArray:
    """Where the line from a point in a direction leaves it, shape (2,); [m]."""
    far = leave_along(region.corners, region.sides, region.radius, *point, *way)
    return np.asarray(point + far * way)
