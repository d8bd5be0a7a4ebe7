"""One search: a roadmap, the cheapest sequence, and again with what proved blocked.

Where the arm must leave the path to change sides, the path falls into pieces, each
drawn in one go. In the order given the connections between them may be long; drawn in
another order, or from their other end, they may be short, where the problem allows it:
a square round an obstacle that no arm encircles is begun where it has to be left
otherwise.
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.roadmap import Roadmap
from vdsm_pin.planner.fewest.roadmap_kernels import (
    FROM_START,
    Barred,
    Labels,
    TipLinks,
    Weights,
    shortest_paths,
    stage_programme,
)
from vdsm_pin.planner.fewest.route import TipRoute
from vdsm_pin.problem.desired_path import Order

WEIGHTS = Weights(
    turn=0.048, still=0.0032, more=0.04, visit=0.96, connection=0.05, skip=1000.0
)
"""Costs in arm lengths drawn with one changed angle more."""
ONE_POINT = 0.0032
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


class SequenceSearch:
    """Sequences over one roadmap while edges get blocked.

    Args:
        roadmap: The graph.
        length: Of the arm; all lengths are over it; [m].
        start_node: The node the motion starts from.
    """

    def __init__(self, roadmap: Roadmap, length: float, start_node: int) -> None:
        self.roadmap, self.start_node, self.graph = roadmap, start_node, roadmap.graph()
        self.barred = Barred.none(len(roadmap.node))
        route = roadmap.route
        self.gap = np.concatenate([[0.0], np.diff(route.stations) / length])
        # Resting at a single point costs like a stretch, or it would be left out.
        self.gap[1:][self.gap[1:] == 0.0] = ONE_POINT
        self.gaps = route.gaps / length
        self.connection_gaps = self.gaps.copy()
        self.from_start, self.before = self.lengths_from(start_node)

    def block(self, edges: IntArray, on_connections: bool) -> None:
        """Leave out edges, and lengthen all ways between the same two tips.

        What blocks one shape is likely to block its neighbours too.

        Args:
            edges: Pairs of nodes, shape (n, 2).
            on_connections: Whether one of them was part of a way, so that ways change.
        """
        self.barred = self.barred.more(edges)
        route = self.roadmap.route
        for a, b in self.roadmap.tips_of(edges):
            for u, v in ((a, b), (b, a)):
                row = slice(route.first[u], route.first[u + 1])
                link = route.links[row] == v
                self.connection_gaps[row] += link * (self.gaps[row] + DISTRUST)
        # Blocked on the path, an edge may be part of a way from the start all the same.
        here, there = edges.T
        on_tree = (self.before[here] == there) | (self.before[there] == here)
        if on_connections or on_tree.any():
            self.from_start, self.before = self.lengths_from(self.start_node)

    def lengths_from(
        self, source: int, target: int = -1
    ) -> tuple[FloatArray, IntArray]:
        """Shortest ways from a node, off the path; see `shortest_paths`."""
        route = self.roadmap.route
        tips = TipLinks(route.first, route.links, self.connection_gaps)
        return shortest_paths(
            source, target, self.graph, tips, self.roadmap.strain, TURN, self.barred
        )

    def connection(self, source: int, target: int) -> tuple[int, ...]:
        """Nodes of the shortest way between nodes that can be reached."""
        before = self.before
        if source != self.start_node:
            _, before = self.lengths_from(source, target)
        nodes = [target]
        while nodes[-1] != source:
            nodes.append(int(before[nodes[-1]]))
            assert nodes[-1] >= 0, "the graph is symmetric"
        return tuple(reversed(nodes))

    def sequence(self) -> Sequence:
        """The cheapest sequence under the edges blocked so far."""
        labels, start_cost, left_from = stage_programme(
            self.graph, self.roadmap.route.layers, self.gap, self.roadmap.cost,
            self.from_start, WEIGHTS._replace(angle=self.roadmap.angle), self.barred,
        )  # fmt: skip
        return self._trace(labels, start_cost, left_from)

    def _trace(
        self, labels: Labels, start_cost: FloatArray, left_from: IntArray
    ) -> Sequence:
        """Backwards from the cheapest end."""
        roadmap = self.roadmap
        k = len(start_cost) - 1
        tip = roadmap.route.layers[k]
        begin, end = roadmap.tip_nodes[tip], roadmap.tip_nodes[tip + 1]
        last = labels.cost[begin:end]
        node = -1
        if not start_cost[k] < last.min(initial=np.inf) and end > begin:
            node = int(begin + np.argmin(last))
        runs: list[Leg] = []
        skipped: list[int] = []
        while True:
            if node >= 0:
                run, k = self._run(labels.parent, node, k)
                runs.append(run)
            while k >= 0 and left_from[k] < 0:
                if k > 0:
                    skipped.append(k)
                k -= 1
            if k < 0:
                break
            node = int(left_from[k])
        return self.joined(runs[::-1], tuple(sorted(skipped)))

    def _run(self, parent: IntArray, node: int, k: int) -> tuple[Leg, int]:
        """The drawn leg that ends in a node at layer k, and the layer it begins at."""
        nodes = [node]
        while parent[nodes[-1]] != FROM_START:
            nodes.append(int(parent[nodes[-1]]))
        tips = self.roadmap.tips_of(np.array(nodes))
        marks = k - np.cumsum(np.append(0, tips[1:] != tips[:-1]))
        leg = Leg(True, tuple(nodes[::-1]), tuple(marks[::-1].tolist()))
        return leg, leg.layers[0]

    def joined(self, runs: list[Leg], skipped: tuple[int, ...]) -> Sequence:
        """Drawn legs with the shortest ways between them."""
        legs: list[Leg] = []
        at, left = self.start_node, runs[0].layers[0] if runs else 0
        for run in runs:
            connection = self.connection(at, run.nodes[0])
            if len(connection) > 1:
                marks = (left,) * (len(connection) - 1) + (run.layers[0],)
                legs.append(Leg(False, connection, marks))
            legs.append(run)
            at, left = run.nodes[-1], run.layers[-1]
        return Sequence(tuple(legs), skipped)


MOST_PIECES: Final = 9
"""Pieces up to which the best order is sought among all of them."""

Visit: TypeAlias = tuple[int, bool]
"""Number of a piece, and whether it is drawn backwards."""


def backwards(leg: Leg) -> Leg:
    """The same leg from its other end."""
    return Leg(leg.drawn, leg.nodes[::-1], leg.layers[::-1])


def reordered(ways: SequenceSearch, sequence: Sequence) -> Sequence:
    """The same pieces in the order and directions with the shortest ways between.

    Args:
        ways: Knows the connections.
        sequence: The path in the order given.

    Returns:
        The sequence itself where nothing is gained.
    """
    runs = [leg for leg in sequence.legs if leg.drawn]
    if not 1 <= len(runs) <= MOST_PIECES:
        return sequence
    entry = np.array([[run.nodes[0], run.nodes[-1]] for run in runs])
    first = ways.from_start[entry]
    between = np.stack(
        [[ways.lengths_from(int(node))[0][entry] for node in pair] for pair in entry]
    )
    order = shortest_tour(first, between)
    given = tuple((number, False) for number in range(len(runs)))
    gain = tour_length(first, between, given) - tour_length(first, between, order)
    if not gain > 0.0:
        return sequence
    chosen = [backwards(runs[k]) if back else runs[k] for k, back in order]
    return ways.joined(chosen, sequence.skipped)


def tour_length(
    first: FloatArray, between: FloatArray, order: tuple[Visit, ...]
) -> float:
    """Length of the ways of a tour; see `shortest_tour`."""
    number, back = order[0]
    total = float(first[number, int(back)])
    for (a, a_back), (b, b_back) in itertools.pairwise(order):
        # A piece drawn forwards is left at its last node.
        total += float(between[a, int(not a_back), b, int(b_back)])
    return total


def shortest_tour(first: FloatArray, between: FloatArray) -> tuple[Visit, ...]:
    """Order and directions of pieces with the shortest ways, by subsets.

    Args:
        first: Way from the start to both ends of each piece, shape (n, 2).
        between: Way from end e of piece a to end f of piece b at [a, e, b, f], shape
            (n, 2, n, 2).
    """
    n = len(first)
    # best[set, k, f]: the pieces of the set drawn, k last and entered at its end f.
    best = np.full((1 << n, n, 2), np.inf)
    before: IntArray = np.full((1 << n, n, 2), -1)
    for k in range(n):
        best[1 << k, k] = first[k]
    for done in range(1, 1 << n):
        for a, b in itertools.permutations(range(n), 2):
            if not done & (1 << a) or done & (1 << b):
                continue
            more = done | (1 << b)
            for e, f in itertools.product((0, 1), repeat=2):
                value = best[done, a, e] + between[a, 1 - e, b, f]
                if value < best[more, b, f]:
                    best[more, b, f], before[more, b, f] = value, 2 * a + e
    done = (1 << n) - 1
    k, f = divmod(int(np.argmin(best[done])), 2)
    tour = [(k, bool(f))]
    while before[done, k, f] >= 0:
        last = int(before[done, k, f])
        done ^= 1 << k
        k, f = divmod(last, 2)
        tour.append((k, bool(f)))
    return tuple(reversed(tour))


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
        return self._length([k for k in self.skipped if not self.route.undrawable[k]])

    @property
    def not_drawn(self) -> float:
        """Length of the path not drawn; [m]."""
        return self._length(self.skipped)

    def _length(self, layers: Iterable[int]) -> float:
        """Length of the stretches that end at some layers; [m]."""
        gaps = np.diff(self.route.stations)
        return float(sum(gaps[k - 1] for k in layers))


@dataclass(frozen=True)
class Searched(Found):
    """What a search of a roadmap came to.

    Args:
        roadmap: The graph searched.
        start_node: The node the motion starts from.
        lengths: From there to each node, over the arm's length, inf if no way is
            known that is not blocked, shape (v,); [-].
    """

    roadmap: Roadmap
    start_node: int
    lengths: FloatArray

    @property
    def bars_ways(self) -> bool:
        """Whether nodes stand in the stretches not drawn that no way leads to."""
        route = self.roadmap.route
        tips = [route.layers[k] for k in self.skipped if not route.undrawable[k]]
        ways = [self.lengths[self.roadmap.nodes_at(tip)] for tip in tips]
        return not all(np.isfinite(lengths).all() for lengths in ways)

    def start_in(self, more: Roadmap) -> int:
        """The number of the start node in an extended roadmap."""
        node, before = np.array(self.start_node), self.roadmap
        return int(more.nodes_of(before.tips_of(node), before.shapes_of(node)))


def search(
    judge: Judge, roadmap: Roadmap, start_node: int, rounds: int
) -> Searched | None:
    """The cheapest sequence whose every interval is clear.

    Args:
        judge: Says which intervals are clear.
        roadmap: The graph.
        start_node: The node the motion starts from.
        rounds: Largest number of sequences tried.

    Returns:
        None if the rounds end or nothing is drawn.
    """
    arm = judge.problem.manipulator
    sequences = SequenceSearch(roadmap, arm.total_length, start_node)
    known: set[tuple[int, ...]] = set()
    for _ in range(rounds):
        sequence = sequences.sequence()
        if not any(leg.drawn for leg in sequence.legs):
            return None
        if judge.problem.path.order is Order.FREE:
            sequence = reordered(sequences, sequence)
        corners, nodes = _corners(arm, roadmap, sequence)
        edges = np.sort(np.stack([nodes[:-1], nodes[1:]], axis=1), axis=1)
        # Where the tip draws, the last link may have to look somewhere, besides.
        keys = np.column_stack([edges, corners.drawn]).tolist()
        fresh = np.array([k for k, key in enumerate(keys) if (*key,) not in known], int)
        good = (
            judge.clear(judge.lines(corners, fresh)) if fresh.size else np.ones(0, bool)
        )
        bad = fresh[~good]
        if not bad.size:
            return Searched(
                roadmap.route, corners, sequence.skipped, roadmap, start_node,
                sequences.from_start,
            )  # fmt: skip
        known.update(map(tuple, keys))
        sequences.block(edges[bad], not corners.drawn[bad].all())
    return None


def _corners(
    manipulator: Manipulator, roadmap: Roadmap, sequence: Sequence
) -> tuple[Corners, IntArray]:
    """The corners of a sequence and their nodes; a leg begins where one ends."""
    nodes: list[int] = []
    stations: list[float] = []
    drawn: list[bool] = []
    for leg in sequence.legs:
        again = 1 if nodes else 0
        nodes += leg.nodes[again:]
        stations += [roadmap.route.stations[k] for k in leg.layers[again:]]
        drawn += [leg.drawn] * (len(leg.nodes) - 1)
    number = np.array(nodes)
    tips, offsets = roadmap.poses_of(manipulator, number)
    on = np.array(drawn, dtype=np.bool_)
    return Corners(tips, offsets, np.array(stations), on), number
