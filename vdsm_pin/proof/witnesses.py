"""Witness points of a clearance on both surfaces, in the world's frame, compiled."""

from math import sqrt

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.proof.layouts import AT_UPPER, OTHER, OWN, TIME, UP
from vdsm_pin.proof.motions import Motion, interpolate
from vdsm_pin.proof.packed_tree import Pose, place_two
from vdsm_pin.proof.swept_bodies import Ends, place_point
from vdsm_pin.proof.terms import Mover, Task, mover_of


@compiled
def _nearest_on_axis(
    start: FloatArray, end: FloatArray, point: FloatArray, near: FloatArray
) -> None:
    """The point of a segment nearest to another point, shape (3,); [m]."""
    span = along = 0.0
    for c in range(3):
        d = end[c] - start[c]
        span += d * d
        along += d * (point[c] - start[c])
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    for c in range(3):
        near[c] = start[c] + t * (end[c] - start[c])


@compiled
def witness_at(
    mover: Mover, pose: Pose, points: FloatArray, own: FloatArray, other: FloatArray
) -> None:
    """Surface points of a body and of its partner, in the world's frame.

    Args:
        mover: The body of the pair.
        pose: The configuration.
        points: Core points of the body in its frame, not read where it is a segment,
            and of the partner in its own, shape (6,); [m].
        own: Result on the body, shape (3,); [m].
        other: Result on the partner, shape (3,); [m].
    """
    place_point(pose, mover.rest, points[3:], other)
    if mover.inverse < 0.0:
        place_point(pose, mover.frame, points, own)
    else:
        start, end = np.zeros(3), np.zeros(3)
        last = mover.corners.shape[0] - 1
        place_point(pose, mover.frame, mover.corners[0], start)
        place_point(pose, mover.frame, mover.corners[last], end)
        _nearest_on_axis(start, end, other, own)
    squared = 0.0
    for c in range(3):
        squared += (other[c] - own[c]) ** 2
    gap = sqrt(squared)
    share = mover.radius / gap if gap > 0.0 else 0.0
    for c in range(3):
        own[c] += share * (other[c] - own[c])


@compiled(inline=False)
def place_witness(
    task: Task, motion: Motion, ends: Ends, pair: int, best: FloatArray
) -> None:
    """Put the witness of a pair on the surfaces, in the world's frame.

    Args:
        task: The scene, bodies and pairs.
        motion: Rows of joint values.
        ends: Working space.
        pair: The pair.
        best: Its best row with core points; witnesses on return, where there are any.
    """
    if not best[UP] < np.inf:
        return
    mover, own, other = mover_of(task, pair), np.zeros(3), np.zeros(3)
    interpolate(motion, int(best[AT_UPPER]), best[TIME], ends.q)
    frames = mover.rest, mover.frame
    place_two(task.tree, ends.q, frames, ends.bends.steps, ends.start)
    witness_at(mover, ends.start, best[OWN:], own, other)
    best[OWN:OTHER], best[OTHER:] = own, other


@compiled(inline=False)
def place_best(task: Task, motion: Motion, ends: Ends, best: FloatArray) -> None:
    """The same of all pairs, their best rows of shape (n_pairs, BEST)."""
    for pair in range(best.shape[0]):
        place_witness(task, motion, ends, pair, best[pair])
