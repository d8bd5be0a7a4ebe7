"""Witness points of a clearance on both surfaces, in the base frame, compiled."""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import place_between
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.verification.proof.layouts import AT_UPPER, OTHER, OWN, TIME, UP
from vdsm_pin.verification.proof.swept_links import Ends, local_points
from vdsm_pin.verification.proof.terms import BASE, Motion, Task


@compiled
def witness_at(
    task: Task, ends: Ends, pair: int, point: FloatArray, out: FloatArray
) -> None:
    """Surface points of a link and of its partner.

    Args:
        task: The scene, pairs and rules.
        ends: The configuration is that of the start.
        pair: The pair.
        point: Core point of the partner, in its frame, shape (3,); [m].
        out: Result, on the link, then on the partner, shape (6,); [m].
    """
    apart()
    link, frame = task.pairs.link[pair], task.pairs.frame[pair]
    core, foot, span, along = np.zeros((2, 3)), np.zeros(3), 0.0, 0.0
    local_points(ends.centres[0], ends.frames[0], link, frame, core)
    for c in range(3):
        d = core[1, c] - core[0, c]
        span += d * d
        along += d * (point[c] - core[0, c])
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    squared = 0.0
    for c in range(3):
        foot[c] = core[0, c] + t * (core[1, c] - core[0, c])
        squared += (point[c] - foot[c]) ** 2
    gap = sqrt(squared)
    share = task.rules.radius / gap if gap > 0.0 else 0.0
    for c in range(3):
        foot[c] += share * (point[c] - foot[c])
    for c in range(3):
        out[c], out[3 + c] = foot[c], point[c]
        if frame == BASE:
            continue
        out[c] = out[3 + c] = ends.centres[0, frame, c]
        for k in range(3):
            out[c] += ends.frames[0, frame, c, k] * foot[k]
            out[3 + c] += ends.frames[0, frame, c, k] * point[k]


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
    at, when, places = -1, -1.0, np.zeros(6)
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
        witness_at(task, ends, pair, row[OTHER:], places)
        row[OWN:] = places
