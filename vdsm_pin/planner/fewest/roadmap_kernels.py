"""Compiled: loops over the nodes of a roadmap, their links, and ways off the path.

The cheapest sequence along the path is a stage programme; off the path Dijkstra's
shortest ways lead from a node to all others.
"""

import heapq
from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray, distinct
from vdsm_pin.tolerances import TOLERANCES

NEAR = 0.26
"""Knee angles up to this are one move away from the straight arm, 15 deg; [rad]."""
GAIN = TOLERANCES.search_gain


class Graph(NamedTuple):
    """The roadmap as the compiled loops read it.

    Args:
        n_shapes: Number of shapes n.
        n_lattice: Number of shapes that exist at many tips; the others come after.
        place: `Roadmap.index`, a name that tuples have taken, shape (k * n,).
        node: tip * n + shape of each node, ascending, shape (v,).
        tip_nodes: Where each tip's nodes begin, shape (k + 1,).
        first: Neighbour rows of the shapes.
        neighbours: See `Shapes`.
        change: See `Shapes`.
        lean: Sum of the knees' angles, joint 1 left out, shape (v,); [rad].
        bent: Which joints are bent, a bit each, shape (v,).
        strain: See `Roadmap`, shape (v,); [-].
    """

    n_shapes: int
    n_lattice: int
    place: IntArray
    node: IntArray
    tip_nodes: IntArray
    first: IntArray
    neighbours: IntArray
    change: FloatArray
    lean: FloatArray
    bent: IntArray
    strain: FloatArray


class Barred(NamedTuple):
    """Edges found to be blocked.

    Args:
        flagged: Nodes with a blocked edge, shape (v,).
        keys: Sorted keys min * v + max of the edges.
    """

    flagged: BoolArray
    keys: IntArray

    @classmethod
    def none(cls, n_nodes: int) -> "Barred":
        """No edge is blocked."""
        return cls(np.zeros(n_nodes, np.bool_), np.zeros(0, np.int64))

    def more(self, edges: IntArray) -> "Barred":
        """Further edges (u, v) blocked, shape (n, 2)."""
        flagged = self.flagged.copy()
        flagged[edges.ravel()] = True
        keys = edges.min(axis=1) * flagged.size + edges.max(axis=1)
        return Barred(flagged, distinct(np.concatenate([self.keys, keys])))


class Weights(NamedTuple):
    """What the stage programme adds up.

    Args:
        turn: Cost of a radian of turning.
        still: Cost of each angle that is changed in a step at rest.
        more: Cost of a move in which more joints are bent than at either end.
        visit: Cost of a visit to the start.
        connection: Cost of a length of a connection.
        skip: Cost of a length not drawn.
        angle: Cost of a length drawn with one changed angle.
    """

    turn: float
    still: float
    more: float
    visit: float
    connection: float
    skip: float
    angle: float = 1.0


class Labels(NamedTuple):
    """Cost of every node and the node before, shape (v,) each."""

    cost: FloatArray
    parent: IntArray


FROM_START = -2
"""Stands for the node before where that is the start."""


@compiled
def is_blocked(u: int, v: int, barred: Barred) -> bool:
    """Whether the edge of two nodes is among the blocked ones."""
    if not (barred.flagged[u] and barred.flagged[v]):
        return False
    key = min(u, v) * barred.flagged.size + max(u, v)
    place = np.searchsorted(barred.keys, key)
    return bool(place < barred.keys.size and barred.keys[place] == key)


@compiled
def count_bits(mask: int) -> int:
    """How many joints are bent."""
    count = 0
    while mask:
        mask &= mask - 1
        count += 1
    return count


@compiled
def _resting(graph: Graph, weights: Weights, u: int, v: int) -> float:
    """Cost of what bends from a shape to another: all joints that are bent at either.

    Nothing is drawn, so that being near the limits is counted as on ways off the path.
    """
    one, other = graph.bent[u], graph.bent[v]
    cost = weights.still * count_bits(one | other)
    if one & ~other and other & ~one:
        cost += weights.more
    return float(cost + 0.5 * (graph.strain[u] + graph.strain[v]))


@compiled
def _drawing(graph: Graph, weights: Weights, gap: float, u: int, v: int) -> float:
    """Cost of what bends along a gap and not at its end, the node v."""
    one, other = graph.bent[u], graph.bent[v]
    left = one & ~other
    if not left:
        return 0.0
    cost = weights.angle * gap * count_bits(left)
    return cost + (weights.more if other & ~one else 0.0)


@compiled
def _settle(
    graph: Graph, tip: int, weights: Weights, labels: Labels, barred: Barred
) -> None:
    """Moves of the arm while the tip rests, until nothing gets cheaper."""
    low, high = graph.tip_nodes[tip], graph.tip_nodes[tip + 1]
    cost, parent, corner = labels.cost, labels.parent, tip * graph.n_shapes
    straight = graph.place[corner]
    better, sweep = True, 0
    while better:
        better = False
        for step in range(high - low):
            v = low + step if sweep % 2 == 0 else high - 1 - step
            c = graph.node[v] - corner
            for e in range(graph.first[c], graph.first[c + 1]):
                u = graph.place[corner + graph.neighbours[e]]
                if u < 0:
                    continue
                value = cost[u] + weights.turn * graph.change[e]
                if not value < cost[v] - GAIN:
                    continue
                value += _resting(graph, weights, u, v)
                if value < cost[v] - GAIN and not is_blocked(u, v, barred):
                    cost[v], parent[v], better = value, u, True
            if straight >= 0 and v != straight and graph.lean[v] <= NEAR:
                a, b = (straight, v) if cost[straight] < cost[v] else (v, straight)
                value = cost[a] + weights.turn * graph.lean[v]
                value += _resting(graph, weights, a, b)
                if value < cost[b] - GAIN and not is_blocked(a, b, barred):
                    cost[b], parent[b], better = value, a, True
        sweep += 1


@compiled
def _draw(
    graph: Graph,
    before: int,
    tip: int,
    weights: Weights,
    gap: float,
    labels: Labels,
    barred: Barred,
) -> None:
    """Moves from one layer's tip to the next one's, the node come to not yet counted.

    Joints bent at the node left alone are bent in between too, and counted here.

    Args:
        graph: The roadmap.
        before: The tip before.
        tip: This tip.
        weights: What moves cost.
        gap: Path length in between over the arm's length; [-].
        labels: Costs so far.
        barred: Blocked edges.
    """
    cost, parent, corner = labels.cost, labels.parent, before * graph.n_shapes
    straight, turn = graph.place[corner], weights.turn
    for v in range(graph.tip_nodes[tip], graph.tip_nodes[tip + 1]):
        c = graph.node[v] - tip * graph.n_shapes
        u = graph.place[corner + c]
        if u >= 0 and cost[u] < cost[v] and not is_blocked(u, v, barred):
            value = cost[u] + _drawing(graph, weights, gap, u, v)
            if value < cost[v]:
                cost[v], parent[v] = value, u
        for e in range(graph.first[c], graph.first[c + 1]):
            u = graph.place[corner + graph.neighbours[e]]
            if u < 0:
                continue
            value = cost[u] + turn * graph.change[e]
            if not value < cost[v]:
                continue
            value += _drawing(graph, weights, gap, u, v)
            if value < cost[v] and not is_blocked(u, v, barred):
                cost[v], parent[v] = value, u
        low, high = graph.tip_nodes[before], graph.tip_nodes[before + 1]
        if c > 0:
            # Shapes near the straight arm and it are one move from each other.
            near = straight >= 0 and graph.lean[v] <= NEAR
            low, high = straight, straight + 1 if near else straight
        for u in range(low, high):
            value = cost[u] + turn * (graph.lean[v] + graph.lean[u])
            if graph.lean[u] > NEAR or not value < cost[v]:
                continue
            value += _drawing(graph, weights, gap, u, v)
            if value < cost[v] and not is_blocked(u, v, barred):
                cost[v], parent[v] = value, u


@compiled
def stage_programme(
    graph: Graph,
    layers: IntArray,
    gap: FloatArray,
    node_cost: FloatArray,
    from_start: FloatArray,
    weights: Weights,
    barred: Barred,
) -> tuple[Labels, FloatArray, IntArray]:
    """Cheapest way to draw all layers in order, with visits to the start in between.

    Args:
        graph: The roadmap.
        layers: Tip numbers in drawing order, shape (l,).
        gap: Path length from the layer before to this one over the arm's length, shape
            (l,); [-].
        node_cost: What a length drawn with this node costs, shape (v,).
        from_start: Length of the way from the start to each node, inf if none, shape
            (v,); [-].
        weights: What moves cost.
        barred: Blocked edges.

    Returns:
        cost and parent of every node; cost of being at the start after each layer and
        the node left from (-1: was there already), shape (l,).
    """
    graph, barred = borrowed(graph), borrowed(barred)
    count = graph.node.size
    labels = Labels(np.full(count, np.inf), np.full(count, -1))
    start_cost, left_from = np.full(layers.size, np.inf), np.full(layers.size, -1)
    # The first way to the path costs nothing but its length.
    at_start = -weights.visit
    for k in range(layers.size):
        tip = layers[k]
        if k > 0:
            _draw(graph, layers[k - 1], tip, weights, gap[k], labels, barred)
            for v in range(graph.tip_nodes[tip], graph.tip_nodes[tip + 1]):
                labels.cost[v] += node_cost[v] * gap[k]
            at_start += weights.skip * gap[k]
        _settle(graph, tip, weights, labels, barred)
        entered = False
        for v in range(graph.tip_nodes[tip], graph.tip_nodes[tip + 1]):
            value = labels.cost[v] + weights.connection * from_start[v]
            if value < at_start:
                at_start, left_from[k] = value, v
        start_cost[k] = at_start
        for v in range(graph.tip_nodes[tip], graph.tip_nodes[tip + 1]):
            value = at_start + weights.visit + weights.connection * from_start[v]
            if value < labels.cost[v]:
                labels.cost[v], labels.parent[v], entered = value, FROM_START, True
        if entered:
            _settle(graph, tip, weights, labels, barred)
    return labels, start_cost, left_from


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
