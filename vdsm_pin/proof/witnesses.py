"""Witness points of a clearance on both surfaces, in the base frame, compiled."""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import place_between
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.proof.layouts import AT_UPPER, OTHER, OWN, TIME, UP
from vdsm_pin.proof.swept_links import Ends, local_points
from vdsm_pin.proof.terms import BASE, Motion, Task


@compiled
def witness_at(
    link: int,
    frame: int,
    radius: float,
    centres: FloatArray,
    frames: FloatArray,
    point: FloatArray,
    core: FloatArray,
    own: FloatArray,
    other: FloatArray,
) -> None:
    """Surface points of a link and of its partner, in the base frame.

    It takes bare arrays: handing on whole tuples takes longer than all it does.

    Args:
        link: The link.
        frame: Frame of the partner.
        radius: Of the links; [m].
        centres: Joint centres of the configuration, shape (N + 1, 3); [m].
        frames: R_base_link, shape (N, 3, 3); [-].
        point: Core point of the partner, in its frame, shape (3,); [m].
        core: Working space, shape (2, 3).
        own: Result on the link, shape (3,); [m].
        other: Result on the partner, shape (3,); [m].
    """
    local_points(centres, frames, link, frame, core)
    span = along = squared = 0.0
    for c in range(3):
        d = core[1, c] - core[0, c]
        span += d * d
        along += d * (point[c] - core[0, c])
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    for c in range(3):
        core[0, c] += t * (core[1, c] - core[0, c])
        squared += (point[c] - core[0, c]) ** 2
    gap = sqrt(squared)
    share = radius / gap if gap > 0.0 else 0.0
    for c in range(3):
        core[0, c] += share * (point[c] - core[0, c])
    for c in range(3):
        own[c], other[c] = core[0, c], point[c]
        if frame == BASE:
            continue
        own[c] = other[c] = centres[frame, c]
        for k in range(3):
            own[c] += frames[frame, c, k] * core[0, k]
            other[c] += frames[frame, c, k] * point[k]


@compiled
def place_best(
    task: Task, motion: Motion, ends: Ends, best: FloatArray, order: IntArray
) -> None:
    """Put the witnesses of all pairs on the surfaces, in the base frame.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        ends: Working space.
        best: Best rows with core points of the partners; witnesses on return.
        order: The pairs, those of one instant together, shape (n_pairs,).
    """
    at, when, core = -1, -1.0, np.zeros((2, 3))
    pairs, places = task.pairs, np.zeros((2, 3))
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
        witness_at(
            pairs.link[pair],
            pairs.frame[pair],
            task.rules.radius,
            ends.centres[0],
            ends.frames[0],
            row[OTHER:],
            core,
            places[0],
            places[1],
        )
        row[OWN:] = places.ravel()
