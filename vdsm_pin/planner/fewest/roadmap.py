"""The graph of sparse configurations: shapes at tips, with clearance and cost."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.roadmap_kernels import Graph
from vdsm_pin.planner.fewest.route import TipRoute
from vdsm_pin.planner.fewest.shapes import Shapes
from vdsm_pin.planner.one_knee import pose_shapes
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

STRAIN: Final = 0.032
"""Length, over the arm's, by which a way into a configuration at its limits is longer;
[-]."""
LAST_BIT: Final = 62
"""Of the numbers that say which joints are bent."""
KNEES: Final = slice(1, None)
"""Columns of bends past psi_1, the bend at the base."""


@dataclass(frozen=True)
class CostWeights:
    """What a strategy prefers among clear configurations.

    Args:
        angle: Cost of one changed angle; costs are those of a length drawn.
        clearance: Beyond the required one that is wanted, over the arm's length;
            [-].
        clearance_cost: Cost of having none of it.
        easy_bend: Link angles up to this cost nothing more; [rad].
        bend_cost: Cost of bending to the limit.
        joint_error: Error of all joints that each link keeps clearance for; [rad].
    """

    angle: float = 1.0
    clearance: float = 0.016
    clearance_cost: float = 0.5
    easy_bend: float = float(np.deg2rad(30.0))
    bend_cost: float = 4.0
    joint_error: float = 0.0


@dataclass(frozen=True)
class Roadmap:
    """Clear configurations (nodes) and what a length drawn with each costs.

    Args:
        route: The tips.
        shapes: The shapes.
        node: tip * n_shapes + shape of each node, ascending, shape (v,).
        index: Node of each (tip, shape) or -1, shape (k * n_shapes,).
        tip_nodes: Where each tip's nodes begin, shape (k + 1,).
        lean: Sum of the knees' angles without joint 1, shape (v,); [rad].
        cost: Cost of a length drawn, shape (v,).
        strain: What entering a node adds to the length of a way, over the arm's length,
            shape (v,); [-].
        bent: Which joints are bent, a bit each, shape (v,).
        angle: What one changed angle adds to the cost of a length drawn.
    """

    route: TipRoute
    shapes: Shapes
    node: IntArray
    index: IntArray
    tip_nodes: IntArray
    lean: FloatArray
    cost: FloatArray
    strain: FloatArray
    bent: IntArray
    angle: float

    @classmethod
    def empty(cls, route: TipRoute, shapes: Shapes, angle: float) -> "Roadmap":
        """Without nodes."""
        none, nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
        numbers = (none, none, none, nothing, nothing, nothing, none)
        return cls(route, shapes, *numbers, angle)

    def graph(self) -> Graph:
        """What the compiled loops read."""
        shapes = self.shapes
        return Graph(
            shapes.size, shapes.n_lattice, self.index, self.node, self.tip_nodes,
            shapes.first, shapes.neighbours, shapes.change, self.lean, self.bent,
            self.strain,
        )  # fmt: skip

    def tips_of(self, nodes: IntArray) -> IntArray:
        """Tip number of each node."""
        return np.asarray(self.node[nodes] // self.shapes.size)

    def shapes_of(self, nodes: IntArray) -> IntArray:
        """Shape number of each node."""
        return np.asarray(self.node[nodes] % self.shapes.size)

    def nodes_of(self, tips: IntArray, shapes: IntArray) -> IntArray:
        """The node of each tip and shape, -1 where there is none."""
        return np.asarray(self.index[tips * self.shapes.size + shapes])

    def nodes_at(self, tip: int) -> IntArray:
        """All nodes of a tip, in order."""
        return np.arange(self.tip_nodes[tip], self.tip_nodes[tip + 1])

    def poses_of(
        self, manipulator: Manipulator, nodes: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Tips (n, 3) and offsets D_1..D_{N+1} (n, N + 1, 2) of nodes; [m]."""
        tips = self.route.tips[self.tips_of(nodes)]
        return tips, self.shapes.offsets(manipulator, tips, self.shapes_of(nodes))


def build_roadmap(
    judge: Judge,
    weights: CostWeights,
    route: TipRoute,
    shapes: Shapes,
    around: int | None = None,
) -> Roadmap:
    """Every shape at every tip that keeps limits and clearance.

    Args:
        judge: Says what nodes keep.
        weights: What the strategy prefers.
        route: The tips.
        shapes: The shapes.
        around: Only the straight arm is tried at tips farther than this many tips from
            where the straight arm does not do; None: every shape at every tip.
    """
    problem, margins = judge.problem, judge.link_margins
    arm, aims = problem.manipulator, _aims(problem, route)
    low, high = arm.base_range
    rail = low - TOLERANCES.planned_limit, high + TOLERANCES.planned_limit

    def tried(whole: BoolArray) -> Roadmap:
        node, ends, bends = pose_shapes(
            route.tips, whole, shapes.knees, shapes.slopes, arm.stations, judge.limit,
            rail,
        )  # fmt: skip
        if aims is not None:
            there, axes = aims[node // shapes.size], ends[:, 2] - ends[:, 1]
            looks = judge.cone.holds(ends[:, 0, 0], axes, there)
            node, ends, bends = node[looks], ends[looks], bends[looks]
        if margins is not None or judge.cuts is not None:
            ends = link_by_link(ends, arm.stations)
        clearances = _least(judge, ends)
        keep = clearances >= judge.required
        empty = Roadmap.empty(route, shapes, weights.angle)
        return _with_nodes(
            empty, judge, weights, node[keep], bends[keep], clearances[keep]
        )

    count = len(route.tips)
    if around is None:
        return tried(np.ones(count, dtype=np.bool_))
    straight = tried(np.zeros(count, dtype=np.bool_))
    poor = np.ones(count, dtype=np.bool_)
    poor[straight.tips_of(np.flatnonzero(straight.cost <= 2.0 * weights.angle))] = False
    return tried(_spread(route, poor, around)) if poor.any() else straight


def _aims(problem: PlanningProblem, route: TipRoute) -> FloatArray | None:
    """Where the last link shall look at each tip, NaN off the path, shape (k, 3)."""
    if problem.path.pointing is None:
        return None
    aims = np.full(route.tips.shape, np.nan)
    aims[route.layers] = problem.path.aims(route.tips[route.layers], route.stations)
    return aims


def _least(judge: Judge, ends: FloatArray) -> FloatArray:
    """Least clearance of the pieces, from the tip back to the first that lacks it.

    Args:
        judge: Says what is kept.
        ends: Ends of the pieces, shape (v, p + 1, 3); [m].
    """
    clearances, margins = np.full(len(ends), np.inf), judge.link_margins
    rows = np.arange(len(ends))
    for piece in range(ends.shape[1] - 2, -1, -1):
        values = judge.rough(ends[rows, piece : piece + 2], piece)[:, 0]
        values = values if margins is None else values - margins[piece]
        clearances[rows] = np.minimum(clearances[rows], values)
        rows = rows[values >= judge.required]
    return clearances


def _spread(route: TipRoute, picked: BoolArray, times: int) -> BoolArray:
    """Some tips and those at most so many links away from them, shape (k,)."""
    own = np.repeat(np.arange(len(route.tips)), np.diff(route.first))
    for _ in range(times):
        wider = picked.copy()
        wider[route.links[picked[own]]] = True
        picked = wider
    return picked


def _prices(
    judge: Judge, weights: CostWeights, bends: FloatArray, clearances: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Cost of a length drawn, and what entering adds to a way, shape (v,) each.

    Args:
        judge: Says what is kept.
        weights: What the strategy prefers.
        bends: Link angles, shape (v, k); [rad].
        clearances: Clearances, shape (v,); [m].
    """
    most = bends.max(axis=1, initial=0.0)
    changed = (bends > TOLERANCES.changed_angle).sum(axis=1)
    spare = (clearances - judge.required) / judge.problem.manipulator.total_length
    lack = np.maximum(0.0, 1.0 - spare / weights.clearance)
    over = np.maximum(0.0, most - weights.easy_bend)
    bent = (over / max(judge.limit - weights.easy_bend, 0.02)) ** 2
    narrow, steep = weights.clearance_cost * lack**2, weights.bend_cost * bent
    cost = weights.angle * changed + narrow + steep
    return np.asarray(cost), np.asarray(STRAIN * (0.2 * narrow + steep))


def _with_nodes(
    roadmap: Roadmap,
    judge: Judge,
    weights: CostWeights,
    node: IntArray,
    bends: FloatArray,
    clearances: FloatArray,
) -> Roadmap:
    """The roadmap with further nodes, in order and with its indices made.

    Args:
        roadmap: Before.
        judge: Says what nodes keep.
        weights: What the strategy prefers.
        node: Of each new node, see `Roadmap`, shape (g,).
        bends: Link angles of each, of all joints or of joint 1 and the knee, shape
            (g, k); [rad].
        clearances: Clearance of each, shape (g,); [m].
    """
    n_tips, n_shapes = len(roadmap.route.tips), roadmap.shapes.size
    cost, strain = _prices(judge, weights, bends, clearances)
    lean = np.where(node % n_shapes == 0, 0.0, bends[:, KNEES].sum(axis=1))
    every = np.concatenate([roadmap.node, node])
    order = np.argsort(every, kind="stable")
    every, index = every[order], np.full(n_tips * n_shapes, -1)
    index[every] = np.arange(len(every))
    return replace(
        roadmap,
        node=every,
        index=index,
        tip_nodes=np.searchsorted(every, np.arange(n_tips + 1) * n_shapes),
        lean=np.concatenate([roadmap.lean, lean])[order],
        cost=np.concatenate([roadmap.cost, cost])[order],
        strain=np.concatenate([roadmap.strain, strain])[order],
        bent=np.concatenate([roadmap.bent, _bent(roadmap.shapes, node, bends)])[order],
    )


def _bent(shapes: Shapes, node: IntArray, bends: FloatArray) -> IntArray:
    """Which joints are bent, a bit each; joints past the last bit share it, (g,)."""
    joints = np.broadcast_to(np.arange(bends.shape[1]), bends.shape)
    if (node % shapes.size < shapes.n_lattice).all():
        knees = shapes.knees[node % shapes.size]
        joints = np.stack([np.zeros_like(knees), knees], axis=1)
    changed = bends > TOLERANCES.changed_angle
    bits = np.where(changed, 1 << np.minimum(joints, LAST_BIT), 0)
    return np.asarray(np.bitwise_or.reduce(bits, axis=1, initial=0))


def extended(
    roadmap: Roadmap,
    judge: Judge,
    weights: CostWeights,
    tips: IntArray,
    offsets: FloatArray,
    clearances: FloatArray,
    shapes: Shapes,
) -> Roadmap:
    """The roadmap with grown configurations as further nodes.

    Args:
        roadmap: Before.
        judge: Says what nodes keep.
        weights: What the strategy prefers.
        tips: Tip number of each new node, shape (g,).
        offsets: Of each, shape (g, N + 1, 2); [m].
        clearances: Clearance of each, shape (g,); [m].
        shapes: The shapes with the new ones at their end.
    """
    old, every = roadmap.shapes.size, np.arange(len(roadmap.node))
    same = roadmap.tips_of(every) * shapes.size + roadmap.shapes_of(every)
    fresh = tips * shapes.size + old + np.arange(len(tips))
    bends = judge.bends(roadmap.route.tips[tips], offsets)
    wider = replace(roadmap, shapes=shapes, node=same)
    return _with_nodes(wider, judge, weights, fresh, bends, clearances)


def link_by_link(corners: FloatArray, stations: FloatArray) -> FloatArray:
    """Joint centres of arms that are told by their corners.

    Args:
        corners: Base, knees and tip, in line between them, shape (v, p + 1, 3); [m].
        stations: Arc length of the joints, shape (N + 1,); [m].

    Returns:
        Shape (v, N + 1, 3); [m].
    """
    sizes = np.linalg.norm(np.diff(corners, axis=1), axis=2)
    ends = np.cumsum(sizes, axis=1)
    piece = (stations[None, :, None] > ends[:, None, :-1]).sum(axis=2)
    size = np.take_along_axis(sizes, piece, axis=1)
    left = np.take_along_axis(ends, piece, axis=1) - stations
    # A piece may have no length: two knees that are one.
    share = (left / np.where(size > 0.0, size, 1.0))[..., None]
    begin = np.take_along_axis(corners, piece[..., None], axis=1)
    end = np.take_along_axis(corners, piece[..., None] + 1, axis=1)
    return np.asarray(share * begin + (1.0 - share) * end)
