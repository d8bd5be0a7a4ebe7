"""The order of configurations: what is drawn with which, and the ways in between."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.kernels import stage_programme
from vdsm_pin.planner.fewest.roadmap import Blocked, Roadmap
from vdsm_pin.planner.fewest.ways import shortest_ways

TURN_COST = 0.15
"""Cost of turning by a radian, in metres drawn with one changed angle more."""
STILL_COST = 0.02
"""Cost of a step with the tip at rest."""
VISIT_COST = 3.0
"""Cost of leaving the path and coming back, besides the way."""
WAY_COST = 0.05
"""Cost of a metre of way off the path."""
SKIP_COST = 1000.0
"""Cost of a metre not drawn."""
REST = 0.01
"""Length that drawing a single point counts for; [m]."""
DISTRUST = 0.05
"""Length added, with the distance, to a way between two tips that was blocked; [m]."""
ARM = 1.0
"""Length by which a change of shape counts as a distance; [m]."""


@dataclass(frozen=True)
class Leg:
    """A run of nodes: drawn along the path, or a way off it.

    Args:
        drawn: Whether the tip draws.
        nodes: Node after node.
        layer: For drawn legs, the layer of each node; for ways, the layer left.
    """

    drawn: bool
    nodes: tuple[int, ...]
    layers: tuple[int, ...]


@dataclass(frozen=True)
class Sequence:
    """Legs in order and what they leave out.

    Args:
        legs: Drawn legs and ways, each beginning where the one before ends.
        skipped: Layers k whose stretch from layer k - 1 is not drawn.
        cost: Cost of the whole.
    """

    legs: tuple[Leg, ...]
    skipped: tuple[int, ...]
    cost: float


class Planner:
    """Sequences over one roadmap while edges get blocked."""

    def __init__(self, roadmap: Roadmap, home: int) -> None:
        self.roadmap, self.home = roadmap, home
        self.blocked = Blocked.none(len(roadmap.node))
        route = roadmap.route
        self.gap = np.concatenate([[0.0], np.diff(route.stations)])
        # Resting at a single point costs like a stretch, or it would be left out.
        self.gap[1:][self.gap[1:] == 0.0] = REST
        self.way_gaps = route.gaps.copy()
        self.from_home, _ = self.ways(home)

    def block(self, edges: IntArray, on_ways: bool) -> None:
        """Leave out edges, and lengthen all ways between the same two tips.

        What blocks one shape is likely to block its neighbours too.

        Args:
            edges: Pairs of nodes, shape (n, 2).
            on_ways: Whether one of them was part of a way, so that ways change.
        """
        self.blocked.add(edges)
        route = self.roadmap.route
        for a, b in self.roadmap.node[edges] // self.roadmap.shapes.size:
            for u, v in ((a, b), (b, a)):
                row = slice(route.first[u], route.first[u + 1])
                link = route.links[row] == v
                self.way_gaps[row] += link * (route.gaps[row] + DISTRUST)
        if on_ways:
            self.from_home, _ = self.ways(self.home)

    def ways(self, source: int, target: int = -1) -> tuple[FloatArray, IntArray]:
        """Shortest ways from a node, off the path; see `shortest_ways`."""
        roadmap = self.roadmap
        route, shapes = roadmap.route, roadmap.shapes
        return shortest_ways(
            source, target, shapes.size, shapes.n_lattice, roadmap.index, roadmap.node,
            route.first, route.links, self.way_gaps,
            shapes.first, shapes.neighbours, shapes.change,
            roadmap.lean, roadmap.strain, roadmap.tip_nodes, ARM,
            self.blocked.flagged, self.blocked.keys,
        )  # fmt: skip

    def way(self, source: int, target: int) -> tuple[int, ...] | None:
        """Nodes of the shortest way, or None."""
        length, before = self.ways(source, target)
        if not np.isfinite(length[target]):
            return None
        nodes = [target]
        while nodes[-1] != source:
            nodes.append(int(before[nodes[-1]]))
        return tuple(reversed(nodes))

    def sequence(self) -> Sequence:
        """The cheapest sequence under the edges blocked so far."""
        roadmap = self.roadmap
        route, shapes = roadmap.route, roadmap.shapes
        weights = np.array([TURN_COST, STILL_COST, VISIT_COST, WAY_COST, SKIP_COST])
        cost, parent, home_cost, home_from = stage_programme(
            route.layers, roadmap.tip_nodes, self.gap, shapes.size,
            roadmap.index, roadmap.node % shapes.size,
            shapes.first, shapes.neighbours, shapes.change,
            roadmap.lean, roadmap.cost, self.from_home, -1, weights,
            self.blocked.flagged, self.blocked.keys,
        )  # fmt: skip
        return self._trace(cost, parent, home_cost, home_from)

    def _trace(
        self,
        cost: FloatArray,
        parent: IntArray,
        home_cost: FloatArray,
        home_from: IntArray,
    ) -> Sequence:
        """Backwards from the cheapest end."""
        roadmap = self.roadmap
        layers = roadmap.route.layers
        last = len(layers) - 1
        begin, end = (
            roadmap.tip_nodes[layers[last]],
            roadmap.tip_nodes[layers[last] + 1],
        )
        runs: list[Leg] = []
        skipped: list[int] = []
        k = last
        node = -1
        if end > begin:
            node = int(begin + np.argmin(cost[begin:end]))
        total = float(cost[node]) if node >= 0 else np.inf
        if not total < home_cost[last]:
            node, total = -1, float(home_cost[last])
        while True:
            if node >= 0:
                nodes, marks = [node], [k]
                while parent[node] != -2:
                    before = int(parent[node])
                    if roadmap.tip(before) != roadmap.tip(node):
                        k -= 1
                    node = before
                    nodes.append(node)
                    marks.append(k)
                runs.append(Leg(True, tuple(nodes[::-1]), tuple(marks[::-1])))
            while k >= 0 and home_from[k] < 0:
                if k > 0:
                    skipped.append(k)
                k -= 1
            if k < 0:
                break
            node = int(home_from[k])
        return self.joined(runs[::-1], tuple(sorted(skipped)), total)

    def joined(
        self, runs: list[Leg], skipped: tuple[int, ...], cost: float
    ) -> Sequence:
        """Drawn legs with the shortest ways between them."""
        legs: list[Leg] = []
        at, left = self.home, runs[0].layers[0] if runs else 0
        for run in runs:
            way = self.way(at, run.nodes[0])
            assert way is not None
            if len(way) > 1:
                marks = (left,) * (len(way) - 1) + (run.layers[0],)
                legs.append(Leg(False, way, marks))
            legs.append(run)
            at, left = run.nodes[-1], run.layers[-1]
        return Sequence(tuple(legs), skipped, cost)
