"""What an obstacle along the rail hides from P_1, and how a path passes through it.

Seen along X, the straight arm is a ray from P_1, and the danger region throws a shadow:
a tip outside it is reached straight.
"""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.danger_region import DangerRegion


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


def visits(region: DangerRegion, points: FloatArray) -> list[Visit]:
    """Stays in the shadow along a sequence of points outside or inside, (n, 2)."""
    covered, inside = region.covers(points), region.contains(points)
    x, y = region.centre
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
