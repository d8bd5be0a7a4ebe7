"""When a planned motion is where: the fastest passage within limits of rate and turn.

The rows are the path; its speed is limited by the rates of tip, base and joints and by
the acceleration of the joints, at corners of the path and along it (a forward and a
backward pass over the speed, as in time-optimal path parametrisation; Bobrow, Dubowsky
and Gibson 1985).
"""

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.simulation.settings import Speed

LEAST_STEP = 1e-12
"""A row that moves less takes no time of its own."""


def row_times(
    manipulator: Manipulator, trajectory: Trajectory, speed: Speed
) -> FloatArray:
    """When each row is passed.

    Args:
        manipulator: The arm.
        trajectory: The rows.
        speed: The limits.

    Returns:
        Shape (n_samples,), from 0, not decreasing; [s].
    """
    angles = trajectory.joints[:, 1:]
    turn, move = (
        np.abs(np.diff(angles, axis=0)).max(axis=1),
        _moves(manipulator, trajectory),
    )
    rate, turning = np.deg2rad(speed.joint_deg_s), np.deg2rad(speed.joint_deg_s2)
    fastest = np.minimum(
        rate / np.maximum(turn, LEAST_STEP),
        speed.tip_m_s / np.maximum(move, LEAST_STEP),
    )
    bend = np.abs(np.diff(angles, n=2, axis=0)).max(axis=1, initial=0.0)
    corner = np.sqrt(turning / np.maximum(bend, LEAST_STEP))
    squared = np.zeros(trajectory.n_samples)
    squared[1:-1] = np.minimum(np.minimum(fastest[1:], fastest[:-1]), corner) ** 2
    gain = 2.0 * turning / np.maximum(turn, LEAST_STEP)
    for k in range(len(gain)):
        squared[k + 1] = min(squared[k + 1], squared[k] + gain[k])
    for k in reversed(range(len(gain))):
        squared[k] = min(squared[k], squared[k + 1] + gain[k])
    rates = np.sqrt(squared)
    mean = 0.5 * (rates[1:] + rates[:-1])
    # A single interval starts and ends at rest: it takes what its acceleration asks.
    alone = np.sqrt(4.0 * np.maximum(turn, LEAST_STEP) / turning)
    spent = np.where(mean > 0.0, 1.0 / np.maximum(mean, LEAST_STEP), alone)
    still = (turn < LEAST_STEP) & (move < LEAST_STEP)
    least = np.maximum(move / speed.tip_m_s, turn / rate)
    steps = np.where(still, 0.0, np.maximum(spent, least))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _moves(manipulator: Manipulator, trajectory: Trajectory) -> FloatArray:
    """How far the tip or the base moves between rows, shape (n_samples - 1,); [m]."""
    rows = trajectory.x0, trajectory.alpha, trajectory.theta
    tips = joint_centres(manipulator, *rows)[:, -1]
    ways = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    return np.asarray(np.maximum(ways, np.abs(np.diff(trajectory.x0))))
