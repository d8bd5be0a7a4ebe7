"""A link over a slice of an interval as a convex body, in compiled code."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import second_order, sway
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.geometry.kernels import BRACKET, SCRATCH_ROWS
from vdsm_pin.geometry.obstacles import STACK
from vdsm_pin.verification.proof.terms import BASE, Rules


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
        sags: How far either may leave its chord in between, shape (2,); [m].
        scratch: Shape (SCRATCH_ROWS + 2, 3).
        nodes: Nodes still to look at, shape (STACK,).
        stack: The same while a support is looked for, shape (STACK,).
        trial: Shape (BRACKET + 4,).
        out: The result, in the layout of a bracket, shape (BRACKET + 4,).
    """

    points: FloatArray
    sags: FloatArray
    scratch: FloatArray
    nodes: IntArray
    stack: IntArray
    trial: FloatArray
    out: FloatArray


@compiled
def new_ends(n_links: int) -> Ends:
    """Fresh working space for two configurations."""
    n = n_links + 1
    return Ends(
        np.zeros((2, n, 3)),
        np.zeros((2, n_links, 3, 3)),
        np.zeros((n, n)),
        np.zeros((n, n)),
    )


@compiled
def new_space() -> Space:
    """Fresh working space."""
    apart()
    return Space(
        np.zeros((4, 3)),
        np.zeros(2),
        np.zeros((SCRATCH_ROWS + 2, 3)),
        np.zeros(STACK, np.int64),
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
        ends: The slice; read only where joints may err.
        space: Its `points` and `sags` are those of the link; `scratch` is used.
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
        far = max(start, end) + space.sags[k]
        if rules.joint_error > 0.0:
            turned = space.scratch[SCRATCH_ROWS - 1]
            far += _error_growth(rules, ends, frame, link + k, n, h, turned)
        reach = max(reach, far)
    if frame == BASE:
        reach += abs(n[0]) * rules.base_error
    return reach


@compiled
def load_points(ends: Ends, space: Space, link: int, frame: int, h: float) -> None:
    """Write the points and sags of a link over a slice to the working space."""
    apart()
    local_points(ends.centres[0], ends.frames[0], link, frame, space.points[:2])
    local_points(ends.centres[1], ends.frames[1], link, frame, space.points[2:])
    for k in range(2):
        space.sags[k] = 0.125 * ends.bends[frame + 1, link + k] * h * h
