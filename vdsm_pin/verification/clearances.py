"""The least clearance of every pair, and a ball in both bodies where they meet."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.proof.proofs import Proof
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.brackets import ClearanceProfile, LeastClearances
from vdsm_pin.verification.contacts import (
    BESIDE,
    HALVINGS,
    MEETING,
    NEXT,
    Placed,
    common_ball,
    seeming_depth,
)
from vdsm_pin.verification.moving import Knots

MOST: Final = 32
"""Pairs in which common balls are looked for: undecided ones, then the nearest."""


def least_clearances(asked: Assembly, proof: Proof) -> LeastClearances:
    """What a proof says of every pair, the witness on the link first."""
    points = proof.points.copy()
    points[asked.outer] = points[asked.outer, ::-1]
    return LeastClearances(
        interval=proof.interval,
        share=proof.share,
        lower=proof.lower,
        upper=proof.upper,
        verdict=proof.verdict,
        link_point=frozen(points[:, 0]),
        other_point=frozen(points[:, 1]),
    )


def with_depths(
    motion: AskedMotion,
    least: LeastClearances,
    enough: float = np.inf,
    span: FloatArray | None = None,
    deadline: Deadline = NO_LIMIT,
) -> LeastClearances:
    """The same, with the depths that balls in both bodies prove.

    Of what a ball about its core grows no depth beyond that is looked for.

    Args:
        motion: What is asked.
        least: What is proved of it, or of a part.
        enough: No ball deeper than this is looked for; [m].
        span: From when to when that is, in knots of the path; None for all of it.
        deadline: When to leave it at what was found.
    """
    near = (least.verdict != CERTIFIED) & (least.upper <= MEETING)
    span = motion.span_on_path if span is None else span
    changed = dict[int, tuple[Any, ...]]()
    lost = least.verdict == REFUTED
    known = np.flatnonzero(near & lost).tolist()
    near[[k for k in known if motion.asked.ball(k) > 0.0]] = False
    pairs = np.flatnonzero(near)
    first = np.lexsort([least.upper[pairs], lost[pairs]])[:MOST]
    for k in pairs[first].tolist():
        moment = least.interval[k] + least.share[k]
        middle = 0.5 * (least.link_point[k] + least.other_point[k])
        for at in _moments(motion, k, moment, middle, span, deadline):
            if deadline.passed:
                return least.with_rows(changed)
            radius, centre = common_ball(*_placed(motion, k, at), middle, enough)
            if radius > max(0.0, -float(least.upper[k])):
                (interval,), (share,) = motion.path.split(np.array([at]))
                bounds = least.lower[k], -radius
                changed[k] = interval, share, *bounds, REFUTED, centre, centre
                break
    return least.with_rows(changed)


def _placed(motion: AskedMotion, k: int, moment: float) -> tuple[Placed, Placed]:
    """Both bodies of a pair at a moment in knots."""
    (pose,) = motion.asked.poses(motion.path.at_moments(np.array([moment])))
    return motion.asked.placed(k, pose)


def _moments(
    motion: AskedMotion,
    k: int,
    moment: float,
    middle: FloatArray,
    span: FloatArray,
    deadline: Deadline,
) -> Iterator[float]:
    """When a pair may meet: at a moment, beside it, where it seems deepest near it.

    Bodies that graze meet for less time than there is to the moments beside.
    """
    length = min(1.0, float(span[1] - span[0]))
    yield from np.clip(moment + length * BESIDE, *span).tolist()

    def depth(at: float) -> float:
        return seeming_depth(*_placed(motion, k, at), middle)

    most, step = depth(moment), length * NEXT
    for _ in range(HALVINGS if length else 0):
        step *= 0.5
        for at in np.clip([moment - step, moment + step], *span).tolist():
            if deadline.passed:
                return
            if (found := depth(at)) > most:
                most, moment = found, at
    yield moment


def in_rows(least: LeastClearances, knots: Knots) -> LeastClearances:
    """The same, its moments in intervals of the trajectory."""
    if knots.are_rows:
        return least
    share = knots.share(least.interval, least.share)
    return replace(least, interval=knots.interval(least.interval), share=share)


def profile_of(
    profile: FloatArray, stride: int, knots: Knots, n_links: int
) -> ClearanceProfile:
    """Brackets along a motion, by intervals of its trajectory.

    Args:
        profile: By column in bins of intervals of the joint path, those of links first,
            shape (2, n_columns, n_bins); [m].
        stride: Intervals of a bin.
        knots: Of the trajectory.
        n_links: Columns of links.
    """
    first = np.arange(profile.shape[2]) * stride
    if not knots.are_rows:
        first, begins = np.unique(knots.interval(first), return_index=True)
        profile = np.minimum.reduceat(profile, begins, axis=2)
    profile.setflags(write=False)
    return ClearanceProfile(
        link_lower=profile[0, :n_links].T,
        link_upper=profile[1, :n_links].T,
        obstacle_lower=profile[0, n_links:].T,
        obstacle_upper=profile[1, n_links:].T,
        first_interval=frozen(first, np.int64),
    )
