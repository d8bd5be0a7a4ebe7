"""What the arm does over a motion."""

from functools import partial
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.rows import MotionFacts
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.drawing import runs
from vdsm_pin.verification.extremes import Measure, extremes

_CHUNK: Final = 65_536  # rows treated at once, so that memory stays bounded


def changed_angles(psi: FloatArray) -> IntArray:
    """How many link angles differ from zero by more than 0.05 deg, (n_samples,).

    Args:
        psi: Link angles, shape (n_samples, N); [rad].
    """
    return np.asarray((psi > TOLERANCES.changed_angle).sum(axis=1))


def motion_facts(problem: PlanningProblem, trajectory: Trajectory) -> MotionFacts:
    """Extremes over a motion; changed link angles at its rows."""
    bends = [partial(_link_angle, joint) for joint in range(trajectory.n_links)]
    ends: list[Measure] = [lambda q: -q[:, :1], lambda q: q[:, :1]]
    below, above, *largest = extremes(trajectory.path, [*ends, *bends])
    changed = np.zeros(trajectory.n_samples, dtype=np.int64)
    for first in range(0, trajectory.n_samples, _CHUNK):
        part = slice(first, first + _CHUNK)
        psi = link_angles(trajectory.alpha[part], trajectory.theta[part])
        changed[part] = changed_angles(psi)
    on_path = changed[trajectory.on_path & (problem.tip_path is not None)]
    mean = _mean_by_way(changed, problem, trajectory) if on_path.size else None
    return MotionFacts(
        waypoints=trajectory.n_samples,
        on_path_waypoints=None if problem.tip_path is None else int(on_path.size),
        max_link_angle_rad=tuple(largest),
        x0_min_m=-below,
        x0_max_m=above,
        changed_angle_threshold_rad=TOLERANCES.changed_angle,
        changed_angles_mean_on_path=mean,
        changed_angles_max=int(changed.max()),
    )


def _link_angle(joint: int, q: FloatArray) -> FloatArray:
    """That of a joint, from 0, in rows of joint values, shape (m, 1); [rad]."""
    alpha, theta = 2 * joint + 1, 2 * joint + 2
    return link_angles(q[:, alpha : alpha + 1], q[:, theta : theta + 1])


def _mean_by_way(
    values: IntArray, problem: PlanningProblem, trajectory: Trajectory
) -> float:
    """Mean over the length of the drawn path, whatever the distance of the rows.

    Between two rows half the way counts for each; where nothing is drawn between rows
    all count alike.
    """
    on = trajectory.on_path
    ways = np.abs(runs(problem.path, trajectory.path_m)) * (on[1:] & on[:-1])
    if not ways.any():
        return float(values[on].mean())
    return float(ways @ (values[1:] + values[:-1]) / (2.0 * ways.sum()))
