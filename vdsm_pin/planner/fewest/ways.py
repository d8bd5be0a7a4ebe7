"""Compiled shortest ways over the graph of configurations (Dijkstra)."""

import heapq

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.planner.fewest.kernels import NEAR, is_blocked


@compiled
def shortest_ways(
    source: int,
    target: int,
    n_shapes: int,
    n_lattice: int,
    index: IntArray,
    node: IntArray,
    tip_first: IntArray,
    tip_links: IntArray,
    tip_gap: FloatArray,
    first: IntArray,
    neighbours: IntArray,
    change: FloatArray,
    lean: FloatArray,
    strain: FloatArray,
    tip_nodes: IntArray,
    arm: float,
    flagged: BoolArray,
    blocked: IntArray,
) -> tuple[FloatArray, IntArray]:
    """Shortest ways over the whole graph from one node (Dijkstra).

    A move is either of the tip with the shape kept, or of the shape with the tip at
    rest.

    Args:
        source: Node to start from.
        target: Node at which to stop, or -1 for all.
        n_shapes: Number of shapes n.
        n_lattice: Number of shapes that exist at every tip; the others come after.
        index: Node of each (tip, shape) or -1, shape (k * n,).
        node: Number tip * n + shape of each node, shape (v,).
        tip_first: Neighbour rows of the tips, shape (k + 1,).
        tip_links: Neighbouring tips.
        tip_gap: Distances to them; [m].
        first: Neighbour rows of the shapes.
        neighbours: See `Shapes`.
        change: See `Shapes`.
        lean: Sum of the knees' angles, joint 1 left out, shape (v,); [rad].
        strain: Length added for entering a node, shape (v,); [m].
        tip_nodes: Where each tip's nodes begin, shape (k + 1,).
        arm: Length that turns a change into a distance; [m].
        flagged: Nodes with a blocked edge, shape (v,).
        blocked: Sorted keys of blocked edges.

    Returns:
        Length of the way to each node (inf: none) [m], and the node before.
    """
    length = np.full(node.size, np.inf)
    before = np.full(node.size, -1)
    done = np.zeros(node.size, dtype=np.bool_)
    length[source] = 0.0
    heap = [(0.0, source)]
    while len(heap) > 0:
        reached, u = heapq.heappop(heap)
        if done[u]:
            continue
        done[u] = True
        if u == target:
            break
        tip, c = node[u] // n_shapes, node[u] % n_shapes
        for e in range(tip_first[tip], tip_first[tip + 1]):
            v = index[tip_links[e] * n_shapes + c]
            if v < 0 or done[v]:
                continue
            value = reached + tip_gap[e] + strain[v]
            if value < length[v] and not is_blocked(u, v, flagged, blocked):
                length[v], before[v] = value, u
                heapq.heappush(heap, (value, v))
        for e in range(first[c], first[c + 1]):
            v = index[tip * n_shapes + neighbours[e]]
            if v >= 0 and not done[v]:
                value = reached + arm * change[e] + strain[v]
                if value < length[v] and not is_blocked(u, v, flagged, blocked):
                    length[v], before[v] = value, u
                    heapq.heappush(heap, (value, v))
            # Grown shapes live at one tip only: the tip moves as the shape changes.
            if c < n_lattice and neighbours[e] < n_lattice:
                continue
            for g in range(tip_first[tip], tip_first[tip + 1]):
                v = index[tip_links[g] * n_shapes + neighbours[e]]
                if v < 0 or done[v]:
                    continue
                value = reached + arm * change[e] + tip_gap[g] + strain[v]
                if value < length[v] and not is_blocked(u, v, flagged, blocked):
                    length[v], before[v] = value, u
                    heapq.heappush(heap, (value, v))
        low, high = tip_nodes[tip], tip_nodes[tip + 1]
        if c > 0:
            high = low
            v = index[tip * n_shapes]
            if v >= 0 and lean[u] <= NEAR:
                low, high = v, v + 1
        for v in range(low, high):
            value = reached + arm * (lean[v] + lean[u]) + strain[v]
            if done[v] or value >= length[v] or lean[v] > NEAR:
                continue
            if not is_blocked(u, v, flagged, blocked):
                length[v], before[v] = value, u
                heapq.heappush(heap, (value, v))
    return length, before
