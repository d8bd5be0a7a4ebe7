"""Bounds over one slice of an interval for one pair, in compiled code."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.geometry.kernels import (
    BRACKET,
    LOWER,
    NEAR,
    NORMAL,
    SCRATCH_ROWS,
    UPPER,
    bracket,
    keep_least,
)
from vdsm_pin.geometry.obstacles import (
    box_of,
    box_support,
    facing,
    node_support,
    push_children,
)
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.verification.proof.bodies import Ends, Space, load_points, reach_along
from vdsm_pin.verification.proof.terms import Pairs, Rules, losses


@compiled
def plane_bound(
    pieces: PackedPieces,
    rules: Rules,
    ends: Ends,
    space: Space,
    node: int,
    link: int,
    frame: int,
    h: float,
    n: FloatArray,
) -> float:
    """Clearance that a plane proves of all pieces of a node over a slice; [m]."""
    apart()
    support = node_support(pieces, node, n, space.stack, space.scratch[0])
    reach = reach_along(rules, ends, space, link, frame, n, h)
    return support - reach - losses(rules, frame)


@compiled
def node_bound(
    pieces: PackedPieces,
    rules: Rules,
    ends: Ends,
    space: Space,
    node: int,
    link: int,
    frame: int,
    h: float,
    n: FloatArray,
) -> float:
    """The same of a plane that faces the node's box, written to n, by that box; [m]."""
    apart()
    if not facing(pieces, node, space.points, n):
        return -np.inf
    support = box_support(pieces, node, n[0], n[1], n[2])
    reach = reach_along(rules, ends, space, link, frame, n, h)
    return support - reach - losses(rules, frame)


@compiled
def leaf_bound(
    pieces: PackedPieces,
    rules: Rules,
    ends: Ends,
    space: Space,
    node: int,
    link: int,
    frame: int,
    h: float,
    out: FloatArray,
) -> None:
    """Replace the distance bracket of a piece by the clearance that its plane proves.

    Args:
        pieces: The scene.
        rules: The error box.
        ends: The slice.
        space: Its `points` and `sags` are those of the link.
        node: Node of the one piece.
        link: The link.
        frame: Frame of the partner.
        h: Length of the slice.
        out: Guess of n on entry; bracket on return, whose `lower` is the bound over
            the slice and whose `upper` is of the hull of the points alone.
    """
    apart()
    p = pieces.node_range[node, 0]
    bracket(pieces, p, space.points, 4, rules.goal, space.scratch, out)
    n = out[NORMAL:NEAR]
    out[LOWER] = plane_bound(pieces, rules, ends, space, node, link, frame, h, n)


@compiled
def _mesh_bound(
    pieces: PackedPieces,
    rules: Rules,
    ends: Ends,
    space: Space,
    root: int,
    link: int,
    frame: int,
    h: float,
) -> None:
    """`loaded_bound` for an obstacle of many pieces, by its hierarchy."""
    apart()
    low, high = space.scratch[SCRATCH_ROWS], space.scratch[SCRATCH_ROWS + 1]
    box_of(space.points, 4, low, high)
    nodes, trial, out = space.nodes, space.trial, space.out
    trial[NORMAL:NEAR] = out[NORMAL:NEAR]
    out[LOWER] = out[UPPER] = np.inf
    nodes[0] = root
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = nodes[waiting]
        n = trial[BRACKET : BRACKET + 3]
        bound = node_bound(pieces, rules, ends, space, node, link, frame, h, n)
        if bound >= out[LOWER]:
            continue
        first, last = pieces.node_range[node]
        if last - first > 1:
            waiting = push_children(pieces, node, low, high, nodes, waiting)
            continue
        leaf_bound(pieces, rules, ends, space, node, link, frame, h, trial)
        keep_least(trial, out)


@compiled
def loaded_bound(
    pieces: PackedPieces,
    pairs: Pairs,
    rules: Rules,
    ends: Ends,
    space: Space,
    pair: int,
    h: float,
) -> None:
    """`slice_bound` where points and sags are in the working space already."""
    apart()
    link, frame = pairs.link[pair], pairs.frame[pair]
    root = pieces.root[pairs.obstacle[pair]]
    first, last = pieces.node_range[root]
    if last - first == 1:
        leaf_bound(pieces, rules, ends, space, root, link, frame, h, space.out)
    else:
        _mesh_bound(pieces, rules, ends, space, root, link, frame, h)


@compiled
def slice_bound(
    pieces: PackedPieces,
    pairs: Pairs,
    rules: Rules,
    ends: Ends,
    space: Space,
    pair: int,
    h: float,
) -> None:
    """Least clearance of a pair over a slice, proved by planes.

    Args:
        pieces: The scene.
        pairs: All pairs.
        rules: The error box.
        ends: The slice.
        space: Working space; out[NORMAL:NEAR] is a guess of n on entry. On return `out`
            is the bracket: `lower` holds over the slice and the error box, `upper` is
            the core distance of the hull of the four points.
        pair: Number of the pair.
        h: Length of the slice; 0 for an instant, where `upper` is a true distance.
    """
    apart()
    load_points(ends, space, pairs.link[pair], pairs.frame[pair], h)
    loaded_bound(pieces, pairs, rules, ends, space, pair, h)
