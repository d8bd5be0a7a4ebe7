"""Compiled Steps 5 and 6: slide the joints of many configurations, and judge them."""

from typing import TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.planner.region_kernels import (
    keeps_out,
    leave_along,
    point_to_core,
    reach_along_circle,
    sides_of,
)

Arm: TypeAlias = tuple[FloatArray, FloatArray, float]
"""k_{i,i+1} for i = 1..N (Eq. 6) and the links' lengths, (N,) each, and the cosine of
the largest link angle; [-], [m], [-]."""

Core: TypeAlias = tuple[FloatArray, float]
"""Corners of a region, shape (n, 2), and its radius; [m]."""

Region: TypeAlias = tuple[FloatArray, FloatArray, float, float]
"""Corners, sides and radius of a region, and the bearing of its centre; [m], [rad]."""


@compiled
def _slide_chain(
    corners: FloatArray,
    sides: FloatArray,
    radius: float,
    ratios: FloatArray,
    side: int,
    direction: FloatArray,
    bearing: float,
    chain: FloatArray,
) -> None:
    """`slide_chains` for one configuration, chain of shape (N + 1, 2)."""
    ux, uy = direction[0], direction[1]
    for i in range(ratios.shape[0] - 1, 0, -1):
        x, y = ratios[i] * chain[i + 1, 0], ratios[i] * chain[i + 1, 1]
        if point_to_core(corners, x, y) < radius:
            if ux == 0.0 and uy == 0.0:
                circle = np.hypot(x, y)
                turn = reach_along_circle(corners, sides, radius, circle, bearing, side)
                x = circle * np.cos(bearing + side * turn)
                y = circle * np.sin(bearing + side * turn)
            else:
                far = leave_along(corners, sides, radius, x, y, ux, uy)
                x, y = x + far * ux, y + far * uy
        chain[i, 0], chain[i, 1] = x, y


@compiled
def slide_chains(
    corners: FloatArray,
    radius: float,
    ratios: FloatArray,
    side: int,
    direction: FloatArray,
    planar: FloatArray,
) -> None:
    """Joints from the tip to the base: in proportion, then out of the region.

    Args:
        corners: Of the region, shape (c, 2); [m].
        radius: Of the region; [m].
        ratios: k_{i,i+1} for i = 1..N (Eq. 6), shape (N,); [-].
        side: 1 or -1.
        direction: Auxiliary line, a unit vector, shape (2,); zero for circles about the
            origin; [-].
        planar: P_1..P_{N+1}, shape (n, N + 1, 2); the tips are given, the rest is set;
            [m].
    """
    sides = sides_of(corners, radius)
    bearing = np.arctan2(corners[:, 1].mean(), corners[:, 0].mean())
    for k in range(planar.shape[0]):
        _slide_chain(
            corners, sides, radius, ratios, side, direction, bearing, planar[k]
        )


@compiled
def _extent(
    chain: FloatArray,
    lengths: FloatArray,
    least_cosine: float,
    corners: FloatArray,
    radius: float,
    links: FloatArray,
) -> float:
    """Extent of one configuration along X; -1 where it cannot be taken; [m].

    Args:
        chain: P_1..P_{N+1}, shape (N + 1, 2); [m].
        lengths: Of the links, shape (N,); [m].
        least_cosine: Cosine of the largest link angle; [-].
        corners: Of the region the links keep out of, shape (c, 2); [m].
        radius: Of that region; [m].
        links: Set to the directions of the links, shape (N, 3); [-].
    """
    extent = 0.0
    for i in range(lengths.shape[0]):
        uy = (chain[i + 1, 0] - chain[i, 0]) / lengths[i]
        uz = (chain[i + 1, 1] - chain[i, 1]) / lengths[i]
        squared = 1.0 - uy * uy - uz * uz
        if not squared > 0.0:
            return -1.0
        links[i, 0], links[i, 1], links[i, 2] = np.sqrt(squared), uy, uz
        cosine = links[0, 0] if i == 0 else (links[i] * links[i - 1]).sum()
        if not cosine >= least_cosine:
            return -1.0
        a, b = chain[i], chain[i + 1]
        if not keeps_out(corners, radius, a[0], a[1], b[0], b[1]):
            return -1.0
        extent += lengths[i] * links[i, 0]
    return extent


@compiled
def standing(
    planar: FloatArray,
    lengths: FloatArray,
    least_cosine: float,
    corners: FloatArray,
    radius: float,
    largest_swing: float,
) -> BoolArray:
    """Which configurations can be taken, neighbours following each other, (n,).

    Arguments as in `_extent`; `largest_swing` is the largest change of a coordinate of
    a link's direction from one configuration to the next; [-].
    """
    able = np.zeros(planar.shape[0], np.bool_)
    before = np.zeros((lengths.shape[0], 3))
    here = np.zeros((lengths.shape[0], 3))
    for k in range(planar.shape[0]):
        extent = _extent(planar[k], lengths, least_cosine, corners, radius, here)
        able[k] = extent > 0.0
        if able[k] and k > 0 and able[k - 1]:
            able[k] = np.abs(here - before).max() <= largest_swing
        before, here = here, before
    return able


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
    ratios, lengths, least_cosine = arm
    n_links = lengths.shape[0]
    chain = np.zeros((n_links + 1, 2))
    before, here = np.zeros((n_links, 3)), np.zeros((n_links, 3))
    total, shortening = lengths.sum(), 0.0
    for k in range(0, tip.shape[0], stride):
        chain[n_links] = tip[k]
        _slide_chain(corners, sides, radius, ratios, side, direction, bearing, chain)
        extent = _extent(chain, lengths, least_cosine, forbidden[0], forbidden[1], here)
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
