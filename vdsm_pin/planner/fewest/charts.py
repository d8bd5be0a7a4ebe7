"""The two charts of configurations: how arms mutate, how centres become coordinates.

Offsets of the joints' projections hold arms whose links lean ahead, directions of the
links hold all.
"""

from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.fewest.direction_kernels import (
    lined_up_directions,
    mutated_directions,
)
from vdsm_pin.planner.fewest.motion import is_directed, standing
from vdsm_pin.planner.fewest.offset_kernels import SCALES, lined_up, mutated_offsets

TURNS: Final = (0.02, 0.08, 0.25)
"""Sizes of a turn of links; [rad]."""


def coordinates(arm: Manipulator, centres: FloatArray, directed: bool) -> FloatArray:
    """The shape coordinates of arms.

    Args:
        arm: The arm.
        centres: Joint centres, shape (n, N + 1, 3); [m].
        directed: Whether in directions of links, which may lean any way.

    Returns:
        Directions, shape (n, N, 3) [-], or offsets D_1..D_{N+1} of the joints'
        projections, shape (n, N + 1, 2) [m].
    """
    if directed:
        return np.asarray(np.diff(centres, axis=1) / arm.link_lengths[:, None])
    offsets = centres[:, :, 1:] - arm.ratios[:, None] * centres[:, -1:, 1:]
    offsets[:, [0, -1]] = 0.0
    return np.asarray(offsets)


def mutated(
    arm: Manipulator, shapes: FloatArray, moved: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Children of arms, one each; see `mutated_offsets` and `mutated_directions`.

    Args:
        arm: The arm.
        shapes: Their shape coordinates.
        moved: How far the tip has moved across the rail since, shape (n, 2); [m].
        rng: Source of chance.
    """
    n = len(shapes)
    if is_directed(shapes):
        scale = rng.choice(np.array(TURNS), n)
        turn = rng.normal(size=(n, 3)) * scale[:, None]
        first, count, kind = rng.random((3, n))
        return mutated_directions(shapes, first, count, kind, turn)
    scale = rng.choice(np.array(SCALES), n) * arm.total_length
    shift = rng.normal(size=(n, 2)) * scale[:, None]
    joint, kind = rng.random((2, n))
    return mutated_offsets(shapes, arm.stations, moved, joint, kind, shift)


def settled(arm: Manipulator, tips: FloatArray, shapes: FloatArray) -> FloatArray:
    """The shape coordinates with the base brought onto its rail, if it can be."""
    if not is_directed(shapes):
        return shapes
    centres = standing(arm, tips, shapes)
    found = np.asarray(np.isfinite(centres).all(axis=(1, 2)))[:, None, None]
    return np.where(found, coordinates(arm, centres, directed=True), shapes)


def in_line(
    arm: Manipulator, tips: FloatArray, shapes: FloatArray, joint: int, way: int
) -> FloatArray:
    """Arms with one joint straight.

    Args:
        arm: The arm.
        tips: Where they stay, shape (n, 3); [m].
        shapes: Their shape coordinates.
        joint: The joint, counted from 0.
        way: 0 puts it in line between the bent joints before and after it. With 1 the
            piece before it goes on to the next bent joint, which moves; with -1 the
            piece after it goes back to the one before. Where that is an end of the arm,
            or the joint is straight, nothing changes.
    """
    if not is_directed(shapes):
        return lined_up(shapes, arm.stations, joint, way)
    for one in (way, 0, 0):
        lined = lined_up_directions(shapes, arm.link_lengths, joint, one)
        shapes = settled(arm, tips, lined)
    return shapes


def turned_towards(
    shapes: FloatArray, aims: FloatArray, turned: BoolArray, rng: np.random.Generator
) -> FloatArray:
    """Directions of links with the last ones turned so that the last looks somewhere.

    Each of them turns a part of the way, the more the nearer it is to the tip.

    Args:
        shapes: Directions, shape (n, N, 3); [-].
        aims: Where to, of any length, shape (n, 3).
        turned: Which arms, shape (n,).
        rng: Source of chance.
    """
    n, count = shapes.shape[:2]
    sharing = rng.integers(1, count + 1, n)
    spread = rng.normal(size=(n, 3)) * rng.choice(np.array(TURNS), n)[:, None]
    goal = aims / np.linalg.norm(aims, axis=1, keepdims=True) + spread
    back = np.arange(count)[::-1]
    part = np.maximum(0.0, 1.0 - back / sharing[:, None]) * turned[:, None]
    mixed = (1.0 - part[..., None]) * shapes + part[..., None] * goal[:, None]
    return np.asarray(mixed / np.linalg.norm(mixed, axis=2, keepdims=True))
