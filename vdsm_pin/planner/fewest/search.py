"""One search: a roadmap, the cheapest sequence, and again with what proved blocked.

A search learns of blocked edges one sequence at a time, and the next sequence passes
right beside. Looking at what is alike at once spares most of those sequences.
"""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners, Intervals, motion_corners
from vdsm_pin.planner.fewest.roadmap import Roadmap
from vdsm_pin.planner.fewest.route import TipRoute
from vdsm_pin.planner.fewest.sequence import Planner, reordered
from vdsm_pin.problem.planning_problem import Order


@dataclass(frozen=True)
class Found:
    """A motion that draws what it can.

    Args:
        route: The tips along the path.
        corners: The motion, every interval clear.
        skipped: Layers k whose stretch from layer k - 1 is not drawn.
    """

    route: TipRoute
    corners: Corners
    skipped: tuple[int, ...]

    @property
    def missing(self) -> float:
        """Length of the path not drawn and not proved impossible to draw; [m]."""
        gaps = np.diff(self.route.stations)
        return float(sum(gaps[k - 1] for k in self.skipped if not self.route.closed[k]))


@dataclass(frozen=True)
class Searched(Found):
    """What a search of a roadmap came to.

    Args:
        roadmap: The graph searched.
        start_node: The node the motion starts from.
        lengths: From there to each node, over the arm's length, inf if no way is
            known that is not blocked, shape (v,); [-].
        blocked: Pairs of nodes whose edges were found blocked, shape (n, 2).
    """

    roadmap: Roadmap
    start_node: int
    lengths: FloatArray
    blocked: IntArray


def search(
    judge: Judge, roadmap: Roadmap, start_node: int, rounds: int, blocked: IntArray
) -> Searched | None:
    """The cheapest sequence whose every interval is clear.

    Args:
        judge: Says which intervals are clear.
        roadmap: The graph.
        start_node: The node the motion starts from.
        rounds: Largest number of sequences tried.
        blocked: Pairs of nodes whose edges are known to be blocked, shape (n, 2).

    Returns:
        None if the rounds end or nothing is drawn.
    """
    planner = Planner(
        roadmap, judge.problem.manipulator.total_length, start_node, blocked
    )
    known: set[tuple[int, int]] = set()
    for _ in range(rounds):
        sequence = planner.sequence()
        if not any(leg.drawn for leg in sequence.legs):
            return None
        if judge.problem.path.order is Order.FREE:
            sequence = reordered(planner, sequence)
        corners = motion_corners(judge.problem.manipulator, roadmap, sequence)
        fresh = _fresh(corners.edges, known)
        good = (
            judge.clear(judge.lines(corners, fresh)) if fresh.size else np.ones(0, bool)
        )
        bad = fresh[~good]
        if not bad.size:
            return Searched(
                roadmap.route, corners, sequence.skipped, roadmap, start_node,
                planner.from_start, blocked,
            )  # fmt: skip
        known.update(_keys(corners.edges[fresh]))
        more = alike(roadmap, corners.edges[bad])
        more = more[[key not in known for key in _keys(more)]]
        known.update(_keys(more))
        good = judge.clear(lines_of(judge.problem.manipulator, roadmap, more))
        more = np.concatenate([corners.edges[bad], more[~good]])
        blocked = np.concatenate([blocked, more])
        planner.block(more, not corners.drawn[bad].all())
    return None


def _fresh(edges: IntArray, known: set[tuple[int, int]]) -> IntArray:
    """Intervals whose edge has not been looked at."""
    return np.array([k for k, e in enumerate(_keys(edges)) if e not in known], int)


def _keys(edges: IntArray) -> list[tuple[int, int]]:
    """Edges as pairs (low, high)."""
    return [(a, b) for a, b in np.sort(edges, axis=1).tolist()]


def nothing_blocked() -> IntArray:
    """No edge is known to be blocked, shape (0, 2)."""
    return np.zeros((0, 2), dtype=np.int64)


AROUND = 8
"""Layers about a blocked change of shape at which the same change is looked at."""


def alike(roadmap: Roadmap, edges: IntArray) -> IntArray:
    """What is like some edges.

    Where the tip moves with the shape kept that is every shape between the two tips,
    and where the shape changes the same change at the layers about.

    Args:
        roadmap: The graph.
        edges: Pairs of nodes, shape (n, 2).

    Returns:
        Pairs of nodes (low, high), each once, shape (m, 2).
    """
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for edge in edges:
        tips, shapes = roadmap.tips_of(edge), roadmap.shapes_of(edge)
        if shapes[0] == shapes[1]:
            pairs.append(_every_shape(roadmap, tips))
        elif (shapes < roadmap.shapes.n_lattice).all():
            pairs.append(_layers_about(roadmap, tips, shapes))
    found = np.concatenate(pairs)
    found = found[(found >= 0).all(axis=1)]
    return distinct(np.sort(found, axis=1), axis=0)


def _every_shape(roadmap: Roadmap, tips: IntArray) -> IntArray:
    """The moves between two tips, shape (m, 2)."""
    here = roadmap.nodes_at(tips[0])
    there = roadmap.nodes_of(tips[1], roadmap.shapes_of(here))
    return np.stack([here, there], axis=1)


def _layers_about(roadmap: Roadmap, tips: IntArray, shapes: IntArray) -> IntArray:
    """One change of shape near a layer, the tip at rest or drawing, shape (m, 2)."""
    route = roadmap.route
    at = np.flatnonzero(np.isin(route.layers, tips))
    if not at.size:
        return np.zeros((0, 2), dtype=np.int64)
    first, last = max(0, int(at[0]) - AROUND), int(at[-1]) + AROUND + 1
    layers = route.layers[first:last]
    one, other = (roadmap.nodes_of(layers, shape) for shape in shapes)
    rests = np.stack([one, other], axis=1)
    ahead = np.stack([one[:-1], other[1:]], axis=1)
    behind = np.stack([other[:-1], one[1:]], axis=1)
    return np.concatenate([rests, ahead, behind])


def lines_of(manipulator: Manipulator, roadmap: Roadmap, edges: IntArray) -> Intervals:
    """Edges, shape (n, 2), as straight lines in the chart."""
    tips, offsets = roadmap.poses_of(manipulator, edges.ravel())
    return Intervals(tips[::2], tips[1::2], offsets[::2], offsets[1::2])
