"""Compiled Steps 5 and 6: slide the joints of many configurations, and judge them."""

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.planner.region_kernels import (
    leave_along,
    reach_along_circle,
    segment_to_core,
    sides_of,
)


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
        if segment_to_core(corners, x, y, x, y) < radius:
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
        corners: Of the region.
        radius: Of the region.
        ratios: k_{i,i+1} for i = 1..N (Eq. 6), shape (N,).
        side: 1 or -1.
        direction: Auxiliary line, a unit vector; zero for circles about the origin.
        planar: P_1..P_{N+1}, shape (n, N + 1, 2); the tips are given, the rest is set.
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
    """Extent of one configuration along X; -1 where it cannot be taken.

    Args:
        chain: P_1..P_{N+1}, shape (N + 1, 2).
        lengths: Of the links, shape (N,).
        least_cosine: Cosine of the largest link angle.
        corners: Of the region the links keep out of.
        radius: Of that region.
        links: Set to the directions of the links, shape (N, 3).
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
        if not segment_to_core(corners, a[0], a[1], b[0], b[1]) >= radius:
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
def reach_of_rule(
    tip: FloatArray,
    corners: FloatArray,
    radius: float,
    ratios: FloatArray,
    side: int,
    direction: FloatArray,
    lengths: FloatArray,
    least_cosine: float,
    forbidden: FloatArray,
    forbidden_radius: float,
    largest_swing: float,
) -> tuple[int, float]:
    """How many tip positions in a row a rule brings the arm to, from the first on.

    Args:
        tip: Shape (n, 2).
        corners: Of the region the joints slide on.
        radius: Of that region.
        ratios: As in `slide_chains`.
        side: As in `slide_chains`.
        direction: As in `slide_chains`.
        lengths: Of the links, shape (N,).
        least_cosine: Cosine of the largest link angle.
        forbidden: Corners of the region the links keep out of.
        forbidden_radius: Of that region.
        largest_swing: As in `standing`.

    Returns:
        The count, and the largest shortening of the arm along X among them.
    """
    sides = sides_of(corners, radius)
    bearing = np.arctan2(corners[:, 1].mean(), corners[:, 0].mean())
    n_links = lengths.shape[0]
    chain = np.zeros((n_links + 1, 2))
    before, here = np.zeros((n_links, 3)), np.zeros((n_links, 3))
    total, shortening = lengths.sum(), 0.0
    for k in range(tip.shape[0]):
        chain[n_links] = tip[k]
        _slide_chain(corners, sides, radius, ratios, side, direction, bearing, chain)
        extent = _extent(
            chain, lengths, least_cosine, forbidden, forbidden_radius, here
        )
        if extent < 0.0:
            return k, shortening
        if k > 0 and not np.abs(here - before).max() <= largest_swing:
            return k, shortening
        shortening = max(shortening, total - extent)
        before, here = here, before
    return tip.shape[0], shortening
