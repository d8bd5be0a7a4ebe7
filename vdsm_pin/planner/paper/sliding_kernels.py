"""Compiled Steps 5 and 6: slide the joints of many configurations, and judge them."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.paper.region_kernels import (
    Core,
    keeps_out,
    leave_along,
    point_to_core,
    reach_along_circle,
    sides_of,
)


class Links(NamedTuple):
    """What the steps know of the arm, and how far regions are grown for its links."""

    ratios: FloatArray
    """k_{i,i+1} for i = 1..N (Eq. 6), shape (N,); [-]."""

    lengths: FloatArray
    """Shape (N,); [m]."""

    margins: FloatArray
    """How far regions are grown for each link, shape (N,); [m]."""

    least_cosine: float
    """Cosine of the largest link angle; [-]."""


class Slide(NamedTuple):
    """How joints get out of a region."""

    core: Core
    """The region."""

    sides: FloatArray
    """Straight parts of its boundary, shape (c, 2, 2); [m]."""

    bearing: float
    """Of the middle of its corners; [rad]."""

    side: int
    """1 or -1."""

    direction: FloatArray
    """Auxiliary line, a unit vector, shape (2,); zero for circles about the origin;
    [-]."""


class Standing(NamedTuple):
    """When a configuration can be taken."""

    links: Links
    """The arm."""

    forbidden: Core
    """What its links keep out of."""

    largest_swing: float
    """Largest change of a coordinate of a link's direction from one configuration to
    the next; [-]."""


@compiled
def slide_of(core: Core, side: int, direction: FloatArray) -> Slide:
    """How joints get out of a region on a side, along lines of a direction."""
    corners = core.corners
    bearing = np.arctan2(corners[:, 1].mean(), corners[:, 0].mean())
    return Slide(core, sides_of(corners, core.radius), bearing, side, direction)


@compiled
def slide_chain(slide: Slide, links: Links, chain: FloatArray) -> None:
    """`slide_chains` for one configuration, chain of shape (N + 1, 2)."""
    corners, side = slide.core.corners, slide.side
    ux, uy = slide.direction[0], slide.direction[1]
    for i in range(links.ratios.shape[0] - 1, 0, -1):
        x, y = links.ratios[i] * chain[i + 1, 0], links.ratios[i] * chain[i + 1, 1]
        # Joint i ends link i - 1 and begins link i: the larger margin counts.
        margin = max(links.margins[i - 1], links.margins[i])
        reach = slide.core.radius + margin
        if point_to_core(corners, x, y) < reach:
            edge = slide.sides if margin == 0.0 else sides_of(corners, reach)
            if ux == 0.0 and uy == 0.0:
                circle = np.hypot(x, y)
                turn = reach_along_circle(
                    corners, edge, reach, circle, slide.bearing, side
                )
                x = circle * np.cos(slide.bearing + side * turn)
                y = circle * np.sin(slide.bearing + side * turn)
            else:
                far = leave_along(corners, edge, reach, x, y, ux, uy)
                x, y = x + far * ux, y + far * uy
        chain[i, 0], chain[i, 1] = x, y


@compiled
def slide_chains(slide: Slide, links: Links, planar: FloatArray) -> None:
    """Joints from the tip to the base: in proportion, then out of the region.

    Args:
        slide: The region and how the joints get out of it.
        links: The arm.
        planar: P_1..P_{N+1}, shape (n, N + 1, 2); the tips are given, the rest is set;
            [m].
    """
    for k in range(planar.shape[0]):
        slide_chain(slide, links, planar[k])


@compiled
def extent_of(chain: FloatArray, able: Standing, directions: FloatArray) -> float:
    """Extent of one configuration along X; -1 where it cannot be taken; [m].

    Args:
        chain: P_1..P_{N+1}, shape (N + 1, 2); [m].
        able: When it can.
        directions: Set to those of the links, shape (N, 3); [-].
    """
    (links, forbidden, _), extent = able, 0.0
    for i in range(links.lengths.shape[0]):
        uy = (chain[i + 1, 0] - chain[i, 0]) / links.lengths[i]
        uz = (chain[i + 1, 1] - chain[i, 1]) / links.lengths[i]
        squared = 1.0 - uy * uy - uz * uz
        if not squared > 0.0:
            return -1.0
        here = directions[i]
        here[0], here[1], here[2] = np.sqrt(squared), uy, uz
        cosine = here[0] if i == 0 else (here * directions[i - 1]).sum()
        if not cosine >= links.least_cosine:
            return -1.0
        a, b, radius = chain[i], chain[i + 1], forbidden.radius + links.margins[i]
        if not keeps_out(forbidden.corners, radius, a[0], a[1], b[0], b[1]):
            return -1.0
        extent += links.lengths[i] * here[0]
    return extent


@compiled
def standing(planar: FloatArray, able: Standing) -> BoolArray:
    """Which configurations can be taken, neighbours following each other, (n,).

    Args:
        planar: P_1..P_{N+1} of each, shape (n, N + 1, 2); [m].
        able: When they can.
    """
    taken, n_links = np.zeros(planar.shape[0], np.bool_), planar.shape[1] - 1
    before, here = np.zeros((n_links, 3)), np.zeros((n_links, 3))
    for k in range(planar.shape[0]):
        taken[k] = extent_of(planar[k], able, here) > 0.0
        if taken[k] and k > 0 and taken[k - 1]:
            taken[k] = np.abs(here - before).max() <= able.largest_swing
        before, here = here, before
    return taken
