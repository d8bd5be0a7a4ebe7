"""Compiled trial of the rules of a side: which brings the tip farthest."""

from typing import TypeAlias

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.paper.region_kernels import sides_of
from vdsm_pin.planner.paper.sliding_kernels import extent_of, slide_chain

Arm: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, float]
"""k_{i,i+1} for i = 1..N (Eq. 6), the links' lengths and margins, (N,) each, and the
cosine of the largest link angle; [-], [m], [m], [-]."""

Core: TypeAlias = tuple[FloatArray, float]
"""Corners of a region, shape (n, 2), and its radius; [m]."""

Region: TypeAlias = tuple[FloatArray, FloatArray, float, float]
"""Corners, sides and radius of a region, and the bearing of its centre; [m], [rad]."""


@compiled
def _reach(
    tip: FloatArray,
    stride: int,
    region: Region,
    direction: FloatArray,
    side: int,
    arm: Arm,
    forbidden: Core,
    largest_swing: float,
    most: float,
) -> tuple[int, float]:
    """How many tip positions in a row a rule brings the arm to, from the first on.

    Args:
        tip: Projected, shape (n, 2); [m].
        stride: Every so manieth is looked at.
        region: What the joints slide on.
        direction: As in `slide_chains`.
        side: As in `slide_chains`.
        arm: The arm.
        forbidden: What the links keep out of.
        largest_swing: As in `standing`.
        most: Where the arm is shortened by as much or more, the rest is not looked at;
            [m].

    Returns:
        The count, and the largest shortening of the arm along X among them; [m].
    """
    corners, sides, radius, bearing = region
    ratios, lengths, margins, least_cosine = arm
    n_links = lengths.shape[0]
    chain = np.zeros((n_links + 1, 2))
    before, here = np.zeros((n_links, 3)), np.zeros((n_links, 3))
    total, shortening = lengths.sum(), 0.0
    for k in range(0, tip.shape[0], stride):
        chain[n_links] = tip[k]
        slide_chain(
            corners, sides, radius, ratios, margins, side, direction, bearing, chain
        )
        extent = extent_of(
            chain, lengths, least_cosine, forbidden[0], forbidden[1], margins, here
        )
        if extent < 0.0:
            return k, shortening
        if k > 0 and not np.abs(here - before).max() <= largest_swing:
            return k, shortening
        shortening = max(shortening, total - extent)
        if shortening >= most:
            return k, shortening
        before, here = here, before
    return tip.shape[0], shortening


@compiled
def _score(
    tips: FloatArray,
    firsts: IntArray,
    stride: int,
    region: Region,
    direction: FloatArray,
    side: int,
    arm: Arm,
    forbidden: Core,
    largest_swing: float,
    best: int,
    least: float,
) -> tuple[int, float]:
    """How many of the wanted tips a rule reaches, and how far it shortens the arm.

    Arguments as in `best_rule` and `_reach`; -1 as soon as the rule is seen to reach
    fewer than `best`, or as many and to shorten the arm by no less than `least`.
    """
    reached, shortening = 0, 0.0
    most = least if best == len(tips) else np.inf
    for k in range(len(firsts) - 1):
        tip, rest = tips[firsts[k] : firsts[k + 1]], len(tips) - firsts[k + 1]
        needed = best - reached - rest
        if needed > 0:
            # The last waypoint it must reach is where most rules fail.
            last = (needed - 1) // stride * stride
            hard = tip[last : last + 1]
            count, _ = _reach(
                hard, 1, region, direction, side, arm, forbidden, np.inf, most
            )
            if count == 0:
                return -1, 0.0
        count, shortened = _reach(
            tip, stride, region, direction, side, arm, forbidden, np.inf, most
        )
        if count == len(tip):
            count, shortened = _reach(
                tip, 1, region, direction, side, arm, forbidden, largest_swing, most
            )
        reached, shortening = reached + count, max(shortening, shortened)
        if reached + rest < best or shortening >= most:
            return -1, 0.0
    return reached, shortening


@compiled
def best_rule(
    tips: FloatArray,
    firsts: IntArray,
    stride: int,
    lines: FloatArray,
    cores: FloatArray,
    n_corners: IntArray,
    radii: FloatArray,
    trials: IntArray,
    n_cross: int,
    side: int,
    arm: Arm,
    forbidden: Core,
    largest_swing: float,
) -> int:
    """The rule that brings the tip farthest; of several, the one that shortens least.

    The first of the cross that does all that is wanted is taken at once.

    Args:
        tips: The sequences of tips wanted, one after the other, shape (n, 2); [m].
        firsts: Where each sequence begins, and n, shape (m + 1,).
        stride: Rules are compared on every so manieth tip, then confirmed on all.
        lines: Directions as in `slide_chains`, shape (k, 2); [-].
        cores: Corners of the regions, shape (r, c, 2), filled up with anything; [m].
        n_corners: How many each has, shape (r,).
        radii: Of the regions, shape (r,); [m].
        trials: What is tried: line and region, shape (t, 2).
        n_cross: How many of the trials are the cross; they come first.
        side: As in `slide_chains`.
        arm: The arm.
        forbidden: What the links keep out of.
        largest_swing: As in `standing`.

    Returns:
        Number of the trial.
    """
    chosen, best, least = 0, -1, np.inf
    for trial in range(len(trials)):
        line, r = trials[trial]
        corners = cores[r, : n_corners[r]]
        bearing = np.arctan2(corners[:, 1].mean(), corners[:, 0].mean())
        region = corners, sides_of(corners, radii[r]), radii[r], bearing
        reached, shortening = _score(
            tips,
            firsts,
            stride,
            region,
            lines[line],
            side,
            arm,
            forbidden,
            largest_swing,
            best,
            least,
        )
        if reached > best or (reached == best and shortening < least):
            chosen, best, least = trial, reached, shortening
        if trial < n_cross and reached == len(tips):
            break
    return chosen
