"""Smooth motions that bulge out where they are too near, and stay smooth."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.geometry.bernstein import value
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.repair.rounds import Origins, Places

BULGES: Final = 100
"""Most bulges of a smooth motion in one round."""

SLOW: Final = 10.0
"""Half the least length of a bulge, over its shift at the motion's own speed; [-]."""

ROUNDED: Final = 1e-12
"""How far a sample of a smooth piece may be off where it was; [rad], [m]."""


def sampled(motion: JointTrajectory, places: Places) -> JointTrajectory:
    """The same motion with waypoints at some places, exact where they are rows."""
    times = None if motion.times is None else places.through(motion.times)
    if not motion.is_smooth:
        return replace(motion, q=places.through(motion.q), times=times)
    row, old = places.row, places.old[:, None]
    k = np.minimum(row, motion.path.n_intervals - 1)
    share = places.moments - k
    q = np.where(old, motion.q[row], value(motion.path.pieces(k), share))
    pairs = zip((motion.rates, motion.changes), motion.between(k, share), strict=True)
    rates, changes = (
        None if given is None or inner is None else np.where(old, given[row], inner)
        for given, inner in pairs
    )
    return replace(motion, q=q, times=times, rates=rates, changes=changes)


def on_curve(
    given: JointTrajectory, moments: FloatArray, origins: Origins, rows: JointTrajectory
) -> tuple[Origins, JointTrajectory]:
    """The origins of samples, and samples that are there to the last bit.

    Args:
        given: The motion that is repaired.
        moments: Of the samples there, in waypoints, shape (n_rows,).
        origins: Of the samples, as of straight lines.
        rows: The samples.
    """
    base = given.path.at_moments(moments)
    q = np.where(np.abs(rows.q - base) <= ROUNDED, base, rows.q)
    return replace(origins, base=base), replace(rows, q=q)


def bulged(
    motion: JointTrajectory,
    room: Callable[[FloatArray], FloatArray],
    up: Callable[[int, FloatArray], FloatArray],
    fixed: BoolArray,
) -> tuple[JointTrajectory, BoolArray]:
    """A smooth motion that bulges out where it is too near, and which rows it moved.

    A bulge is (1 - u^2)^3 of a shift, with u = -1 and 1 at its ends, see `_ends`.

    Args:
        motion: Sampled closely, with times and velocities.
        room: Of all pairs at rows of q, the least of each row, shape (n_rows,); [m].
        up: A row, by its number and its joint values, where it has room.
        fixed: Which rows stay, the first and the last among them, shape (n_rows,).
    """
    times, rates = motion.times, motion.rates
    assert times is not None
    assert rates is not None
    q, changes = motion.q, motion.changes
    moved, fast = np.zeros(len(q), np.bool_), float(np.abs(rates).max()) or np.inf
    for _ in range(BULGES):
        gaps = np.where(fixed, np.inf, room(q))
        k = int(np.argmin(gaps))
        if not -np.inf < gaps[k] < 0.0:
            break
        shift = up(k, q[k]) - q[k]
        if not shift.any():
            break  # nor would the next one be
        slow = SLOW * float(np.abs(shift).max()) / fast
        low, high = _ends(times, k, (gaps >= 0.0, fixed), slow)
        width = np.where(times < times[k], times[k] - low, high - times[k])
        u = np.clip((times - times[k]) / width, -1.0, 1.0)
        rest, moved = 1.0 - u**2, moved | (np.abs(u) < 1.0)
        q = q + (rest**3)[:, None] * shift
        rates = rates + (-6.0 * u * rest**2 / width)[:, None] * shift
        if changes is not None:
            bend = rest * (24.0 * u**2 - 6.0 * rest) / width**2
            changes = changes + bend[:, None] * shift
    return replace(motion, q=q, rates=rates, changes=changes), moved


def _ends(
    times: FloatArray, k: int, rows: tuple[BoolArray, BoolArray], slow: float
) -> tuple[float, float]:
    """When a bulge about row k begins and ends; [s].

    It is twice as long as what is too near there, and at least `slow` to either side,
    unless a fixed row is in its way.

    Args:
        times: Of the rows, shape (n_rows,); [s].
        k: The row.
        rows: Which are clear or fixed, and which are fixed, shape (n_rows,) each.
        slow: Least half of its length; [s].
    """
    clear, fixed = (times[which] for which in rows)
    at = times[k]
    before, after = clear[clear < at].max(), clear[clear > at].min()
    begin, end = fixed[fixed < at].max(), fixed[fixed > at].min()
    low = min(2.0 * before - at, at - slow)
    high = max(2.0 * after - at, at + slow)
    return float(max(low, begin)), float(min(high, end))
