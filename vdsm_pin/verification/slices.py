"""Bounds over one slice of an interval for one pair, in compiled code.

A pair is a link and an obstacle or, in the frame of another link, that link. Both
are the same to the kernels: two moving joint centres against an obstacle of the packed
scene, in which the axes of the links stand behind the obstacles.
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import second_order, sway
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.geometry.kernels import (
    BRACKET,
    LOWER,
    NEAR,
    NORMAL,
    SCRATCH_ROWS,
    UPPER,
    bracket,
    piece_support,
    rounding_radius,
)
from vdsm_pin.geometry.obstacles import (
    STACK,
    box_of,
    box_support,
    facing,
    push_children,
)
from vdsm_pin.geometry.pieces import HALF_SPACE, PackedPieces

BASE: Final = -1
"""Frame of a pair whose partner rests in the base frame."""


class Pairs(NamedTuple):
    """All pairs, in the order of the certificate.

    Args:
        link: The moving link, from 0, shape (n_pairs,).
        obstacle: Its partner in the packed scene, shape (n_pairs,).
        frame: Link in whose frame the partner rests, or BASE, shape (n_pairs,).
        required: Least clearance, shape (n_pairs,); [m].
    """

    link: IntArray
    obstacle: IntArray
    frame: IntArray
    required: FloatArray


class Rules(NamedTuple):
    """What a proof has to cover and what it may assume.

    Args:
        lengths: Link lengths, shape (N,); [m].
        radius: Radius of the links; [m].
        joint_error: Largest error of an angle; [rad].
        base_error: Largest error of x0; [m].
        obstacle_error: Largest displacement of an obstacle's surface; [m].
        pad: Bound of all rounding in one evaluation; [m].
        goal: Width of a distance bracket at which to stop; [m].
    """

    lengths: FloatArray
    radius: float
    joint_error: float
    base_error: float
    obstacle_error: float
    pad: float
    goal: float


class Ends(NamedTuple):
    """Configurations at the two ends of a slice and what lies between.

    Args:
        centres: Joint centres at both ends, shape (2, N + 1, 3); [m].
        frames: Link frames at both ends, shape (2, N, 3, 3); [-].
        bends: M of the interval, shape (N + 1, N + 1); [m].
        drifts: D of the interval, shape (N + 1, N + 1); [m].
    """

    centres: FloatArray
    frames: FloatArray
    bends: FloatArray
    drifts: FloatArray


class Space(NamedTuple):
    """Working space of the bounds, and their result.

    Args:
        points: O_i and O_{i+1} at the start, then at the end, shape (4, 3); [m].
        scratch: Shape (SCRATCH_ROWS + 2, 3).
        stack: Shape (STACK,).
        trial: Shape (BRACKET + 4,).
        out: The result, in the layout of a bracket, shape (BRACKET + 4,).
    """

    points: FloatArray
    scratch: FloatArray
    stack: IntArray
    trial: FloatArray
    out: FloatArray


@compiled
def new_space() -> Space:
    """Fresh working space."""
    apart()
    return Space(
        np.zeros((4, 3)),
        np.zeros((SCRATCH_ROWS + 2, 3)),
        np.zeros(STACK, np.int64),
        np.zeros(BRACKET + 4),
        np.zeros(BRACKET + 4),
    )


@compiled
def local_points(
    centres: FloatArray, frames: FloatArray, link: int, frame: int, points: FloatArray
) -> None:
    """O_i and O_{i+1} of a link in the frame of its partner, shape (2, 3); [m]."""
    if frame == BASE:
        for k in range(2):
            for c in range(3):
                points[k, c] = centres[link + k, c]
        return
    for k in range(2):
        x = centres[link + k, 0] - centres[frame, 0]
        y = centres[link + k, 1] - centres[frame, 1]
        z = centres[link + k, 2] - centres[frame, 2]
        for c in range(3):
            points[k, c] = (
                frames[frame, 0, c] * x
                + frames[frame, 1, c] * y
                + frames[frame, 2, c] * z
            )


@compiled
def base_direction(
    frames: FloatArray, frame: int, n: FloatArray, out: FloatArray
) -> None:
    """A direction given in a partner's frame, in the base frame; shape (3,)."""
    for c in range(3):
        if frame == BASE:
            out[c] = n[c]
        else:
            out[c] = (
                frames[frame, c, 0] * n[0]
                + frames[frame, c, 1] * n[1]
                + frames[frame, c, 2] * n[2]
            )


@compiled
def _error_growth(
    rules: Rules,
    ends: Ends,
    frame: int,
    joint: int,
    n: FloatArray,
    h: float,
    turned: FloatArray,
) -> float:
    """How far the error box may push O_joint along n over a slice; [m]."""
    first = frame + 1
    growth = second_order(rules.lengths, first, joint, rules.joint_error)
    growth += 0.5 * rules.joint_error * h * ends.drifts[first, joint]
    for k in range(2):
        base_direction(ends.frames[k], frame, n, turned)
        swing = sway(turned, ends.centres[k], ends.frames[k], first, joint)
        growth += 0.5 * rules.joint_error * swing
    return float(growth)


@compiled
def reach_along(
    rules: Rules,
    ends: Ends,
    space: Space,
    link: int,
    frame: int,
    n: FloatArray,
    h: float,
) -> float:
    """Largest n.x of a link's axis over a slice and the error box; [m].

    Args:
        rules: The error box.
        ends: The slice.
        space: Its `points` are those of the link; `scratch` is used.
        link: The link.
        frame: Frame of the partner.
        n: Unit vector towards the partner, in its frame, shape (3,); [-].
        h: Length of the slice.
    """
    apart()
    p = space.points
    reach = -np.inf
    for k in range(2):
        start = n[0] * p[k, 0] + n[1] * p[k, 1] + n[2] * p[k, 2]
        end = n[0] * p[2 + k, 0] + n[1] * p[2 + k, 1] + n[2] * p[2 + k, 2]
        far = max(start, end) + 0.125 * ends.bends[frame + 1, link + k] * h * h
        if rules.joint_error > 0.0:
            turned = space.scratch[SCRATCH_ROWS - 1]
            far += _error_growth(rules, ends, frame, link + k, n, h, turned)
        reach = max(reach, far)
    if frame == BASE:
        reach += abs(n[0]) * rules.base_error
    return reach


@compiled
def losses(rules: Rules, frame: int) -> float:
    """What every plane loses: radius of the link, obstacle error, rounding; [m]."""
    own = rules.radius + rules.pad
    return own + rules.obstacle_error if frame == BASE else own


@compiled
def load_points(ends: Ends, space: Space, link: int, frame: int) -> None:
    """Write the four points of a link over a slice to the working space."""
    apart()
    local_points(ends.centres[0], ends.frames[0], link, frame, space.points[:2])
    local_points(ends.centres[1], ends.frames[1], link, frame, space.points[2:])


@compiled
def obstacle_support(
    pieces: PackedPieces, first: int, last: int, n: FloatArray, point: FloatArray
) -> float:
    """Least n.x over the pieces [first, last), n of unit length; [m]."""
    apart()
    least = np.inf
    for p in range(first, last):
        if pieces.kind[p] == HALF_SPACE:
            return float(-pieces.extent[p])
        core = piece_support(pieces, p, n[0], n[1], n[2], point)
        least = min(least, core - rounding_radius(pieces, p))
    return least


@compiled
def piece_bound(
    pieces: PackedPieces,
    rules: Rules,
    ends: Ends,
    space: Space,
    p: int,
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
        space: Its `points` are those of the link.
        p: The piece.
        link: The link.
        frame: Frame of the partner.
        h: Length of the slice.
        out: Guess of n on entry; bracket on return, whose `lower` is the bound over
            the slice and whose `upper` is of the hull of the points alone.
    """
    apart()
    bracket(pieces, p, space.points, 4, rules.goal, space.scratch, out)
    n = out[NORMAL:NEAR]
    support = obstacle_support(pieces, p, p + 1, n, space.scratch[0])
    reach = reach_along(rules, ends, space, link, frame, n, h)
    out[LOWER] = support - reach - losses(rules, frame)


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
    """Clearance that one plane proves of all pieces of a node, by its box; [m]."""
    apart()
    if not facing(pieces, node, space.points, n):
        return -np.inf
    support = box_support(pieces, node, n[0], n[1], n[2])
    reach = reach_along(rules, ends, space, link, frame, n, h)
    return support - reach - losses(rules, frame)


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
    """`slice_bound` for an obstacle of many pieces, by its hierarchy."""
    apart()
    low, high = space.scratch[SCRATCH_ROWS], space.scratch[SCRATCH_ROWS + 1]
    box_of(space.points, 4, low, high)
    trial, out = space.trial, space.out
    trial[NORMAL:NEAR] = out[NORMAL:NEAR]
    out[LOWER] = out[UPPER] = np.inf
    space.stack[0] = root
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = space.stack[waiting]
        first, last = pieces.node_range[node]
        if last - first > 1:
            n = trial[BRACKET : BRACKET + 3]
            bound = node_bound(pieces, rules, ends, space, node, link, frame, h, n)
            if not bound >= out[LOWER]:
                waiting = push_children(pieces, node, low, high, space.stack, waiting)
            continue
        piece_bound(pieces, rules, ends, space, first, link, frame, h, trial)
        if trial[UPPER] < out[UPPER]:
            out[UPPER] = trial[UPPER]
            out[NEAR:BRACKET] = trial[NEAR:BRACKET]
        if trial[LOWER] < out[LOWER]:
            out[LOWER] = trial[LOWER]
            out[NORMAL:NEAR] = trial[NORMAL:NEAR]


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
    link, frame = pairs.link[pair], pairs.frame[pair]
    load_points(ends, space, link, frame)
    root = pieces.root[pairs.obstacle[pair]]
    first, last = pieces.node_range[root]
    if last - first == 1:
        piece_bound(pieces, rules, ends, space, first, link, frame, h, space.out)
    else:
        _mesh_bound(pieces, rules, ends, space, root, link, frame, h)
