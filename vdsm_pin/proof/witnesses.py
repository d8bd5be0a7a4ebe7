"""Witness points of a clearance on both surfaces, in the base frame, compiled."""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import place_between
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.proof.layouts import AT_UPPER, OWN, TIME, UP
from vdsm_pin.proof.swept_bodies import Ends, place_point
from vdsm_pin.proof.terms import BASE, Motion, Mover, Task, mover_of


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
    mover: Mover,
    centres: FloatArray,
    frames: FloatArray,
    points: FloatArray,
    own: FloatArray,
    other: FloatArray,
) -> None:
    """Surface points of a body and of its partner, in the base frame.

    Args:
        mover: The body of the pair.
        centres: Joint centres of the configuration, shape (N + 1, 3); [m].
        frames: R_base_link, shape (N, 3, 3); [-].
        points: Core points of the body in its link's frame, not read where it is an
            axis, and of the partner in its own, shape (6,); [m].
        own: Result on the body, shape (3,); [m].
        other: Result on the partner, shape (3,); [m].
    """
    link, frame = mover.link, mover.first - 1
    if frame == BASE:
        other[:] = points[3:]
    else:
        place_point(centres, frames, frame, points[3:], other)
    if mover.axial:
        _nearest_on_axis(centres[link], centres[link + 1], other, own)
    else:
        place_point(centres, frames, link, points, own)
    squared = 0.0
    for c in range(3):
        squared += (other[c] - own[c]) ** 2
    gap = sqrt(squared)
    share = mover.radius / gap if gap > 0.0 else 0.0
    for c in range(3):
        own[c] += share * (other[c] - own[c])


@compiled
def place_best(
    task: Task, motion: Motion, ends: Ends, best: FloatArray, order: IntArray
) -> None:
    """Put the witnesses of all pairs on the surfaces, in the base frame.

    Args:
        task: The scene, bodies and pairs.
        motion: Rows of joint values.
        ends: Working space.
        best: Best rows with core points; witnesses on return.
        order: The pairs, those of one instant together, shape (n_pairs,).
    """
    at, when, places = -1, -1.0, np.zeros((2, 3))
    for pair in order:
        row = best[pair]
        if not row[UP] < np.inf:
            continue
        if at != int(row[AT_UPPER]) or when != row[TIME]:
            at, when = int(row[AT_UPPER]), row[TIME]
            last = min(at + 2, motion.x0.size)
            time = when if last - at == 2 else 0.0
            place_between(
                time,
                motion.x0[at:last],
                motion.alpha[at:last],
                motion.theta[at:last],
                task.rules.lengths,
                ends.centres[0],
                ends.frames[0],
            )
        centres, frames = ends.centres[0], ends.frames[0]
        mover = mover_of(task, pair)
        witness_at(mover, centres, frames, row[OWN:], places[0], places[1])
        row[OWN:] = places.ravel()
