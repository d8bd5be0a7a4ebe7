"""Compiled loops of the search: poses of shapes, the stage programme."""

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled

NEAR = 0.26
"""Knee angles up to this are one move away from the straight arm, 15 deg; [rad]."""
EPS = 1e-12
"""A cost must fall by more than this to count as lower, so that sweeps end."""


@compiled
def pose_shapes(
    tips: FloatArray,
    knees: IntArray,
    slopes: FloatArray,
    stations: FloatArray,
    limit: float,
    base_low: float,
    base_high: float,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Every shape at every tip, where it keeps the joint limits (Eq. 7).

    Args:
        tips: Shape (k, 3); [m].
        knees: Shape (n, 2), joints counted from 0.
        slopes: Shape (n, 4); [-].
        stations: Arc length of each joint centre, shape (N + 1,); [m].
        limit: Largest link angle; [rad].
        base_low: Smallest x0; [m].
        base_high: Largest x0; [m].

    Returns:
        node numbers tip * n + shape, ascending, shape (v,); the ends of the three
        straight pieces, shape (v, 4, 3) [m]; psi at the three bends, (v, 3) [rad].
    """
    n_tips, n_shapes, total = tips.shape[0], knees.shape[0], stations[-1]
    node = np.zeros(n_tips * n_shapes, dtype=np.int64)
    ends = np.zeros((n_tips * n_shapes, 4, 3))
    bends = np.zeros((n_tips * n_shapes, 3))
    count = 0
    for k in range(n_tips):
        tip_x, tip_y, tip_z = tips[k]
        for c in range(n_shapes):
            s1, s2 = stations[knees[c, 0]], stations[knees[c, 1]]
            y1, z1 = s1 * slopes[c, 0], s1 * slopes[c, 1]
            y2 = y1 + (s2 - s1) * slopes[c, 2]
            z2 = z1 + (s2 - s1) * slopes[c, 3]
            v3y, v3z = (tip_y - y2) / (total - s2), (tip_z - z2) / (total - s2)
            across = v3y * v3y + v3z * v3z
            if across >= 1.0:
                continue
            v3x = np.sqrt(1.0 - across)
            v1y, v1z, v2y, v2z = slopes[c]
            if knees[c, 0] == 0:
                v1y, v1z = v3y, v3z
            if knees[c, 1] == knees[c, 0]:
                v2y, v2z = v1y, v1z
            v1x = np.sqrt(1.0 - v1y * v1y - v1z * v1z)
            v2x = np.sqrt(1.0 - v2y * v2y - v2z * v2z)
            x2 = tip_x - (total - s2) * v3x
            x1 = x2 - (s2 - s1) * v2x
            x0 = x1 - s1 * v1x
            bend1 = np.arctan2(np.hypot(v1y, v1z), v1x)
            bend2 = _angle(v1x, v1y, v1z, v2x, v2y, v2z)
            bend3 = _angle(v2x, v2y, v2z, v3x, v3y, v3z)
            if not (bend1 <= limit and bend2 <= limit and bend3 <= limit):
                continue
            if not base_low <= x0 <= base_high:
                continue
            node[count] = k * n_shapes + c
            bends[count, 0], bends[count, 1], bends[count, 2] = bend1, bend2, bend3
            ends[count, 0, 0] = x0
            ends[count, 1, 0], ends[count, 1, 1], ends[count, 1, 2] = x1, y1, z1
            ends[count, 2, 0], ends[count, 2, 1], ends[count, 2, 2] = x2, y2, z2
            ends[count, 3, 0], ends[count, 3, 1] = tip_x, tip_y
            ends[count, 3, 2] = tip_z
            count += 1
    return node[:count], ends[:count], bends[:count]


@compiled
def _angle(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    cross = np.sqrt(cx * cx + cy * cy + cz * cz)
    return float(np.arctan2(cross, ax * bx + ay * by + az * bz))


@compiled
def is_blocked(u: int, v: int, flagged: BoolArray, blocked: IntArray) -> bool:
    """Whether the edge of two nodes is among the sorted keys of blocked ones."""
    if not (flagged[u] and flagged[v]):
        return False
    key = min(u, v) * flagged.size + max(u, v)
    place = np.searchsorted(blocked, key)
    return bool(place < blocked.size and blocked[place] == key)


@compiled
def _settle(
    nodes: IntArray,
    tip: int,
    n_shapes: int,
    index: IntArray,
    shape_of: IntArray,
    first: IntArray,
    neighbours: IntArray,
    change: FloatArray,
    lean: FloatArray,
    turn_cost: float,
    still_cost: float,
    flagged: BoolArray,
    blocked: IntArray,
    cost: FloatArray,
    parent: IntArray,
) -> None:
    """Moves of the arm while the tip rests, until nothing gets cheaper."""
    better = True
    sweep = 0
    straight = index[tip * n_shapes]
    while better:
        better = False
        for place in range(nodes.size):
            v = nodes[place] if sweep % 2 == 0 else nodes[nodes.size - 1 - place]
            c = shape_of[v]
            for e in range(first[c], first[c + 1]):
                u = index[tip * n_shapes + neighbours[e]]
                if u < 0:
                    continue
                value = cost[u] + turn_cost * change[e] + still_cost
                if value < cost[v] - EPS and not is_blocked(u, v, flagged, blocked):
                    cost[v], parent[v], better = value, u, True
            if straight >= 0 and v != straight and lean[v] <= NEAR:
                a, b = (straight, v) if cost[straight] < cost[v] else (v, straight)
                value = cost[a] + turn_cost * lean[v] + still_cost
                if value < cost[b] - EPS and not is_blocked(a, b, flagged, blocked):
                    cost[b], parent[b], better = value, a, True
        sweep += 1


@compiled
def stage_programme(
    layers: IntArray,
    layer_first: IntArray,
    gap: FloatArray,
    n_shapes: int,
    index: IntArray,
    shape_of: IntArray,
    first: IntArray,
    neighbours: IntArray,
    change: FloatArray,
    lean: FloatArray,
    node_cost: FloatArray,
    home: FloatArray,
    start: int,
    weights: FloatArray,
    flagged: BoolArray,
    blocked: IntArray,
) -> tuple[FloatArray, IntArray, FloatArray, IntArray]:
    """Cheapest way to draw all layers in order, with visits home in between.

    Args:
        layers: Tip numbers in drawing order, shape (l,).
        layer_first: Where each tip's nodes begin, shape (k + 1,).
        gap: Path length from the layer before to this one, shape (l,); [m].
        n_shapes: Number of shapes n.
        index: Node of each (tip, shape) or -1, shape (k * n,).
        shape_of: Shape of each node, shape (v,).
        first: Neighbour rows of the shapes.
        neighbours: See `Shapes`.
        change: See `Shapes`.
        lean: Sum of the knees' angles, joint 1 left out, shape (v,); [rad].
        node_cost: What a metre drawn with this node costs, shape (v,).
        home: Length of the way from the start to each node, inf if none, (v,).
        start: Node of the first layer to start from without a way, or -1.
        weights: Cost of a rad of turning, of a step at rest, of a visit home, of a
            metre of way, of a metre not drawn.
        flagged: Nodes with a blocked edge, shape (v,).
        blocked: Sorted keys of blocked edges.

    Returns:
        cost and parent of every node (-2: from home); cost of being at home after
        each layer and the node left from (-1: was at home already), shape (l,).
    """
    turn_cost, still_cost, visit_cost, way_cost, skip_cost = weights
    cost = np.full(shape_of.size, np.inf)
    parent = np.full(shape_of.size, -1)
    home_cost = np.full(layers.size, np.inf)
    home_from = np.full(layers.size, -1)
    at_home = np.inf
    if start < 0:
        at_home = -visit_cost
    for k in range(layers.size):
        tip = layers[k]
        nodes = np.arange(layer_first[tip], layer_first[tip + 1])
        if k == 0:
            if start >= 0:
                cost[start] = 0.0
        else:
            before = layers[k - 1]
            for v in nodes:
                c = shape_of[v]
                drawn = node_cost[v] * gap[k]
                u = index[before * n_shapes + c]
                if u >= 0 and not is_blocked(u, v, flagged, blocked):
                    cost[v], parent[v] = cost[u] + drawn, u
                for e in range(first[c], first[c + 1]):
                    u = index[before * n_shapes + neighbours[e]]
                    if u < 0:
                        continue
                    value = cost[u] + drawn + turn_cost * change[e]
                    if value < cost[v] and not is_blocked(u, v, flagged, blocked):
                        cost[v], parent[v] = value, u
                if c > 0 and lean[v] <= NEAR:
                    u = index[before * n_shapes]
                    if u >= 0:
                        value = cost[u] + drawn + turn_cost * lean[v]
                        if value < cost[v] and not is_blocked(u, v, flagged, blocked):
                            cost[v], parent[v] = value, u
                if c == 0:
                    for u in range(layer_first[before], layer_first[before + 1]):
                        value = cost[u] + drawn + turn_cost * lean[u]
                        if (
                            lean[u] <= NEAR
                            and value < cost[v]
                            and not is_blocked(u, v, flagged, blocked)
                        ):
                            cost[v], parent[v] = value, u
            at_home += skip_cost * gap[k]
        _settle(
            nodes, tip, n_shapes, index, shape_of, first, neighbours, change, lean,
            turn_cost, still_cost, flagged, blocked, cost, parent,
        )  # fmt: skip
        for v in nodes:
            value = cost[v] + way_cost * home[v]
            if value < at_home:
                at_home, home_from[k] = value, v
        home_cost[k] = at_home
        entered = False
        for v in nodes:
            value = at_home + visit_cost + way_cost * home[v]
            if value < cost[v]:
                cost[v], parent[v], entered = value, -2, True
        if entered:
            _settle(
                nodes, tip, n_shapes, index, shape_of, first, neighbours, change, lean,
                turn_cost, still_cost, flagged, blocked, cost, parent,
            )  # fmt: skip
    return cost, parent, home_cost, home_from
