"""One search: a roadmap, the cheapest sequence, and again with what proved blocked."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.planner.fewest.clear import Judge
from vdsm_pin.planner.fewest.motion import Knots, knots_of
from vdsm_pin.planner.fewest.order import reordered
from vdsm_pin.planner.fewest.roadmap import Roadmap
from vdsm_pin.planner.fewest.sequence import Planner, Sequence
from vdsm_pin.problem import Order


@dataclass(frozen=True)
class Found:
    """What one search came to.

    Args:
        roadmap: The graph searched.
        sequence: The sequence of nodes.
        knots: Its knots, every interval clear.
        rounds: Sequences tried.
        home: The node the motion starts from.
    """

    roadmap: Roadmap
    sequence: Sequence
    knots: Knots
    rounds: int
    home: int

    @property
    def missing(self) -> float:
        """Length of the path not drawn and not proved impossible to draw; [m]."""
        route = self.roadmap.route
        gaps = np.diff(route.stations)
        skipped = self.sequence.skipped
        return float(sum(gaps[k - 1] for k in skipped if not route.closed[k]))


def search(judge: Judge, roadmap: Roadmap, home: int, rounds: int) -> Found | None:
    """The cheapest sequence whose every interval is clear.

    Args:
        judge: Says which intervals are clear.
        roadmap: The graph.
        home: The node the motion starts from.
        rounds: Largest number of sequences tried.

    Returns:
        None if the rounds end or nothing is drawn.
    """
    planner = Planner(roadmap, home)
    known: set[tuple[int, int]] = set()
    for count in range(1, rounds + 1):
        sequence = planner.sequence()
        if not any(leg.drawn for leg in sequence.legs):
            return None
        if judge.problem.path.order is Order.FREE:
            sequence = reordered(planner, sequence)
        knots = knots_of(judge.problem.manipulator, roadmap, sequence)
        fresh = _fresh(knots.edges, known)
        good = judge.clear(knots.pick(fresh)) if fresh.size else np.ones(0, bool)
        bad = fresh[~good]
        if not bad.size:
            return Found(roadmap, sequence, knots, count, home)
        known.update(map(tuple, np.sort(knots.edges[fresh[good]], axis=1).tolist()))
        planner.block(knots.edges[bad], not knots.drawn[bad].all())
    return None


def _fresh(edges: IntArray, known: set[tuple[int, int]]) -> IntArray:
    """Intervals whose edge has not been looked at."""
    pairs = np.sort(edges, axis=1).tolist()
    return np.array([k for k, e in enumerate(pairs) if tuple(e) not in known], int)
