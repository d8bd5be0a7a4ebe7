"""A certified motion of a snake arm near one that is not.

Rows that draw the path are pushed only so that the tip stays where it is: slopes are
projected on the null space of the tip's Jacobian, and the tip is led back by damped
least squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.repair.rounds import APART, Origins, Places, Repaired, repaired
from vdsm_pin.repair.slopes import Slopes, joint_scale
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.drawing import runs, wrapped
from vdsm_pin.verification.moving import whole_rows
from vdsm_pin.verification.records import ArmVerification
from vdsm_pin.verification.robot_model import load_robot
from vdsm_pin.verification.tip import second_derivatives
from vdsm_pin.verification.verify import verify

FIRST: Final = 1.0 / 64.0
"""Room beyond the required clearance that a pair gets first, in body radii; [-]."""

WIDEST: Final = 0.5
"""The most; [-]."""

CHORD: Final = 0.25
"""Part of the path's spacing that a tip may leave the chord of its rows; [-]."""


@dataclass(frozen=True)
class _Motion:
    """A motion on its way to be certified.

    Args:
        slopes: Of the problem's clearances.
        rows: Its rows.
        origins: Where they were.
    """

    slopes: Slopes
    rows: Trajectory
    origins: Origins

    @property
    def q(self) -> FloatArray:
        """Its joint values, shape (n_rows, 1 + 2N)."""
        return self.rows.joints

    def pushed(self, margins: dict[int, float], moments: FloatArray) -> "_Motion":
        """The motion sampled closely, its pairs pushed apart by margins; [m]."""
        slopes, problem = self.slopes, self.slopes.problem
        places = Places.within(_parts(problem, self.rows), moments)
        rows, origins = _sampled(problem, self.rows, places), self.origins.at(places)
        whole = whole_rows(problem, rows, np.arange(float(rows.n_samples)))
        tips, added = _tips(problem, rows), origins.given < 0
        whole[added] = slopes.led_back(whole[added], tips[added])
        room, _ = slopes.room(whole, margins)
        names = [slopes.names[k] for k in margins]
        bad = origins.too_near(room, np.array([*margins.values()]), names)
        whole[bad] = slopes.up(whole[bad], tips[bad], margins)
        kept = origins.kept(rows.joints, bad)
        moved = Trajectory.of_joints(
            whole[kept, : rows.joints.shape[1]],
            rows.on_path[kept],
            rows.path_m[kept],
            None if rows.times is None else rows.times[kept],
        )
        return _Motion(slopes, moved, origins.only(kept))


def repair_arm(
    problem: PlanningProblem,
    trajectory: Trajectory,
    pinned: Sequence[int] = (),
    deadline: Deadline = NO_LIMIT,
) -> Repaired[ArmVerification]:
    """A certified motion near a given one.

    The first row stays, the last one where it does not draw a path, and those that are
    pinned. The tip stays on its path.

    Args:
        problem: Arm, scene, desired path.
        trajectory: Straight lines between waypoints.
        pinned: Numbers of waypoints, from 0, that stay.
        deadline: When to give up.

    Raises:
        InvalidInput: If the motion is not of straight lines or has no such waypoint.
        Infeasible: If none was found; the message says why and where.
        OutOfTime: If none was found in time.
    """
    if trajectory.is_smooth:
        message = "repair takes straight lines between waypoints, without velocities"
        raise InvalidInput(message)
    draws = problem.tip_path is not None and bool(trajectory.on_path[-1])
    ends = [0] if draws else [0, trajectory.n_samples - 1]
    origins = Origins.of(trajectory.joints, ends, pinned)
    robot, radius = load_robot(problem.manipulator), problem.manipulator.least_radius
    return repaired(
        _Motion(Slopes(problem), trajectory, origins),
        lambda motion: verify(problem, motion.rows, robot, deadline=deadline),
        (FIRST * radius, WIDEST * radius),
        deadline,
        under_errors=problem.errors != ErrorBox(),
    )


def _parts(problem: PlanningProblem, rows: Trajectory) -> IntArray:
    """Into how many parts to sample each interval, shape (n_rows - 1,)."""
    steps = np.abs(np.diff(rows.joints, axis=0) * joint_scale(problem.manipulator))
    parts = np.maximum(1.0, np.ceil(steps.max(axis=1, initial=0.0) / APART))
    if problem.tip_path is not None:
        off_chord = second_derivatives(problem.manipulator, rows) / 8.0
        fine = np.ceil(np.sqrt(off_chord / (CHORD * problem.path.spacing)))
        parts = np.where(rows.on_path[:-1], np.maximum(parts, fine), parts)
    return np.asarray(parts, np.int64)


def _sampled(problem: PlanningProblem, rows: Trajectory, places: Places) -> Trajectory:
    """The same motion with rows at some places; the tip runs evenly between rows.

    A row in between draws the path where both its neighbours do.
    """
    k, on = places.row, rows.on_path
    path_m = rows.path_m[k]
    on_path = on[k] & (places.old | on[np.minimum(k + 1, len(on) - 1)])
    between = on_path & ~places.old
    if problem.tip_path is not None and between.any():
        run, begin = runs(problem.path, rows.path_m), wrapped(problem.path, path_m)
        share = (places.moments - k)[between]
        path_m[between] = begin[between] + share * run[k[between]]
    times = None if rows.times is None else places.through(rows.times)
    return Trajectory.of_joints(places.through(rows.joints), on_path, path_m, times)


def _tips(problem: PlanningProblem, motion: Trajectory) -> FloatArray:
    """Where the tip has to be, NaN where anywhere will do, shape (n_rows, 3); [m]."""
    tips = np.full((motion.n_samples, 3), np.nan)
    if problem.tip_path is not None:
        on, path = motion.on_path, problem.path
        tips[on] = path.at(wrapped(path, motion.path_m[on]))
    return tips
