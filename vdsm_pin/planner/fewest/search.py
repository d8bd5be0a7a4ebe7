"""One search: a roadmap, the cheapest sequence, and again with what proved blocked."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.alike import alike, lines_of
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Knots, knots_of
from vdsm_pin.planner.fewest.order import reordered
from vdsm_pin.planner.fewest.roadmap import Roadmap
from vdsm_pin.planner.fewest.route import TipRoute
from vdsm_pin.planner.fewest.sequence import Planner
from vdsm_pin.problem import Order


@dataclass(frozen=True)
class Found:
    """A motion that draws what it can.

    Args:
        route: The tips along the path.
        knots: The motion, every interval clear.
        skipped: Layers k whose stretch from layer k - 1 is not drawn.
    """

    route: TipRoute
    knots: Knots
    skipped: tuple[int, ...]

    @property
    def missing(self) -> float:
        """Length of the path not drawn and not proved impossible to draw; [m]."""
        gaps = np.diff(self.route.stations)
        return float(sum(gaps[k - 1] for k in self.skipped if not self.route.closed[k]))


@dataclass(frozen=True)
class Searched(Found):
    """What a search of a roadmap came to.

    Args:
        roadmap: The graph searched.
        home: The node the motion starts from.
        ways: Length over the arm's of the way from there to each node, inf if there is
            none known not to be blocked, shape (v,); [-].
        blocked: Pairs of nodes whose edges were found blocked, shape (n, 2).
    """

    roadmap: Roadmap
    home: int
    ways: FloatArray
    blocked: IntArray


def search(
    judge: Judge, roadmap: Roadmap, home: int, rounds: int, blocked: IntArray
) -> Searched | None:
    """The cheapest sequence whose every interval is clear.

    Args:
        judge: Says which intervals are clear.
        roadmap: The graph.
        home: The node the motion starts from.
        rounds: Largest number of sequences tried.
        blocked: Pairs of nodes whose edges are known to be blocked, shape (n, 2).

    Returns:
        None if the rounds end or nothing is drawn.
    """
    planner = Planner(roadmap, judge.problem.manipulator.total_length, home, blocked)
    known: set[tuple[int, int]] = set()
    for _ in range(rounds):
        sequence = planner.sequence()
        if not any(leg.drawn for leg in sequence.legs):
            return None
        if judge.problem.path.order is Order.FREE:
            sequence = reordered(planner, sequence)
        knots = knots_of(judge.problem.manipulator, roadmap, sequence)
        fresh = _fresh(knots.edges, known)
        good = (
            judge.clear(judge.lines(knots, fresh)) if fresh.size else np.ones(0, bool)
        )
        bad = fresh[~good]
        if not bad.size:
            return Searched(
                roadmap.route, knots, sequence.skipped, roadmap, home,
                planner.from_home, blocked,
            )  # fmt: skip
        known.update(_keys(knots.edges[fresh]))
        more = alike(roadmap, knots.edges[bad])
        more = more[[key not in known for key in _keys(more)]]
        known.update(_keys(more))
        good = judge.clear(lines_of(judge.problem.manipulator, roadmap, more))
        more = np.concatenate([knots.edges[bad], more[~good]])
        blocked = np.concatenate([blocked, more])
        planner.block(more, not knots.drawn[bad].all())
    return None


def _fresh(edges: IntArray, known: set[tuple[int, int]]) -> IntArray:
    """Intervals whose edge has not been looked at."""
    return np.array([k for k, e in enumerate(_keys(edges)) if e not in known], int)


def _keys(edges: IntArray) -> list[tuple[int, int]]:
    """Edges as pairs (low, high)."""
    return [(a, b) for a, b in np.sort(edges, axis=1).tolist()]


def nothing_blocked() -> IntArray:
    """No edge is known to be blocked, shape (0, 2)."""
    return np.zeros((0, 2), dtype=np.int64)
