"""Compiled shortest ways over the graph of configurations (Dijkstra)."""

import heapq
from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.planner.fewest.kernels import NEAR, Barred, Graph, Labels, is_blocked


class TipLinks(NamedTuple):
    """Neighbouring tips.

    Args:
        first: Where each tip's neighbours begin, shape (k + 1,).
        links: Neighbouring tips, shape (m,).
        gaps: Distances to them, shape (m,); [m].
    """

    first: IntArray
    links: IntArray
    gaps: FloatArray


@compiled
def _push(
    heap: list[tuple[float, int]],
    u: int,
    v: int,
    value: float,
    labels: Labels,
    barred: Barred,
) -> None:
    """Reach v from u where that is shorter; what is done is not longer than u."""
    if value < labels.cost[v] and not is_blocked(u, v, barred):
        labels.cost[v], labels.parent[v] = value, u
        heapq.heappush(heap, (value, v))


@compiled
def _move_tip(
    heap: list[tuple[float, int]],
    graph: Graph,
    tips: TipLinks,
    u: int,
    shape: int,
    reached: float,
    strain: FloatArray,
    labels: Labels,
    barred: Barred,
) -> None:
    """Moves of node u's tip to the tips beside it, ending in a given shape."""
    tip = graph.node[u] // graph.n_shapes
    for e in range(tips.first[tip], tips.first[tip + 1]):
        v = graph.place[tips.links[e] * graph.n_shapes + shape]
        if v >= 0:
            value = reached + tips.gaps[e] + strain[v]
            _push(heap, u, v, value, labels, barred)


@compiled
def _move_arm(
    heap: list[tuple[float, int]],
    graph: Graph,
    tips: TipLinks,
    u: int,
    strain: FloatArray,
    arm: float,
    labels: Labels,
    barred: Barred,
) -> None:
    """Changes of node u's shape, between lattice shapes with the tip at rest."""
    tip, c = graph.node[u] // graph.n_shapes, graph.node[u] % graph.n_shapes
    reached = labels.cost[u]
    for e in range(graph.first[c], graph.first[c + 1]):
        other, turned = graph.neighbours[e], reached + arm * graph.change[e]
        v = graph.place[tip * graph.n_shapes + other]
        if v >= 0:
            _push(heap, u, v, turned + strain[v], labels, barred)
        # Grown shapes live at one tip only: the tip moves as the shape changes.
        if c >= graph.n_lattice or other >= graph.n_lattice:
            _move_tip(heap, graph, tips, u, other, turned, strain, labels, barred)
    low, high = graph.tip_nodes[tip], graph.tip_nodes[tip + 1]
    if c > 0:
        high = low
        straight = graph.place[tip * graph.n_shapes]
        if straight >= 0 and graph.lean[u] <= NEAR:
            low, high = straight, straight + 1
    for v in range(low, high):
        if graph.lean[v] <= NEAR:
            value = reached + arm * (graph.lean[v] + graph.lean[u]) + strain[v]
            _push(heap, u, v, value, labels, barred)


@compiled
def shortest_ways(
    source: int,
    target: int,
    graph: Graph,
    tips: TipLinks,
    strain: FloatArray,
    arm: float,
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
        strain: Length added for entering a node, shape (v,); [m].
        arm: Length that turns a change into a distance; [m].
        barred: Blocked edges.

    Returns:
        Length of the way to each node (inf: none) [m], and the node before.
    """
    count = graph.node.size
    labels = Labels(np.full(count, np.inf), np.full(count, -1))
    done = np.zeros(count, dtype=np.bool_)
    labels.cost[source] = 0.0
    heap = [(0.0, source)]
    while len(heap) > 0:
        reached, u = heapq.heappop(heap)
        if done[u]:
            continue
        done[u] = True
        if u == target:
            break
        shape = graph.node[u] % graph.n_shapes
        _move_tip(heap, graph, tips, u, shape, reached, strain, labels, barred)
        _move_arm(heap, graph, tips, u, strain, arm, labels, barred)
    return labels.cost, labels.parent
