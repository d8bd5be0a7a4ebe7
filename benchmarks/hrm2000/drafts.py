"""A problem in the making, and the ways in and paths that drafts begin with."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from benchmarks.hrm2000.curves import Bend, TipCurve, tightest_radius, tip_curve
from benchmarks.hrm2000.motions import (
    Witness,
    drawing,
    drawn_by_feeding,
    insertion,
    joined,
    swing,
)
from benchmarks.hrm2000.sweeps import Rng, scale
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.scene import Obstacle

Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Draft:
    """A problem in the making.

    Args:
        witness: The motion that solves it; of an infeasible one, the motion that
            solves its feasible twin.
        obstacles: What is in the way.
        note: A few words for its name.
        feasible: Whether it has a solution.
    """

    witness: Witness
    obstacles: tuple[Obstacle, ...]
    note: str = ""
    feasible: bool = True


def random_curve(
    rng: Rng, arm: Manipulator, count: int, turn_deg: Range, straight: Range
) -> TipCurve:
    """A curve of bends in planes at random, gentle enough for the arm.

    Args:
        rng: Randomness.
        arm: Who shall follow it.
        count: How many bends.
        turn_deg: By how much each turns; [deg].
        straight: Length of the lines before each; lengths of the arm.
    """
    bends, around = [], rng.uniform(0.0, 2.0 * np.pi)
    for _ in range(count):
        radius = tightest_radius(arm) * rng.uniform(1.1, 1.5)
        before = arm.total_length * rng.uniform(*straight)
        bends.append(Bend(before, np.deg2rad(rng.uniform(*turn_deg)), radius, around))
        around += rng.uniform(0.5, 1.5) * np.pi
    return tip_curve(bends)


def ring(rng: Rng, first: FloatArray, normal: FloatArray, radius: float) -> FloatArray:
    """A closed path, a polygon or a circle, from a point and across a direction."""
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    other = np.cross(normal, across)
    if rng.random() < 0.5:
        turn = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
        radii = np.full(32, radius)
    else:
        count = int(rng.integers(3, 7))
        shift = rng.uniform(-0.25, 0.25, count)
        turn = 2.0 * np.pi * (np.arange(count) + shift) / count
        radii = radius * rng.uniform(0.6, 1.3, count)
    turn = turn + rng.uniform(0.0, 2.0 * np.pi)
    flat = (radii * np.stack([np.cos(turn), np.sin(turn)])).T
    return np.asarray(first + (flat - flat[0]) @ np.stack([across, other]))


def fed_and_drawn(
    rng: Rng, arm: Manipulator, curve: TipCurve, end: float, size: Range
) -> Witness:
    """In along the curve, then a closed path by the last links or by all of them.

    Args:
        rng: Randomness.
        arm: The arm.
        curve: The way in.
        end: Arc length at which the tip comes to the path; lengths of the arm.
        size: Radius of the path; lengths of the arm.

    Raises:
        DraftRejected: If the arm cannot.
    """
    length = arm.total_length
    before = insertion(arm, curve, -rng.uniform(0.06, 0.15) * length, end * length)
    at_end = np.array([end * length])
    tip, tangent = curve.at(at_end)[0], curve.frames(at_end)[0][:, 0]
    normal = tangent if rng.random() < 0.5 else np.array([1.0, 0.0, 0.0])
    points = ring(rng, tip, normal, length * rng.uniform(*size))
    share = rng.uniform(0.25, 0.45) if rng.random() < 0.6 else 1.0
    tail = np.cumsum(arm.link_lengths[::-1])
    free = min(arm.n_links, max(2, int(np.searchsorted(tail, share * length)) + 1))
    drawn = drawing(
        arm, before.joints[-1], DesiredPath(points[0], points, closed=True), free
    )
    return Witness(arm, joined(before, drawn), points, closed=True)


def fed(
    rng: Rng, arm: Manipulator, curve: TipCurve, end: float, drawn: Range
) -> Witness:
    """In along the curve; its last part is the path.

    Args:
        rng: Randomness.
        arm: The arm.
        curve: The way in and the path.
        end: Arc length at which the tip ends; [m].
        drawn: Length of the path; lengths of the arm.

    Raises:
        DraftRejected: If the arm cannot.
    """
    length = arm.total_length
    first = end - rng.uniform(*drawn) * length
    start = -rng.uniform(0.06, 0.12) * length
    return drawn_by_feeding(arm, curve, (start, first, end), 0.0099 * scale(arm))


def swung_and_drawn(rng: Rng, arm: Manipulator, size: Range) -> Witness:
    """From straight to a posture by chance, then a closed path by the whole arm.

    Args:
        rng: Randomness.
        arm: The arm.
        size: Radius of the path; lengths of the arm.

    Raises:
        DraftRejected: If the arm cannot.
    """
    joints = np.zeros(1 + 2 * arm.n_links)
    spread = 0.35 * arm.max_link_angle * np.sqrt(8.0 / arm.n_links)
    joints[1:] = np.clip(rng.normal(0.0, spread, 2 * arm.n_links), -2 * spread, None)
    joints[0] = rng.uniform(-0.03, 0.03) * arm.total_length
    before = swing(arm, joints)
    tip = Witness(arm, before, np.zeros((1, 3)), closed=False).centres[-1, -1]
    points = ring(
        rng, tip, np.array([1.0, 0.0, 0.0]), arm.total_length * rng.uniform(*size)
    )
    drawn = drawing(
        arm, joints, DesiredPath(points[0], points, closed=True), arm.n_links
    )
    return Witness(arm, joined(before, drawn), points, closed=True)
