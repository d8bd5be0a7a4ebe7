"""Where obstacles that move stand, for pictures of them."""

from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.scene import Moving, Obstacle
from vdsm_pin.report.charts import packed
from vdsm_pin.verification.protocols import AnyMotion

_TURN: Final = np.deg2rad(5.0)
"""Between two poses that a page is told nothing turns farther; [rad]."""
_MOST: Final = 4_000
"""Poses that a page is told of an obstacle, besides one a knot."""


def start_pose(obstacle: Obstacle, trajectory: AnyMotion) -> FloatArray:
    """T_base_obstacle as the motion begins, shape (4, 4); [m].

    At its first knot where the motion has no times.
    """
    if not isinstance(obstacle, Moving):
        return np.eye(4)
    times = trajectory.times
    begin = obstacle.carrier.path.own_times if times is None else times
    return np.asarray(obstacle.poses(begin[:1])[0])


def moves(obstacle: Obstacle, trajectory: AnyMotion) -> dict[str, Any]:
    """How a page moves what it draws: nothing of what rests.

    Poses at moments in waypoints, near enough to each other that going straight and
    turning evenly from one to the next is as good as the motion.
    """
    if not isinstance(obstacle, Moving):
        return {}
    moments = told_moments(obstacle, trajectory)
    times = trajectory.times_at(moments)
    if times is None:
        times = obstacle.carrier.path.own_times[:1]
    poses = obstacle.poses(times)
    turns = np.array([quaternion(pose[:3, :3]) for pose in poses])
    return {
        "moves": {
            "moments": packed(moments, "<f8"),
            "places": packed(poses[:, :3, 3]),
            "turns": packed(turns),
        }
    }


def told_moments(obstacle: Moving, trajectory: AnyMotion) -> FloatArray:
    """When to tell where it stands, in waypoints, rising."""
    times, path = trajectory.times, obstacle.carrier.path
    if times is None or len(times) == 1:
        return np.zeros(1)
    inside = path.own_times[(path.own_times > times[0]) & (path.own_times < times[-1])]
    knots = np.unique(np.concatenate([times[:1], inside, times[-1:]]))
    steps = np.abs(np.diff(path.at(knots), axis=0)).max(axis=1, initial=0.0)
    parts = np.ceil(steps / _TURN).clip(1, max(1, _MOST // len(steps))).astype(int)
    if path.degree > 1:
        parts = np.maximum(parts, 8)
    whole = subdivided(knots, parts)
    return np.asarray(np.interp(whole, times, np.arange(float(len(times)))))


def subdivided(knots: FloatArray, parts: IntArray) -> FloatArray:
    """Rising knots, shape (n,), and what cuts each gap into so many equal parts."""
    pairs = zip(knots[:-1], knots[1:], parts, strict=True)
    told = [np.linspace(a, b, n, endpoint=False) for a, b, n in pairs]
    return np.concatenate([*told, knots[-1:]])


def quaternion(turn: FloatArray) -> FloatArray:
    """A rotation as (x, y, z, w), of either sign; [-]."""
    trace = float(np.trace(turn))
    k = int(np.argmax([*np.diag(turn), trace]))
    found = np.zeros(4)
    if k == 3:
        found[:3] = (
            turn[2, 1] - turn[1, 2],
            turn[0, 2] - turn[2, 0],
            turn[1, 0] - turn[0, 1],
        )
        found[3] = 1.0 + trace
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        found[k] = 1.0 + 2.0 * turn[k, k] - trace
        found[i], found[j] = turn[i, k] + turn[k, i], turn[j, k] + turn[k, j]
        found[3] = turn[j, i] - turn[i, j]
    return np.asarray(found / np.linalg.norm(found))
