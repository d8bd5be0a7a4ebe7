"""A clearance function that leaves alone what is obviously far away.

Most links are far from most obstacles. Axis-parallel boxes round the obstacles and
round a few stretches of each link give a lower bound of the clearance at once; the
function passed in is asked only where that bound is small.
"""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.scene import Obstacle

FAR = 0.12
"""A bound of the clearance above this is as good as the clearance itself; [m]."""
STRETCHES = 6
"""Stretches into which a link is cut for its boxes."""
SLICES = 8
"""Boxes along a long hull or cylinder that lies askew."""


def _cut(low_end: FloatArray, high_end: FloatArray, grow: FloatArray) -> FloatArray:
    """Boxes round equal stretches of a swept line, shape (n, 2, 3)."""
    marks = np.linspace(0.0, 1.0, SLICES + 1)[:, None]
    points = low_end + marks * (high_end - low_end)
    low = np.minimum(points[:-1], points[1:]) - grow
    high = np.maximum(points[:-1], points[1:]) + grow
    return np.stack([low, high], axis=1)


def _boxes(obstacle: Obstacle) -> list[FloatArray]:
    """Boxes that cover an obstacle, each of shape (n, 2, 3)."""
    pieces = obstacle.pieces
    if len(pieces) > 16:
        points = np.vstack([piece.points for piece in pieces])  # type: ignore[union-attr]
        return [np.stack([points.min(axis=0), points.max(axis=0)])[None]]
    boxes = []
    for piece in pieces:
        if isinstance(piece, FlatCylinder):
            half = piece.half_length * piece.axis
            # A disc of unit normal a reaches r sqrt(1 - a_c^2) along axis c.
            grow = piece.radius * np.sqrt(np.maximum(0.0, 1.0 - piece.axis**2))
            boxes.append(_cut(piece.centre - half, piece.centre + half, grow))
        elif not isinstance(piece, HalfSpacePiece):
            if len(piece.points) == 2:
                grow = np.full(3, piece.radius)
                boxes.append(_cut(piece.points[0], piece.points[1], grow))
            else:
                low = piece.points.min(axis=0) - piece.radius
                high = piece.points.max(axis=0) + piece.radius
                boxes.append(np.stack([low, high])[None])
    return boxes


@compiled
def _box_bounds(
    ends: FloatArray, boxes: FloatArray, planes: FloatArray, stretches: int
) -> FloatArray:
    """Lower bounds of the distance from segments to boxes and half-spaces.

    Args:
        ends: Shape (n, 2, 3); [m].
        boxes: Low and high corners, shape (b, 2, 3); [m].
        planes: Outward normals and offsets, shape (p, 4).
        stretches: Number of stretches of each segment.
    """
    result = np.full(ends.shape[0], np.inf)
    for n in range(ends.shape[0]):
        best = np.inf
        for p in range(planes.shape[0]):
            for e in range(2):
                height = -planes[p, 3]
                for c in range(3):
                    height += planes[p, c] * ends[n, e, c]
                best = min(best, height)
        square = np.inf
        for b in range(boxes.shape[0]):
            for s in range(stretches):
                t0, t1 = s / stretches, (s + 1) / stretches
                gap = 0.0
                for c in range(3):
                    a = ends[n, 0, c] + t0 * (ends[n, 1, c] - ends[n, 0, c])
                    z = ends[n, 0, c] + t1 * (ends[n, 1, c] - ends[n, 0, c])
                    out = max(boxes[b, 0, c] - max(a, z), min(a, z) - boxes[b, 1, c])
                    if out > 0.0:
                        gap += out * out
                square = min(square, gap)
        result[n] = min(best, np.sqrt(square))
    return result


def nearby(problem: PlanningProblem, clearance: LinkClearance) -> LinkClearance:
    """The same lower bounds, exact where they are below `FAR`.

    Args:
        problem: Arm and scene.
        clearance: The clearance function.

    Returns:
        Joint centres (n, m + 1, 3) to lower bounds (n, m); [m].
    """
    covers = [box for o in problem.scene.obstacles for box in _boxes(o)]
    boxes = np.concatenate(covers) if covers else np.zeros((0, 2, 3))
    flat = [
        [*piece.normal, piece.offset]
        for obstacle in problem.scene.obstacles
        for piece in obstacle.pieces
        if isinstance(piece, HalfSpacePiece)
    ]
    planes = np.array(flat).reshape(-1, 4)
    radius = problem.manipulator.link_radius

    def bounds(centres: FloatArray) -> FloatArray:
        ends = np.stack([centres[:, :-1], centres[:, 1:]], axis=2).reshape(-1, 2, 3)
        room = _box_bounds(ends, boxes, planes, STRETCHES) - radius
        near = np.flatnonzero(room < FAR)
        if near.size:
            room[near] = clearance(np.ascontiguousarray(ends[near]))[:, 0]
        return room.reshape(len(centres), -1)

    return bounds
