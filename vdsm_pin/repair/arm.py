"""A certified motion of a snake arm near one that is not.

Rows that draw the path are pushed only so that the tip stays where it is: slopes are
projected on the null space of the tip's Jacobian, and the tip is led back by damped
least squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import row_centres
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.repair.causes import Place
from vdsm_pin.repair.rounds import Origins, Places, Repaired, parts_of, repaired
from vdsm_pin.repair.slopes import Slopes, joint_scale
from vdsm_pin.repair.smooth import bulged, on_curve, sampled
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.drawing import runs, wrapped
from vdsm_pin.verification.moving import whole_rows
from vdsm_pin.verification.records import ArmVerification
from vdsm_pin.verification.tip import second_derivatives
from vdsm_pin.verification.verify import verify

FIRST: Final = 1.0 / 64.0
"""Room beyond the required clearance that a pair gets first, in body radii; [-]."""

WIDEST: Final = 0.5
"""The most; [-]."""

CHORD: Final = 0.25
"""Part of the path's spacing that a tip may leave the chord of its rows; [-]."""

NEARER: Final = 4
"""Steps along the path to where it is nearest to a tip."""

TANGENT: Final = 1e-6
"""Half of the chord that stands for the path's tangent; [m]."""


@dataclass(frozen=True)
class _Motion:
    """A motion on its way to be certified.

    Args:
        slopes: Of the problem's clearances.
        rows: Its rows.
        origins: Where they were.
        given: The motion that is repaired.
        moments: Where its rows were there, in waypoints, shape (n_rows,).
    """

    slopes: Slopes
    rows: Trajectory
    origins: Origins
    given: Trajectory
    moments: FloatArray

    def pushed(self, margins: dict[int, float], moments: FloatArray) -> "_Motion":
        """The motion sampled closely, its pairs pushed apart by margins; [m]."""
        slopes, problem = self.slopes, self.slopes.problem
        parts, times = _parts(problem, self.rows), self.rows.times
        places = Places.within(parts, moments, times)
        if self.rows.is_smooth:
            return self._bulged(places, margins)
        rows, origins = _sampled(problem, self.rows, places), self.origins.at(places)
        whole = whole_rows(problem, rows, np.arange(float(rows.n_samples)))
        tips, added = _tips(problem, rows), origins.given < 0
        whole[added] = slopes.led_back(whole[added], tips[added])
        room, _ = slopes.room(whole, margins)
        bad = origins.too_near(room, *slopes.asked(margins))
        whole[bad] = slopes.up(whole[bad], tips[bad], margins)
        kept = origins.kept(rows.joints, bad)
        moved = Trajectory.of_joints(
            whole[kept, : rows.joints.shape[1]],
            on_path=rows.on_path[kept],
            path_m=rows.path_m[kept],
            times=None if rows.times is None else rows.times[kept],
        )
        at = places.through(self.moments)[kept]
        return replace(self, rows=moved, origins=origins.only(kept), moments=at)

    def _bulged(self, places: Places, margins: dict[int, float]) -> "_Motion":
        """The same of smooth pieces; tips that draw are led back to the path."""
        slopes, problem, at = self.slopes, self.slopes.problem, self.moments
        at, width = places.through(at), self.rows.joints.shape[1]
        origins, rows = on_curve(
            self.given.named,
            at,
            self.origins.at(places),
            sampled(self.rows.named, places),
        )
        assert rows.times is not None
        spots = _spots(problem, self.rows, places, rows.q)
        carried = (one.path.at(rows.times) for one in problem.scene.carriers)
        more, tips = np.hstack([rows.q[:, :0], *carried]), _tips(problem, spots)

        def room(q: FloatArray) -> FloatArray:
            return slopes.room(np.hstack([q, more]), margins)[0]

        def up(k: int, q: FloatArray) -> FloatArray:
            whole = np.hstack([q, more[k]])[None]
            return slopes.up(whole, tips[k : k + 1], margins)[0, :width]

        origins.too_near(room(rows.q), *slopes.asked(margins))
        rows, moved = bulged(rows, lambda q: room(q).min(axis=1), up, origins.fixed)
        rows = _led_back(slopes, rows, moved & ~origins.fixed, tips)
        kept = places.old | moved  # in between the curve is what it was
        rows, origins = rows.only(kept), origins.only(kept)
        found = Trajectory.of_joints(
            rows.q,
            on_path=spots.on_path[kept],
            path_m=spots.path_m[kept],
            times=rows.times,
            rates=rows.rates,
            changes=rows.changes,
        )
        return replace(self, rows=found, origins=origins, moments=at[kept])

    def at(self, moment: float, margins: dict[int, float]) -> Place:
        """What pairs have of their margins at a moment in waypoints, and why; [m]."""
        row = whole_rows(self.slopes.problem, self.rows, np.array([moment]))
        k, on = int(moment), self.rows.on_path
        drawing = bool(on[k] & on[min(k + (moment > k), len(on) - 1)])
        return self.slopes.at(row, margins, drawing)


def repair_arm(
    problem: PlanningProblem,
    trajectory: Trajectory,
    pinned: Sequence[int] = (),
    deadline: Deadline = NO_LIMIT,
) -> Repaired[Trajectory, ArmVerification]:
    """A certified motion near a given one.

    The first row stays, the last one where it does not draw a path or pieces are
    smooth, and those that are pinned. The tip stays on its path; smooth pieces stay
    smooth, and rows keep their times.

    Args:
        problem: Arm, scene, desired path.
        trajectory: Straight lines between waypoints, or smooth pieces.
        pinned: Numbers of waypoints, from 0, that stay.
        deadline: When to give up.

    Raises:
        InvalidInput: If the motion has no such waypoint.
        Infeasible: If none was found; the message says why and where.
        OutOfTime: If none was found in time.
    """
    draws = problem.tip_path is not None and bool(trajectory.on_path[-1])
    draws &= not trajectory.is_smooth
    ends = [0] if draws else [0, trajectory.n_samples - 1]
    origins = Origins.of(trajectory.joints, ends, pinned)
    radius = problem.manipulator.least_radius
    return repaired(
        _Motion(
            *(Slopes(problem), trajectory, origins, trajectory),
            np.arange(float(trajectory.n_samples)),
        ),
        lambda motion: verify(problem, motion.rows, deadline=deadline),
        (FIRST * radius, WIDEST * radius),
        deadline,
        under_errors=problem.errors != ErrorBox(),
    )


def _parts(problem: PlanningProblem, rows: Trajectory) -> IntArray:
    """Into how many parts to sample each interval, shape (n_rows - 1,)."""
    parts = parts_of(rows, joint_scale(problem.manipulator))
    if problem.tip_path is not None:
        off_chord = second_derivatives(problem.manipulator, rows) / 8.0
        fine = np.ceil(np.sqrt(off_chord / (CHORD * problem.path.spacing)))
        fine = np.maximum(parts, fine).astype(np.int64)
        parts = np.where(rows.on_path[:-1], fine, parts)
    return parts


def _spots(
    problem: PlanningProblem, rows: Trajectory, places: Places, q: FloatArray
) -> Trajectory:
    """Samples of a smooth motion, drawing where the tip is nearest to the path.

    Args:
        problem: Arm and desired path.
        rows: The motion.
        places: Of the samples.
        q: Their joint values, shape (m, 1 + 2N).
    """
    even = _sampled(problem, rows, places)
    if problem.tip_path is None or not (between := even.on_path & ~places.old).any():
        return Trajectory.of_joints(q, even.on_path, even.path_m, even.times)
    path, path_m = problem.path, even.path_m.copy()
    tips = row_centres(problem.manipulator, q)[:, -1]
    k, run = places.row[between], runs(path, rows.path_m)[places.row[between]]
    begin, s = wrapped(path, rows.path_m)[k], path_m[between]
    low, high = np.minimum(begin, begin + run), np.maximum(begin, begin + run)
    for _ in range(NEARER):
        ends = [path.at(wrapped(path, s + side)) for side in (-TANGENT, TANGENT)]
        along = (ends[1] - ends[0]) / (2.0 * TANGENT)
        s = s + ((tips[between] - 0.5 * (ends[0] + ends[1])) * along).sum(axis=1)
        s = np.clip(s, low, high)
    path_m[between] = s
    return Trajectory.of_joints(q, even.on_path, path_m, even.times)


def _led_back(
    slopes: Slopes, rows: JointTrajectory, moved: BoolArray, tips: FloatArray
) -> JointTrajectory:
    """Moved rows with their tips where they have to be; rates follow."""
    drawing = moved & np.isfinite(tips[:, 0])
    if rows.times is None or rows.rates is None or not drawing.any():
        return rows
    back = np.zeros_like(rows.q)
    back[drawing] = slopes.led_back(rows.q[drawing], tips[drawing]) - rows.q[drawing]
    faster = np.where(moved[:, None], np.gradient(back, rows.times, axis=0), 0.0)
    changes = rows.changes
    if changes is not None:
        bent = np.gradient(faster, rows.times, axis=0)
        changes = changes + np.where(moved[:, None], bent, 0.0)
    q, rates = rows.q + back, rows.rates + faster
    return replace(rows, q=q, rates=rates, changes=changes)


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
