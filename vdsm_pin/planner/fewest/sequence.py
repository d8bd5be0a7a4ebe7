"""The order of configurations: what is drawn with which, and the ways in between."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.kernels import FROM_HOME, Labels, Weights, stage_programme
from vdsm_pin.planner.fewest.roadmap import Roadmap, nothing_barred, with_barred
from vdsm_pin.planner.fewest.ways import TipLinks, shortest_ways

WEIGHTS = Weights(turn=0.048, still=0.0064, visit=0.96, way=0.05, skip=1000.0)
"""Costs in arm lengths drawn with one changed angle more."""
REST = 0.0032
"""Length over the arm's that drawing a single point counts for; [-]."""
DISTRUST = 0.016
"""Length over the arm's added, with the distance, to a way between two tips that was
blocked; [-]."""
TURN = 0.32
"""Length over the arm's that a change of shape by a radian counts for; [1/rad]."""


@dataclass(frozen=True)
class Leg:
    """A run of nodes: drawn along the path, or a way off it.

    Args:
        drawn: Whether the tip draws.
        nodes: Node after node.
        layers: Of each node; along a way the layer left, at its end the layer come to.
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
    """

    legs: tuple[Leg, ...]
    skipped: tuple[int, ...]


class Planner:
    """Sequences over one roadmap while edges get blocked.

    Args:
        roadmap: The graph.
        length: Of the arm; all lengths are over it; [m].
        home: The node the motion starts from.
        blocked: Pairs of nodes whose edges are known to be blocked, shape (n, 2).
    """

    def __init__(
        self, roadmap: Roadmap, length: float, home: int, blocked: IntArray
    ) -> None:
        self.roadmap, self.home, self.graph = roadmap, home, roadmap.graph()
        self.barred = nothing_barred(len(roadmap.node))
        route = roadmap.route
        self.gap = np.concatenate([[0.0], np.diff(route.stations) / length])
        # Resting at a single point costs like a stretch, or it would be left out.
        self.gap[1:][self.gap[1:] == 0.0] = REST
        self.gaps = route.gaps / length
        self.way_gaps = self.gaps.copy()
        self._bar(blocked)
        self.from_home, self.before = self.ways(home)

    def block(self, edges: IntArray, on_ways: bool) -> None:
        """Leave out edges, and lengthen all ways between the same two tips.

        What blocks one shape is likely to block its neighbours too.

        Args:
            edges: Pairs of nodes, shape (n, 2).
            on_ways: Whether one of them was part of a way, so that ways change.
        """
        self._bar(edges)
        # Blocked on the path, an edge may be part of a way from home all the same.
        here, there = edges.T
        on_tree = (self.before[here] == there) | (self.before[there] == here)
        if on_ways or on_tree.any():
            self.from_home, self.before = self.ways(self.home)

    def _bar(self, edges: IntArray) -> None:
        self.barred = with_barred(self.barred, edges)
        route = self.roadmap.route
        for a, b in self.roadmap.tips_of(edges):
            for u, v in ((a, b), (b, a)):
                row = slice(route.first[u], route.first[u + 1])
                link = route.links[row] == v
                self.way_gaps[row] += link * (self.gaps[row] + DISTRUST)

    def ways(self, source: int, target: int = -1) -> tuple[FloatArray, IntArray]:
        """Shortest ways from a node, off the path; see `shortest_ways`."""
        route = self.roadmap.route
        tips = TipLinks(route.first, route.links, self.way_gaps)
        return shortest_ways(
            source, target, self.graph, tips, self.roadmap.strain, TURN, self.barred
        )

    def way(self, source: int, target: int) -> tuple[int, ...]:
        """Nodes of the shortest way between nodes that a way from home leads to."""
        before = self.before
        if source != self.home:
            _, before = self.ways(source, target)
        nodes = [target]
        while nodes[-1] != source:
            nodes.append(int(before[nodes[-1]]))
            assert nodes[-1] >= 0, "the graph is symmetric"
        return tuple(reversed(nodes))

    def sequence(self) -> Sequence:
        """The cheapest sequence under the edges blocked so far."""
        labels, home_cost, home_from = stage_programme(
            self.graph, self.roadmap.route.layers, self.gap, self.roadmap.cost,
            self.from_home, WEIGHTS, self.barred,
        )  # fmt: skip
        return self._trace(labels, home_cost, home_from)

    def _trace(
        self, labels: Labels, home_cost: FloatArray, home_from: IntArray
    ) -> Sequence:
        """Backwards from the cheapest end."""
        roadmap = self.roadmap
        k = len(home_cost) - 1
        tip = roadmap.route.layers[k]
        begin, end = roadmap.tip_nodes[tip], roadmap.tip_nodes[tip + 1]
        last = labels.cost[begin:end]
        node = -1
        if not home_cost[k] < last.min(initial=np.inf) and end > begin:
            node = int(begin + np.argmin(last))
        runs: list[Leg] = []
        skipped: list[int] = []
        while True:
            if node >= 0:
                run, k = self._run(labels.parent, node, k)
                runs.append(run)
            while k >= 0 and home_from[k] < 0:
                if k > 0:
                    skipped.append(k)
                k -= 1
            if k < 0:
                break
            node = int(home_from[k])
        return self.joined(runs[::-1], tuple(sorted(skipped)))

    def _run(self, parent: IntArray, node: int, k: int) -> tuple[Leg, int]:
        """The drawn leg that ends in a node at layer k, and the layer it begins at."""
        nodes = [node]
        while parent[nodes[-1]] != FROM_HOME:
            nodes.append(int(parent[nodes[-1]]))
        tips = self.roadmap.tips_of(np.array(nodes))
        marks = k - np.cumsum(np.append(0, tips[1:] != tips[:-1]))
        leg = Leg(True, tuple(nodes[::-1]), tuple(marks[::-1].tolist()))
        return leg, leg.layers[0]

    def joined(self, runs: list[Leg], skipped: tuple[int, ...]) -> Sequence:
        """Drawn legs with the shortest ways between them."""
        legs: list[Leg] = []
        at, left = self.home, runs[0].layers[0] if runs else 0
        for run in runs:
            way = self.way(at, run.nodes[0])
            if len(way) > 1:
                marks = (left,) * (len(way) - 1) + (run.layers[0],)
                legs.append(Leg(False, way, marks))
            legs.append(run)
            at, left = run.nodes[-1], run.layers[-1]
        return Sequence(tuple(legs), skipped)
