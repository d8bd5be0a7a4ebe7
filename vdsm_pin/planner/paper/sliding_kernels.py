"""Compiled Steps 5 and 6: slide the joints of many configurations, and judge them."""

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.paper.region_kernels import (
    keeps_out,
    leave_along,
    point_to_core,
    reach_along_circle,
    sides_of,
)


@compiled
def slide_chain(
    corners: FloatArray,
    sides: FloatArray,
    radius: float,
    ratios: FloatArray,
    margins: FloatArray,
    side: int,
    direction: FloatArray,
    bearing: float,
    chain: FloatArray,
) -> None:
    """`slide_chains` for one configuration, chain of shape (N + 1, 2)."""
    ux, uy = direction[0], direction[1]
    for i in range(ratios.shape[0] - 1, 0, -1):
        x, y = ratios[i] * chain[i + 1, 0], ratios[i] * chain[i + 1, 1]
        # Joint i ends link i - 1 and begins link i: the larger margin counts.
        margin = max(margins[i - 1], margins[i])
        reach = radius + margin
        if point_to_core(corners, x, y) < reach:
            edge = sides if margin == 0.0 else sides_of(corners, reach)
            if ux == 0.0 and uy == 0.0:
                circle = np.hypot(x, y)
                turn = reach_along_circle(corners, edge, reach, circle, bearing, side)
                x = circle * np.cos(bearing + side * turn)
                y = circle * np.sin(bearing + side * turn)
            else:
                far = leave_along(corners, edge, reach, x, y, ux, uy)
                x, y = x + far * ux, y + far * uy
        chain[i, 0], chain[i, 1] = x, y


@compiled
def slide_chains(
    corners: FloatArray,
    radius: float,
    ratios: FloatArray,
    margins: FloatArray,
    side: int,
    direction: FloatArray,
    planar: FloatArray,
) -> None:
    """Joints from the tip to the base: in proportion, then out of the region.

    Args:
        corners: Of the region, shape (c, 2); [m].
        radius: Of the region; [m].
        ratios: k_{i,i+1} for i = 1..N (Eq. 6), shape (N,); [-].
        margins: How far the region is grown for each link, shape (N,); [m].
        side: 1 or -1.
        direction: Auxiliary line, a unit vector, shape (2,); zero for circles about the
            origin; [-].
        planar: P_1..P_{N+1}, shape (n, N + 1, 2); the tips are given, the rest is set;
            [m].
    """
    sides = sides_of(corners, radius)
    bearing = np.arctan2(corners[:, 1].mean(), corners[:, 0].mean())
    for k in range(planar.shape[0]):
        slide_chain(
            corners, sides, radius, ratios, margins, side, direction, bearing, planar[k]
        )


@compiled
def extent_of(
    chain: FloatArray,
    lengths: FloatArray,
    least_cosine: float,
    corners: FloatArray,
    radius: float,
    margins: FloatArray,
    links: FloatArray,
) -> float:
    """Extent of one configuration along X; -1 where it cannot be taken; [m].

    Args:
        chain: P_1..P_{N+1}, shape (N + 1, 2); [m].
        lengths: Of the links, shape (N,); [m].
        least_cosine: Cosine of the largest link angle; [-].
        corners: Of the region the links keep out of, shape (c, 2); [m].
        radius: Of that region; [m].
        margins: How far the region is grown for each link, shape (N,); [m].
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
        if not keeps_out(corners, radius + margins[i], a[0], a[1], b[0], b[1]):
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
    margins: FloatArray,
    largest_swing: float,
) -> BoolArray:
    """Which configurations can be taken, neighbours following each other, (n,).

    Arguments as in `extent_of`; `largest_swing` is the largest change of a coordinate
    of a link's direction from one configuration to the next; [-].
    """
    able = np.zeros(planar.shape[0], np.bool_)
    before = np.zeros((lengths.shape[0], 3))
    here = np.zeros((lengths.shape[0], 3))
    for k in range(planar.shape[0]):
        extent = extent_of(
            planar[k], lengths, least_cosine, corners, radius, margins, here
        )
        able[k] = extent > 0.0
        if able[k] and k > 0 and able[k - 1]:
            able[k] = np.abs(here - before).max() <= largest_swing
        before, here = here, before
    return able
