"""Bounds over one slice of an interval for one pair, in compiled code."""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import Body, body_reach, new_body
from vdsm_pin.geometry.kernels import (
    BRACKET,
    LOWER,
    NEAR,
    NORMAL,
    SCRATCH_ROWS,
    UPPER,
    Goal,
    bracket_to,
    keep_least,
)
from vdsm_pin.geometry.obstacles import (
    STACK,
    Middle,
    box_of,
    box_support,
    facing,
    middle_of,
    node_support,
    push_children,
)
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.proof.swept_bodies import Ends, load_body, room_of
from vdsm_pin.proof.terms import Task, mover_of

EASE: Final = 0.5
"""Part of the slack that the pieces of a partner need not be told apart by."""


class Space(NamedTuple):
    """Working space of the bounds, and their result.

    Args:
        body: The body over the slice and the error box, in its partner's frame: its
            corners at the start, then at the end.
        core: The same points, grown by discs alone.
        scratch: Shape (SCRATCH_ROWS + 2, 3).
        nodes: Nodes still to look at, shape (STACK,).
        stack: The same while a support is looked for, shape (STACK,).
        trial: Shape (BRACKET + 4,).
        wide: The bracket of the grown body, shape (BRACKET + 4,).
        out: The result, in the layout of a bracket, shape (BRACKET + 4,).
    """

    body: Body
    core: Body
    scratch: FloatArray
    nodes: IntArray
    stack: IntArray
    trial: FloatArray
    wide: FloatArray
    out: FloatArray


@compiled(inline=False)
def new_space(n_turning: int, corners: int) -> Space:
    """Fresh working space for bodies of up to so many corners, and joints that turn."""
    body = new_body(2 * corners, corners, room_of(n_turning))
    core = new_body(0, 0, 0)
    return Space(
        body,
        Body(body.points, core.swings, core.sizes, core.balls, body.discs, body.used),
        np.zeros((SCRATCH_ROWS + 2, 3)),
        np.zeros(STACK, np.int64),
        np.zeros(STACK, np.int64),
        np.zeros(BRACKET + 4),
        np.zeros(BRACKET + 4),
        np.zeros(BRACKET + 4),
    )


@compiled(inline=False)
def plane_bound(
    pieces: PackedPieces, space: Space, node: int, lost: float, n: FloatArray
) -> float:
    """Clearance that a plane proves of all pieces of a node over a slice; [m].

    Args:
        pieces: The scene.
        space: Its `body` is loaded.
        node: The node.
        lost: What every plane of the pair loses; [m].
        n: Unit vector towards the partner, in its frame, shape (3,); [-].
    """
    support = node_support(pieces, node, n, space.stack, space.scratch[0])
    return support - body_reach(space.body, n[0], n[1], n[2]) - lost


@compiled
def node_bound(
    pieces: PackedPieces,
    space: Space,
    node: int,
    middle: Middle,
    lost: float,
    n: FloatArray,
) -> float:
    """The same of a plane that faces the node's box, written to n, by that box; [m].

    Args:
        pieces: The scene.
        space: Its `body` is loaded.
        node: The node.
        middle: Of the body.
        lost: What every plane of the pair loses; [m].
        n: Written, shape (3,); [-].
    """
    if not facing(pieces, node, space.body, middle, n):
        return -np.inf
    support = box_support(pieces, node, n[0], n[1], n[2])
    return support - body_reach(space.body, n[0], n[1], n[2]) - lost


@compiled
def leaf_bracket(
    pieces: PackedPieces,
    space: Space,
    p: int,
    goal: Goal,
    sighted: bool,
    out: FloatArray,
) -> None:
    """Distance bracket of a piece, with the plane that serves the loaded body best.

    Args:
        pieces: The scene.
        space: Its `body` is loaded.
        p: Number of the piece.
        goal: Width of the bracket at which to stop.
        sighted: Whether witness points are needed although errors grow the body: they
            are found by a second bracket, of the body that is not grown.
        out: Guess of n on entry. On return `lower` and n are of the best plane; `upper`
            and the witnesses are of the hull of the points alone, inf where not wanted.
    """
    body, wide = space.body, space.wide
    grown, ball = False, 0.0
    for corner in range(body.used[1]):
        grown |= body.sizes[corner] > 0
        ball = max(ball, body.balls[corner])
    wide[NORMAL:NEAR] = out[NORMAL:NEAR]
    if sighted or not grown:
        enough = np.inf if grown else goal.enough + ball
        core = Goal(goal.width, goal.part, goal.lost + ball, enough)
        bracket_to(pieces, p, space.core, core, space.scratch, out)
    else:
        out[UPPER] = np.inf
    if grown:
        bracket_to(pieces, p, body, goal, space.scratch, wide)
        out[LOWER] = wide[LOWER]
        out[NORMAL:NEAR] = wide[NORMAL:NEAR]
    elif ball > 0.0:
        nx, ny, nz = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
        out[LOWER] -= body_reach(body, nx, ny, nz) - body_reach(space.core, nx, ny, nz)


@compiled
def leaf_bound(
    task: Task, space: Space, node: int, goal: Goal, sighted: bool, out: FloatArray
) -> None:
    """Replace the distance bracket of a piece by the clearance that its plane proves.

    Args:
        task: The scene and the rules.
        space: Its `body` is loaded.
        node: Node of the one piece.
        goal: What every plane of the pair loses, and what is enough.
        sighted: As for `leaf_bracket`.
        out: The same; on return `lower` is the bound over the slice.
    """
    p = task.pieces.node_range[node, 0]
    leaf_bracket(task.pieces, space, p, goal, sighted, out)
    out[LOWER] -= goal.lost


@compiled(inline=False)
def _mesh_bound(
    task: Task, space: Space, root: int, lost: float, sighted: bool, enough: float
) -> None:
    """`loaded_bound` for an obstacle of many pieces, by its hierarchy."""
    pieces = task.pieces
    left_out, part = np.inf, 1.0 - EASE * task.rules.slack
    low, high = space.scratch[SCRATCH_ROWS], space.scratch[SCRATCH_ROWS + 1]
    box_of(space.body, low, high)
    nodes, trial, out = space.nodes, space.trial, space.out
    middle = middle_of(space.body)
    trial[NORMAL:NEAR] = out[NORMAL:NEAR]
    out[LOWER] = out[UPPER] = np.inf
    nodes[0] = root
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = nodes[waiting]
        n = trial[BRACKET : BRACKET + 3]
        bound = node_bound(pieces, space, node, middle, lost, n)
        if bound >= min(out[LOWER], max(enough, part * out[LOWER])):
            left_out = min(left_out, bound)
            continue
        first, last = pieces.node_range[node]
        if last - first > 1:
            waiting = push_children(pieces, node, low, high, nodes, waiting)
            continue
        goal = Goal(task.rules.goal, 0.0, lost, np.inf)
        leaf_bound(task, space, node, goal, sighted, trial)
        keep_least(trial, out)
    out[LOWER] = min(out[LOWER], left_out)


@compiled(inline=False)
def loaded_bound(
    task: Task,
    space: Space,
    pair: int,
    sighted: bool,
    ease: float,
    enough: float = np.inf,
) -> None:
    """`slice_bound` where the body is in the working space already.

    Args:
        task: The scene, pairs and rules.
        space: Its `body` is loaded; otherwise as for `slice_bound`.
        pair: Number of the pair.
        sighted: As for `leaf_bracket`.
        ease: From here on the bound may be below the best one by a part of it, where
            the partner is of many pieces; [m].
        enough: From here on no better bound is looked for, where it is of one; [m].
    """
    pieces, lost = task.pieces, task.pairs.lost[pair]
    root = pieces.root[task.pairs.obstacle[pair]]
    first, last = pieces.node_range[root]
    if last - first == 1:
        goal = Goal(task.rules.goal, 0.0, lost, enough + lost)
        leaf_bound(task, space, root, goal, sighted, space.out)
    else:
        _mesh_bound(task, space, root, lost, sighted, ease)


@compiled(inline=False)
def slice_bound(
    task: Task,
    ends: Ends,
    space: Space,
    pair: int,
    h: float,
    enough: float = np.inf,
    ease: float = np.inf,
) -> None:
    """Least clearance of a pair over a slice, proved by planes.

    Args:
        task: The scene, pairs and rules.
        ends: The slice.
        space: Working space; out[NORMAL:NEAR] is a guess of n on entry. On return `out`
            is the bracket: `lower` holds over the slice and the error box, `upper` is
            the core distance of the hull of all points, where it is known.
        pair: Number of the pair.
        h: Length of the slice; 0 for an instant, where `upper` is a true distance.
        enough: As for `loaded_bound`; inf for an instant.
        ease: The same.
    """
    load_body(task, mover_of(task, pair), ends, space.body, h)
    loaded_bound(task, space, pair, h == 0.0, ease, enough)
