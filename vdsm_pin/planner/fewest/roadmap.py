"""The graph of sparse configurations: shapes at tips, with clearance and cost."""

from dataclasses import dataclass, replace

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.kernels import pose_shapes
from vdsm_pin.planner.fewest.route import TipRoute
from vdsm_pin.planner.fewest.shapes import Shapes
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES


@dataclass(frozen=True)
class Taste:
    """What a strategy prefers among clear configurations.

    Args:
        angle: Cost of one changed angle along a metre drawn.
        room: Clearance beyond the required one that is wanted; [m].
        room_cost: Cost of having none of it along a metre.
        easy_bend: Link angles up to this cost nothing more; [rad].
        bend_cost: Cost of bending to the limit along a metre.
    """

    angle: float = 1.0
    room: float = 0.05
    room_cost: float = 0.5
    easy_bend: float = float(np.deg2rad(30.0))
    bend_cost: float = 4.0


@dataclass(frozen=True)
class Roadmap:
    """Clear configurations (nodes) and what a metre drawn with each costs.

    Args:
        route: The tips.
        shapes: The shapes.
        node: tip * n_shapes + shape of each node, ascending, shape (v,).
        index: Node of each (tip, shape) or -1, shape (k * n_shapes,).
        tip_nodes: Where each tip's nodes begin, shape (k + 1,).
        lean: Sum of the knees' angles without joint 1, shape (v,); [rad].
        changed: Number of changed link angles, shape (v,).
        cost: Cost of a metre drawn, shape (v,).
        strain: What entering a node adds to the length of a way, shape (v,); [m].
        clearance: Least clearance, shape (v,); [m].
    """

    route: TipRoute
    shapes: Shapes
    node: IntArray
    index: IntArray
    tip_nodes: IntArray
    lean: FloatArray
    changed: IntArray
    cost: FloatArray
    strain: FloatArray
    clearance: FloatArray

    def tip(self, node: int) -> int:
        """Tip number of a node."""
        return int(self.node[node] // self.shapes.size)

    def shape(self, node: int) -> int:
        """Shape number of a node."""
        return int(self.node[node] % self.shapes.size)


def link_limit(problem: PlanningProblem) -> float:
    """Largest link angle that keeps cone and box: |theta|, |alpha| <= psi; [rad]."""
    arm = problem.manipulator
    return min(arm.max_link_angle, arm.max_joint_angle)


def build_roadmap(
    problem: PlanningProblem,
    clearance: LinkClearance,
    required: float,
    route: TipRoute,
    shapes: Shapes,
    taste: Taste,
    limit: float,
) -> Roadmap:
    """Every shape at every tip that keeps limits and clearance."""
    arm = problem.manipulator
    node, ends, bends = pose_shapes(
        route.tips,
        shapes.knees,
        shapes.slopes,
        arm.stations,
        limit,
        *arm.base_range,
    )
    single = bool((shapes.knees[:, 0] == shapes.knees[:, 1]).all())
    pieces = ends[:, [0, 1, 3]] if single else ends
    room = clearance(np.ascontiguousarray(pieces)).min(axis=1)
    keep = room >= required
    return _assemble(
        route,
        shapes,
        node[keep],
        bends[keep],
        room[keep],
        required,
        taste,
        limit,
    )


def _assemble(
    route: TipRoute,
    shapes: Shapes,
    node: IntArray,
    bends: FloatArray,
    room: FloatArray,
    required: float,
    taste: Taste,
    limit: float,
) -> Roadmap:
    changed = (bends > TOLERANCES.changed_angle).sum(axis=1)
    lack = np.maximum(0.0, 1.0 - (room - required) / taste.room)
    over = np.maximum(0.0, bends.max(axis=1, initial=0.0) - taste.easy_bend)
    bent = (over / max(limit - taste.easy_bend, 0.02)) ** 2
    cost = taste.angle * changed + taste.room_cost * lack**2 + taste.bend_cost * bent
    strain = 0.02 * taste.room_cost * lack**2 + 0.1 * taste.bend_cost * bent
    lean = bends[:, 1:].sum(axis=1)
    lean[node % shapes.size == 0] = 0.0
    return _indexed(
        Roadmap(route, shapes, node, node, node, lean, changed, cost, strain, room)
    )


def _indexed(roadmap: Roadmap) -> Roadmap:
    """The roadmap with its nodes in order and its indices made."""
    n_tips, n_shapes = len(roadmap.route.tips), roadmap.shapes.size
    order = np.argsort(roadmap.node, kind="stable")
    node = roadmap.node[order]
    index = np.full(n_tips * n_shapes, -1)
    index[node] = np.arange(len(node))
    tip_nodes = np.searchsorted(node, np.arange(n_tips + 1) * n_shapes)
    return replace(
        roadmap,
        node=node,
        index=index,
        tip_nodes=tip_nodes,
        lean=roadmap.lean[order],
        changed=roadmap.changed[order],
        cost=roadmap.cost[order],
        strain=roadmap.strain[order],
        clearance=roadmap.clearance[order],
    )


def extended(
    roadmap: Roadmap,
    tips: IntArray,
    bends: FloatArray,
    room: FloatArray,
    shapes: Shapes,
    required: float,
    taste: Taste,
    limit: float,
) -> Roadmap:
    """The roadmap with grown configurations as further nodes.

    Args:
        roadmap: Before.
        tips: Tip number of each new node, shape (g,).
        bends: Link angles of each, shape (g, N); [rad].
        room: Clearance of each, shape (g,); [m].
        shapes: The shapes with the new ones at their end.
        required: Clearance to keep; [m].
        taste: What the strategy prefers.
        limit: Largest link angle; [rad].
    """
    old = roadmap.shapes.size
    tip, shape = roadmap.node // old, roadmap.node % old
    fresh = tips * shapes.size + old + np.arange(len(tips))
    more = _assemble(roadmap.route, shapes, fresh, bends, room, required, taste, limit)
    return _indexed(
        replace(
            roadmap,
            shapes=shapes,
            node=np.concatenate([tip * shapes.size + shape, more.node]),
            lean=np.concatenate([roadmap.lean, more.lean]),
            changed=np.concatenate([roadmap.changed, more.changed]),
            cost=np.concatenate([roadmap.cost, more.cost]),
            strain=np.concatenate([roadmap.strain, more.strain]),
            clearance=np.concatenate([roadmap.clearance, more.clearance]),
        )
    )


@dataclass
class Blocked:
    """Edges found to be blocked, in the form the kernels read.

    Args:
        flagged: Nodes with a blocked edge, shape (v,).
        keys: Sorted keys min * v + max of the edges.
    """

    flagged: BoolArray
    keys: IntArray

    @staticmethod
    def none(n_nodes: int) -> "Blocked":
        """No edge is blocked."""
        return Blocked(np.zeros(n_nodes, dtype=np.bool_), np.zeros(0, dtype=np.int64))

    def add(self, edges: IntArray) -> None:
        """Block edges (u, v), shape (n, 2)."""
        self.flagged[edges.ravel()] = True
        keys = edges.min(axis=1) * self.flagged.size + edges.max(axis=1)
        self.keys = np.union1d(self.keys, keys)
