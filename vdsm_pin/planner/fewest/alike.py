"""Edges of a roadmap that are likely to be blocked where another one is.

A search learns of blocked edges one sequence at a time, and the next sequence passes
right beside. Looking at what is alike at once spares most of those sequences.
"""

import numpy as np

from vdsm_pin.geometry.arrays import IntArray, distinct
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.planner.fewest.motion import Intervals
from vdsm_pin.planner.fewest.roadmap import Roadmap

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
