"""Grown shapes tied into the graph, where stretches of the path are not drawn."""

from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct
from vdsm_pin.planner.fewest.growth import Grown, Layers, Population
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Intervals
from vdsm_pin.planner.fewest.roadmap import CostWeights, Roadmap, extended
from vdsm_pin.planner.fewest.sequence import TURN

POPULATION: Final = 150
"""Arms that live on at a layer."""
KEPT: Final = 6
"""Arms at the farthest layer whose ancestors are kept."""


def tied_in(
    judge: Judge,
    roadmap: Roadmap,
    grown: list[Grown],
    roots: list[IntArray],
    weights: CostWeights,
) -> Roadmap:
    """The roadmap with grown configurations, tied to what is near them.

    Args:
        judge: Says what is clear.
        roadmap: The graph before.
        grown: Trees, by layers of the path, that begin with their roots.
        roots: For each tree the nodes of its roots.
        weights: What the strategy prefers.
    """
    shapes, route = roadmap.shapes, roadmap.route
    tips, offsets, links = [], [], []
    first = shapes.size
    for tree, nodes in zip(grown, roots, strict=True):
        more = len(tree.layer) - len(nodes)
        ids = np.append(roadmap.shapes_of(nodes), first + np.arange(more))
        up = ids[tree.parent[-more:]]
        links.append(np.column_stack([ids[-more:], up, np.full(more, shapes.step)]))
        tips.append(route.layers[tree.layer[-more:]])
        offsets.append(tree.offsets[-more:])
        first += more
    every, places = np.concatenate(offsets), np.concatenate(tips)
    links.append(_ties(judge, roadmap, places, every))
    positions = route.tips[places]
    clearances = judge.look(positions, every).clearances
    wider = shapes.with_grown(every, np.vstack(links))
    return extended(roadmap, judge, weights, places, every, clearances, wider)


TIES = 4
"""Nodes of the graph tied to each grown configuration at its tip."""
TIE_LENGTH = 0.08
"""Largest move of a joint along a tie over the arm's length; [-]."""


def _ties(
    judge: Judge, roadmap: Roadmap, places: IntArray, grown: FloatArray
) -> FloatArray:
    """Clear links from grown configurations to the nearest ones at the same tip."""
    arm, shapes = judge.problem.manipulator, roadmap.shapes
    rows, tips, here, there = [], [], [], []
    for tip in distinct(places):
        own = np.flatnonzero(places == tip)
        nodes = roadmap.nodes_at(tip)
        shape = np.concatenate([roadmap.shapes_of(nodes), shapes.size + own])
        around = np.concatenate([roadmap.poses_of(arm, nodes)[1], grown[own]])
        gap = np.abs(grown[own][:, None] - around[None]).max(axis=(2, 3))
        gap[np.arange(len(own)), len(nodes) + np.arange(len(own))] = np.inf
        turn = gap / (TURN * arm.total_length)
        near = np.argsort(gap, axis=1, kind="stable")[:, :TIES]
        mine, column = np.repeat(np.arange(len(own)), near.shape[1]), near.ravel()
        close = gap[mine, column] <= TIE_LENGTH * arm.total_length
        mine, column = mine[close], column[close]
        rows.append(
            np.column_stack(
                [shapes.size + own[mine], shape[column], turn[mine, column]]
            )
        )
        tips.append(np.broadcast_to(roadmap.route.tips[tip], (len(mine), 3)))
        here.append(grown[own[mine]])
        there.append(around[column])
    every = np.concatenate(tips)
    lines = Intervals(every, every, np.concatenate(here), np.concatenate(there))
    good = judge.clear(lines) if len(every) else np.zeros(0, bool)
    return np.concatenate(rows)[good]


def fill(
    judge: Judge,
    roadmap: Roadmap,
    lengths: FloatArray,
    skipped: tuple[int, ...],
    rng: np.random.Generator,
    weights: CostWeights,
) -> Roadmap | None:
    """The roadmap with what could be grown into the stretches not drawn.

    Args:
        judge: Says what is clear.
        roadmap: The graph before.
        lengths: Of the way from the start to each node, inf if none, shape (v,).
        skipped: Layers k whose stretch from layer k - 1 is not drawn.
        rng: Source of chance.
        weights: What the strategy prefers.

    Returns:
        None if nothing grew.
    """
    route, arm = roadmap.route, judge.problem.manipulator
    marks = np.array(skipped)
    breaks = np.flatnonzero(np.diff(marks) > 1) + 1
    trees, roots = [], []
    for stretch in np.split(marks, breaks):
        ends = (int(stretch[0]) - 1, int(stretch[-1]))
        crossed = False
        for first, last, step in ((*ends, 1), (*ends[::-1], -1)):
            if crossed:
                break
            nodes = roadmap.nodes_at(route.layers[first])
            nodes = nodes[np.isfinite(lengths[nodes])]
            if len(nodes) > POPULATION:
                nodes = rng.choice(nodes, POPULATION, replace=False)
            if not len(nodes):
                continue
            _, offsets = roadmap.poses_of(arm, nodes)
            number = np.arange(first, last + step, step)
            tips = route.tips[route.layers[number]]
            layers = Layers(tips, np.zeros(len(tips)))
            tree = Population(judge, layers, rng, POPULATION).grow(offsets, kept=KEPT)
            if len(tree.layer) > len(nodes):
                trees.append(tree._replace(layer=number[tree.layer]))
                roots.append(nodes)
                crossed = bool((trees[-1].layer == last).any())
    return tied_in(judge, roadmap, trees, roots, weights) if trees else None
