"""Compiled shortest ways over the graph of configurations (Dijkstra)."""

import heapq
from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.roadmap_kernels import (
    NEAR,
    Barred,
    Graph,
    Labels,
    is_blocked,
)


class TipLinks(NamedTuple):
    """Neighbouring tips.

    Args:
        first: Where each tip's neighbours begin, shape (k + 1,).
        links: Neighbouring tips, shape (m,).
        gaps: Distances to them over the arm's length, shape (m,); [-].
    """

    first: IntArray
    links: IntArray
    gaps: FloatArray


@compiled
def _expand(
    heap: list[tuple[float, int]],
    graph: Graph,
    tips: TipLinks,
    u: int,
    price: tuple[FloatArray, float],
    labels: Labels,
    barred: Barred,
) -> None:
    """Every move from node u; `price` is strain and turn, see `shortest_paths`."""
    strain, turn = price
    cost, parent = labels.cost, labels.parent
    tip, c = graph.node[u] // graph.n_shapes, graph.node[u] % graph.n_shapes
    corner, begin = tip * graph.n_shapes, graph.first[c]
    for e in range(begin - 1, graph.first[c + 1]):  # the first one keeps the shape
        other, turned = c, cost[u]
        if e >= begin:
            other, turned = graph.neighbours[e], turned + turn * graph.change[e]
            v = graph.place[corner + other]
            value = turned + strain[v]
            if v >= 0 and value < cost[v] and not is_blocked(u, v, barred):
                cost[v], parent[v] = value, u
                heapq.heappush(heap, (value, v))
        # Grown shapes live at one tip only: the tip moves as the shape changes.
        if other != c and c < graph.n_lattice and other < graph.n_lattice:
            continue
        for g in range(tips.first[tip], tips.first[tip + 1]):
            v = graph.place[tips.links[g] * graph.n_shapes + other]
            value = turned + tips.gaps[g] + strain[v]
            if v >= 0 and value < cost[v] and not is_blocked(u, v, barred):
                cost[v], parent[v] = value, u
                heapq.heappush(heap, (value, v))
    low, high = graph.tip_nodes[tip], graph.tip_nodes[tip + 1]
    if c > 0:
        low, high = graph.place[corner], graph.place[corner] + 1
    if c > 0 and (low < 0 or graph.lean[u] > NEAR):
        return
    for v in range(low, high):
        value = cost[u] + turn * (graph.lean[v] + graph.lean[u]) + strain[v]
        if graph.lean[v] > NEAR or not value < cost[v]:
            continue
        if not is_blocked(u, v, barred):
            cost[v], parent[v] = value, u
            heapq.heappush(heap, (value, v))


@compiled
def shortest_paths(
    source: int,
    target: int,
    graph: Graph,
    tips: TipLinks,
    strain: FloatArray,
    turn: float,
    barred: Barred,
) -> tuple[FloatArray, IntArray]:
    """Shortest ways over the whole graph from one node (Dijkstra).

    A move is either of the tip with the shape kept, or of the shape with the tip at
    rest.

    Args:
        source: Node to start from.
        target: Node at which to stop, or -1 for all.
        graph: The roadmap.
        tips: Which tips are beside each other.
        strain: Length over the arm's added for entering a node, shape (v,); [-].
        turn: Length over the arm's that a radian of change counts for; [1/rad].
        barred: Blocked edges.

    Returns:
        Length of the way to each node over the arm's (inf: none) [-], and the node
        before.
    """
    graph, tips, barred = borrowed(graph), borrowed(tips), borrowed(barred)
    count = graph.node.size
    labels = Labels(np.full(count, np.inf), np.full(count, -1))
    done = np.zeros(count, dtype=np.bool_)
    labels.cost[source] = 0.0
    heap = [(0.0, source)]
    while len(heap) > 0:
        u = heapq.heappop(heap)[1]
        if done[u]:
            continue
        done[u] = True
        if u == target:
            break
        _expand(heap, graph, tips, u, (strain, turn), labels, barred)
    return labels.cost, labels.parent
