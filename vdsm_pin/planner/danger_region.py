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

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, frozen
from vdsm_pin.planner.region_kernels import core_distances, sides_of
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
    """

    name: str
    corners: FloatArray
    radius: float

    def __post_init__(self) -> None:
        """Freeze the array."""
        object.__setattr__(self, "corners", frozen(self.corners))

    @cached_property
    def centre(self) -> FloatArray:
        """Mean of the corners, shape (2,); [m]."""
        return frozen(self.corners.mean(axis=0))

    @cached_property
    def sides(self) -> FloatArray:
        """Straight parts of the boundary, shape (n, 2 ends, 2); [m]."""
        return frozen(sides_of(self.corners, self.radius))

    def core_distance(self, chains: FloatArray) -> FloatArray:
        """Distance of polylines to the core, shape (n, m, 2) to (n,); [m]."""
        return core_distances(self.corners, chains)

    def contains(self, points: FloatArray) -> BoolArray:
        """Whether points lie inside, shape (n, 2) to (n,); the boundary is outside."""
        distance = self.core_distance(np.repeat(points[:, None], 2, axis=1))
        return np.asarray(distance < self.radius - TOLERANCES.on_boundary)

    def tangent(self, point: FloatArray, sense: int) -> tuple[FloatArray, float]:
        """Where the tangent from a point outside touches.

        Args:
            point: Shape (2,); [m].
            sense: 1 for the tangent a counterclockwise walk leaves on (region on the
                left), -1 for the other.

        Returns:
            The corner whose arc is touched, shape (2,), and the direction of the
            boundary's outward normal there; [m], [rad].
        """
        offsets = self.corners - point
        distances = np.linalg.norm(offsets, axis=1)
        bearings = np.arctan2(offsets[:, 1], offsets[:, 0])
        towards = np.arctan2(*(self.centre - point)[::-1])
        spread = np.arcsin(np.minimum(self.radius / distances, 1.0))
        swing = _wrap(bearings - towards) - sense * spread
        touched = int(np.argmin(sense * swing))
        heading = towards + swing[touched]
        return self.corners[touched], float(heading - sense * np.pi / 2.0)

    def walk(self, start: FloatArray, end: FloatArray, sense: int) -> FloatArray:
        """The taut way from start round the region to end.

        Args:
            start: Outside or on the boundary, shape (2,); [m].
            end: Outside or on the boundary, shape (2,); [m].
            sense: 1 counterclockwise, -1 clockwise.

        Returns:
            Polyline from start to end, shape (m, 2); [m].
        """
        _, leave = self.tangent(start, sense)
        _, arrive = self.tangent(end, -sense)
        turn = float(np.mod(sense * (arrive - leave), 2.0 * np.pi))
        turns = np.append(np.arange(0.0, turn, ARC_STEP), turn)
        normals = leave + sense * turns
        outward = np.stack([np.cos(normals), np.sin(normals)], axis=1)
        corners = self.corners[np.argmax(outward @ self.corners.T, axis=1)]
        # Corners of a walk lie outside the arc, so that its chords do not cut in.
        grown = self.radius / float(np.cos(0.5 * ARC_STEP))
        arcs = corners + grown * outward
        # The straight sides passed on the way, each by its two ends.
        sides = sides_of(self.corners, grown)[:, :: 1 if sense > 0 else -1]
        along = self.sides[:, 1] - self.sides[:, 0]
        bearings = np.arctan2(along[:, 1], along[:, 0]) - np.pi / 2.0
        when = np.mod(sense * (bearings - leave), 2.0 * np.pi)
        sides, when = sides[when < turn], when[when < turn]
        points = np.concatenate([arcs, sides.reshape(-1, 2)])
        order = np.argsort(np.concatenate([turns, np.repeat(when, 2)]), kind="stable")
        return np.concatenate([start[None], points[order], end[None]])


def _wrap(angle: FloatArray) -> FloatArray:
    """Angles brought into [-pi, pi); [rad]."""
    return np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
