"""What the arm does, measured at the waypoints."""

from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.rows import MotionFacts
from vdsm_pin.tolerances import TOLERANCES

_CHUNK: Final = 65_536  # rows treated at once, so that memory stays bounded


def changed_angles(psi: FloatArray) -> IntArray:
    """How many link angles differ from zero by more than 0.05 deg, (n_samples,).

    Args:
        psi: Link angles, shape (n_samples, N); [rad].
    """
    return np.asarray((psi > TOLERANCES.changed_angle).sum(axis=1))


def motion_facts(problem: PlanningProblem, trajectory: Trajectory) -> MotionFacts:
    """Extremes over the rows of a trajectory."""
    largest = np.zeros(trajectory.n_links)
    changed = np.zeros(trajectory.n_samples, dtype=np.int64)
    for first in range(0, trajectory.n_samples, _CHUNK):
        part = slice(first, first + _CHUNK)
        psi = link_angles(trajectory.alpha[part], trajectory.theta[part])
        largest = np.maximum(largest, psi.max(axis=0))
        changed[part] = changed_angles(psi)
    on_path = changed[trajectory.on_path & (problem.tip_path is not None)]
    mean = _mean_by_way(changed, trajectory) if on_path.size else None
    return MotionFacts(
        waypoints=trajectory.n_samples,
        on_path_waypoints=None if problem.tip_path is None else int(on_path.size),
        max_link_angle_rad=tuple(float(value) for value in largest),
        x0_min_m=float(trajectory.x0.min()),
        x0_max_m=float(trajectory.x0.max()),
        changed_angle_threshold_rad=TOLERANCES.changed_angle,
        changed_angles_mean_on_path=mean,
        changed_angles_max=int(changed.max()),
    )


def _mean_by_way(values: IntArray, trajectory: Trajectory) -> float:
    """Mean over the length of the drawn path, whatever the distance of the rows.

    Between two rows half the way counts for each; where nothing is drawn between rows
    all count alike.
    """
    on, along = trajectory.on_path, trajectory.path_m
    ways = np.abs(np.diff(along)) * (on[1:] & on[:-1])
    # A closed path goes on from its length to 0.
    ways[ways > np.ptp(along) / 2.0] = 0.0
    if not ways.any():
        return float(values[on].mean())
    return float(ways @ (values[1:] + values[:-1]) / (2.0 * ways.sum()))
