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
import shapely

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, frozen
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
    def core(self) -> shapely.Geometry:
        """The hull before it is grown."""
        return shapely.MultiPoint(self.corners).convex_hull

    @cached_property
    def centre(self) -> FloatArray:
        """Centroid of the core, shape (2,); [m]."""
        return frozen(shapely.get_coordinates(self.core.centroid)[0])

    @cached_property
    def sides(self) -> FloatArray:
        """Straight parts of the boundary, shape (n, 2 ends, 2); [m]."""
        if len(self.corners) == 1:
            return np.zeros((0, 2, 2))
        ends = np.stack([self.corners, np.roll(self.corners, -1, axis=0)], axis=1)
        along = ends[:, 1] - ends[:, 0]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        return ends + self.radius * outward[:, None]

    def core_distance(self, chains: FloatArray) -> FloatArray:
        """Distance of polylines to the core, shape (n, m, 2) to (n,); [m]."""
        if len(self.corners) == 1:
            return _point_distance(chains - self.corners[0])
        return np.asarray(shapely.distance(self.core, shapely.linestrings(chains)))

    def contains(self, points: FloatArray) -> BoolArray:
        """Whether points lie inside, shape (n, 2) to (n,); the boundary is outside."""
        if len(self.corners) == 1:
            distance = np.linalg.norm(points - self.corners[0], axis=1)
        else:
            distance = shapely.distance(self.core, shapely.points(points))
        return np.asarray(distance < self.radius - TOLERANCES.on_boundary)

    def slide(self, points: FloatArray, direction: FloatArray) -> FloatArray:
        """Move points inside along an auxiliary line onto the boundary.

        Args:
            points: Shape (n, 2); [m].
            direction: Unit vectors of the auxiliary lines, shape (n, 2) or (2,); [-].

        Returns:
            The points, those inside moved along their direction, shape (n, 2); [m].
        """
        far, near = (
            self._boundary(points, direction),
            self._boundary(points, -direction),
        )
        # `near` counts backwards; a line that misses the region gives -inf twice.
        inside = (far > 0.0) & (near > 0.0)
        shift = np.where(inside, far, 0.0)
        return points + shift[:, None] * direction

    def _boundary(self, points: FloatArray, direction: FloatArray) -> FloatArray:
        """How far along the direction the line leaves the region, (n,); -inf: never."""
        ux, uy = direction[..., 0], direction[..., 1]
        x, y = points[:, 0], points[:, 1]
        far = np.full(len(points), -np.inf)
        for cx, cy in self.corners:
            dx, dy = cx - x, cy - y
            squared = self.radius**2 - (ux * dy - uy * dx) ** 2
            root = np.sqrt(np.maximum(squared, 0.0))
            far = np.maximum(far, np.where(squared >= 0, dx * ux + dy * uy + root, far))
        for (ax, ay), (bx, by) in self.sides:
            # Sidewise offsets of the ends change sign where the line crosses the side.
            a = ux * (ay - y) - uy * (ax - x)
            b = ux * (by - y) - uy * (bx - x)
            crossed = a * b <= 0.0
            part = a / np.where(a == b, 1.0, a - b)
            hit_x, hit_y = ax - x + part * (bx - ax), ay - y + part * (by - ay)
            far = np.maximum(far, np.where(crossed, hit_x * ux + hit_y * uy, far))
        return far

    def swing(self, points: FloatArray, side: int) -> FloatArray:
        """Move points inside along circles about the origin onto the boundary.

        Args:
            points: Shape (n, 2); [m].
            side: 1 counterclockwise, -1 clockwise.

        Returns:
            The points, those inside turned, shape (n, 2); [m].
        """
        turned = points.copy()
        rows = np.flatnonzero(self.contains(points))
        radius = np.linalg.norm(points[rows], axis=1)
        bearing = np.arctan2(self.centre[1], self.centre[0])
        swung = bearing + side * self._extent(radius, side)
        turned[rows] = radius[:, None] * np.stack(
            [np.cos(swung), np.sin(swung)], axis=1
        )
        return turned

    def _extent(self, radius: FloatArray, side: int) -> FloatArray:
        """How far the region reaches along circles about the origin, (n,); [rad].

        Measured from the bearing of the centre; every circle meets the region.
        """
        bearing = np.arctan2(self.centre[1], self.centre[0])
        extent = np.full(len(radius), -np.inf)
        for corner in self.corners:
            distance = np.linalg.norm(corner)
            towards = side * _wrap(np.arctan2(corner[1], corner[0]) - bearing)
            cosine = radius**2 + distance**2 - self.radius**2
            cosine /= 2.0 * radius * distance
            met = np.abs(cosine) <= 1.0
            half = np.arccos(np.where(met, cosine, 0.0))
            extent = np.maximum(extent, np.where(met, towards + half, extent))
        for begin, end in self.sides:
            along = end - begin
            squared, half_b = along @ along, begin @ along
            root = half_b**2 - squared * (begin @ begin - radius**2)
            for sign in (1.0, -1.0):
                part = (sign * np.sqrt(np.maximum(root, 0.0)) - half_b) / squared
                hit = begin + part[:, None] * along
                met = (root >= 0.0) & (part >= 0.0) & (part <= 1.0)
                towards = side * _wrap(np.arctan2(hit[:, 1], hit[:, 0]) - bearing)
                extent = np.maximum(extent, np.where(met, towards, extent))
        return extent

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
        arcs = corners + self.radius / np.cos(0.5 * ARC_STEP) * outward
        # The straight sides passed on the way, each by its two ends.
        sides = self.sides if sense > 0 else self.sides[:, ::-1]
        along = self.sides[:, 1] - self.sides[:, 0]
        bearings = np.arctan2(along[:, 1], along[:, 0]) - np.pi / 2.0
        when = np.mod(sense * (bearings - leave), 2.0 * np.pi)
        sides, when = sides[when < turn], when[when < turn]
        points = np.concatenate([arcs, sides.reshape(-1, 2)])
        order = np.argsort(np.concatenate([turns, np.repeat(when, 2)]), kind="stable")
        return np.concatenate([start[None], points[order], end[None]])


def _point_distance(chains: FloatArray) -> FloatArray:
    """Distance of polylines to the origin, shape (n, m, 2) to (n,); [m]."""
    x, y = chains[..., 0], chains[..., 1]
    ax, ay = x[:, :-1], y[:, :-1]
    ux, uy = x[:, 1:] - ax, y[:, 1:] - ay
    squared = ux * ux + uy * uy
    part = -(ax * ux + ay * uy) / np.where(squared > 0.0, squared, 1.0)
    part = np.minimum(np.maximum(part, 0.0), 1.0)
    nearest = np.hypot(ax + part * ux, ay + part * uy)
    return np.asarray(nearest.min(axis=1))


def _wrap(angle: FloatArray) -> FloatArray:
    """Angles brought into [-pi, pi); [rad]."""
    return np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
