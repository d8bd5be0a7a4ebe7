"""One search: a roadmap, the cheapest sequence, and again with what proved blocked."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.roadmap import Roadmap
from vdsm_pin.planner.fewest.route import TipRoute
from vdsm_pin.planner.fewest.sequence import Sequence, SequenceSearch, reordered
from vdsm_pin.problem.desired_path import Order


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
        gaps = np.diff(self.route.stations)
        return float(
            sum(gaps[k - 1] for k in self.skipped if not self.route.undrawable[k])
        )


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
