"""Clearance of every link at given configurations, for planners to steer by.

Planners receive it as an argument and know nothing of where it comes from.
"""

from collections.abc import Callable

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.geometry.kernels import BRACKET, LOWER, NORMAL, SCRATCH_ROWS
from vdsm_pin.geometry.obstacles import (
    STACK,
    box_distance,
    box_of,
    crossings,
    obstacle_bracket,
)
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.scene import Mesh
from vdsm_pin.tolerances import TOLERANCES


@compiled
def _inside(pieces: PackedPieces, obstacle: int, point: FloatArray) -> bool:
    root = pieces.root[obstacle]
    for c in range(3):
        if not pieces.node_low[root, c] <= point[c] <= pieces.node_high[root, c]:
            return False
    return crossings(pieces, obstacle, point[0], point[1], point[2]) % 2 == 1


@compiled
def _clearances(
    pieces: PackedPieces,
    closed: FloatArray,
    centres: FloatArray,
    radius: float,
    pad: float,
    goal: float,
) -> FloatArray:
    """Lower bounds for each configuration and link; see `link_clearance`."""
    n_samples, n_links = centres.shape[0], centres.shape[1] - 1
    n_obstacles = pieces.root.size
    result = np.full((n_samples, n_links), np.inf)
    scratch = np.zeros((SCRATCH_ROWS + 2, 3))
    box = np.zeros((2, 3))
    stack = np.zeros(STACK, np.int64)
    trial, out = np.zeros(BRACKET + 4), np.zeros(BRACKET + 4)
    normals = np.ones((n_obstacles, n_links, 3))
    for link in range(n_links):
        for sample in range(n_samples):
            ends = centres[sample, link : link + 2]
            box_of(ends, 2, box[0], box[1])
            best = np.inf
            for o in range(n_obstacles):
                if box_distance(pieces, pieces.root[o], box[0], box[1]) >= best:
                    continue
                out[NORMAL : NORMAL + 3] = normals[o, link]
                obstacle_bracket(pieces, o, ends, 2, goal, scratch, stack, trial, out)
                normals[o, link] = out[NORMAL : NORMAL + 3]
                gap = out[LOWER]
                if closed[o] > 0.0 and gap > 0.0 and _inside(pieces, o, ends[0]):
                    gap = -gap
                best = min(best, gap)
            result[sample, link] = best - radius - pad
    return result


def arithmetic_pad(problem: PlanningProblem) -> float:
    """Bound of all rounding in one clearance evaluation for this problem; [m].

    `TOLERANCES.arithmetic` holds within `TOLERANCES.scene_extent`; rounding grows in
    proportion beyond it.
    """
    arm = problem.manipulator
    sizes = [arm.total_length, *np.abs(arm.base_range)]
    for obstacle in problem.scene.obstacles:
        for piece in obstacle.pieces:
            sizes += [float(np.abs(value).max()) for value in _numbers(piece)]
    return TOLERANCES.arithmetic * max(1.0, float(max(sizes)) / TOLERANCES.scene_extent)


def _numbers(piece: object) -> list[FloatArray]:
    """The lengths and coordinates that a piece is made of; [m]."""
    names = ("points", "centre", "half_length", "radius", "offset")
    return [np.asarray(getattr(piece, n)) for n in names if hasattr(piece, n)]


def link_clearance(problem: PlanningProblem) -> Callable[[FloatArray], FloatArray]:
    """A function that measures the clearance of links in this problem's scene.

    Args:
        problem: Arm and scene.

    Returns:
        Joint centres (n, N + 1, 3) to proved lower bounds of the distance between the
        surface of each link and the nearest obstacle, shape (n, N); negative where they
        meet (there the sign alone is meant), infinite without obstacles; [m].
    """
    obstacles = problem.scene.obstacles
    pieces = pack_pieces([obstacle.pieces for obstacle in obstacles])
    closed = np.array([float(isinstance(o, Mesh) and o.watertight) for o in obstacles])
    radius, pad = problem.manipulator.link_radius, arithmetic_pad(problem)

    def clearances(centres: FloatArray) -> FloatArray:
        rows = np.ascontiguousarray(centres, dtype=np.float64)
        return _clearances(pieces, closed, rows, radius, pad, TOLERANCES.bracket_gap)

    return clearances
