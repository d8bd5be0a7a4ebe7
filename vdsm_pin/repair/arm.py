"""A certified motion of a snake arm near one that is not.

Where the proof finds bodies too near, rows of the motion are pushed up the slopes of
the clearance; of rows that draw the path only so that the tip stays where it is (the
slopes projected on the null space of the tip's Jacobian, the tip then led back by
damped least squares). The pushed rows become waypoints, and all checks judge the whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible, InvalidInput
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.repair.slopes import Slopes, joint_scale
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.drawing import runs, wrapped
from vdsm_pin.verification.moving import whole_rows
from vdsm_pin.verification.records import ArmVerification, Verdict
from vdsm_pin.verification.robot_model import load_robot
from vdsm_pin.verification.tip import second_derivatives
from vdsm_pin.verification.verify import verify

FIRST: Final = 1.0 / 64.0
"""Room beyond the required clearance that a pair gets first, in body radii; [-]."""

WIDEST: Final = 0.5
"""The most, after it was doubled whenever the pair was still too near; [-]."""

ROUNDS: Final = 14
"""Of pushing and judging."""

APART: Final = float(np.radians(1.0))
"""How far rows lie apart in the joint that moves most, near what is pushed; [rad]; of
x0 in arm lengths."""

CHORD: Final = 0.25
"""Part of the path's spacing that a tip may leave the chord of its rows; [-]."""

MOST: Final = 300
"""New rows that a round may push: more are pushed to different sides and lead apart."""


@dataclass(frozen=True)
class RepairedArm:
    """A motion that is certified, and how far it is from the one that was given.

    Args:
        verification: Of the motion.
        given: Number of the given waypoint that each waypoint was, -1 for a new one,
            shape (n_rows,).
        moved: How far each waypoint lies off its place in the given motion, in the
            joint that differs most, shape (n_rows,); [rad], [m].
    """

    verification: ArmVerification
    given: IntArray
    moved: FloatArray


@dataclass(frozen=True)
class _Rows:
    """A motion on its way to be certified.

    Args:
        motion: Its rows.
        base: Joint values of the same rows in the given motion.
        given: As in `RepairedArm`.
        fixed: Which rows stay, shape (n_rows,).
    """

    motion: Trajectory
    base: FloatArray
    given: IntArray
    fixed: BoolArray


def repair_arm(
    problem: PlanningProblem,
    trajectory: Trajectory,
    pinned: Sequence[int] = (),
    deadline: Deadline = NO_LIMIT,
) -> RepairedArm:
    """A certified motion near a given one.

    The first row stays, the last one where the problem has a goal or the tip is not on
    the path, and those that are pinned. The tip stays on its path.

    Args:
        problem: Arm, scene, desired path.
        trajectory: Straight lines between waypoints.
        pinned: Numbers of waypoints, from 0, that stay.
        deadline: When to give up.

    Raises:
        InvalidInput: If the motion is not of straight lines or has no such waypoint.
        Infeasible: If none was found; the message says why and where.
    """
    rows = _first_rows(problem, trajectory, pinned)
    robot, slopes = load_robot(problem.manipulator), Slopes(problem)
    radius = problem.manipulator.least_radius
    found = verify(problem, trajectory, robot, deadline=deadline)
    near: dict[int, float] = {}
    for _ in range(ROUNDS):
        assert found.least is not None
        bad = np.flatnonzero(found.least.verdict != CERTIFIED).tolist()
        if found.verdict is Verdict.CERTIFIED or deadline.passed:
            break
        if (not near and not bad) or any(near.get(k) == WIDEST for k in bad):
            break
        near |= {k: min(2.0 * near.get(k, 0.5 * FIRST), WIDEST) for k in bad}
        moments = found.least.interval[bad] + found.least.time[bad]
        margins = {k: share * radius for k, share in near.items()}
        rows = _pushed(problem, slopes, _sampled(problem, rows, moments), margins)
        found = verify(problem, rows.motion, robot, deadline=deadline)
    if found.verdict is not Verdict.CERTIFIED:
        raise Infeasible(_why(found))
    moved = np.abs(rows.motion.joints - rows.base).max(axis=1)
    return RepairedArm(found, rows.given, moved)


def _first_rows(
    problem: PlanningProblem, trajectory: Trajectory, pinned: Sequence[int]
) -> _Rows:
    """The given motion.

    Raises:
        InvalidInput: If it is not of straight lines or has no such waypoint.
    """
    n = trajectory.n_samples
    if trajectory.is_smooth:
        message = "repair takes straight lines between waypoints, without velocities"
        raise InvalidInput(message)
    for k in pinned:
        if not 0 <= k < n:
            message = f"pinned waypoint is {k}, expected 0 to {n - 1}"
            raise InvalidInput(message)
    free = problem.tip_path is not None and bool(trajectory.on_path[-1])
    ends = [0] if free else [0, n - 1]
    fixed = np.isin(np.arange(n), [*ends, *pinned])
    return _Rows(trajectory, trajectory.joints, np.arange(n), fixed)


def _sampled(problem: PlanningProblem, rows: _Rows, moments: FloatArray) -> _Rows:
    """The same motion with rows in between, and at some moments."""
    motion, n = rows.motion, rows.motion.n_samples
    scale = joint_scale(problem.manipulator)
    steps = np.abs(np.diff(motion.joints, axis=0) * scale).max(axis=1, initial=0.0)
    parts = np.maximum(1.0, np.ceil(steps / APART))
    if problem.tip_path is not None:
        off_chord = second_derivatives(problem.manipulator, motion) / 8.0
        fine = np.ceil(np.sqrt(off_chord / (CHORD * problem.path.spacing)))
        parts = np.where(motion.on_path[:-1], np.maximum(parts, fine), parts)
    counts = parts.astype(np.int64)
    first = np.cumsum(counts) - counts
    k = np.repeat(np.arange(n - 1), counts)
    share = (np.arange(counts.sum()) - first[k]) / counts[k]
    places = np.unique(
        np.concatenate([k + share, [n - 1.0], np.clip(moments, 0.0, n - 1.0)])
    )
    old = places == np.floor(places)
    before = np.minimum(places.astype(np.int64), max(n - 2, 0))
    after, share = np.minimum(before + 1, n - 1), places - before
    # A row in between draws the path where both its neighbours do.
    row = places.astype(np.int64)
    on = motion.on_path
    on_path = np.where(old, on[row], on[before] & on[after])
    path_m = np.where(
        old | ~on_path, motion.path_m[row], _stations(problem, motion, before, share)
    )
    joints = motion.joints_at(places)
    sampled = Trajectory(
        on_path,
        path_m,
        joints[:, 0],
        joints[:, 1::2],
        joints[:, 2::2],
        times=motion.times_at(places),
    )
    base = rows.base[before] + share[:, None] * (rows.base[after] - rows.base[before])
    base = np.where(old[:, None], rows.base[row], base)
    given = np.where(old, rows.given[row], -1)
    return _Rows(sampled, base, given, np.where(old, rows.fixed[row], False))


def _stations(
    problem: PlanningProblem, motion: Trajectory, before: IntArray, share: FloatArray
) -> FloatArray:
    """Stations of the path between rows, which the tip runs evenly; [m]."""
    if problem.tip_path is None or motion.n_samples == 1:
        return motion.path_m[before]
    run = runs(problem.path, motion.path_m)[before]
    return wrapped(problem.path, motion.path_m)[before] + share * run


def _pushed(
    problem: PlanningProblem, slopes: Slopes, rows: _Rows, margins: dict[int, float]
) -> _Rows:
    """The motion with rows where pairs come too near, pushed apart.

    Args:
        problem: Arm, scene, desired path.
        slopes: Of its clearances.
        rows: Sampled closely.
        margins: Pairs, and the room beyond the required clearance that they get; [m].

    Raises:
        Infeasible: If a waypoint that stays is too near, or the motion leads through.
    """
    motion, tips = rows.motion, _tips(problem, rows.motion)
    whole = whole_rows(problem, motion, np.arange(float(motion.n_samples)))
    added = rows.given < 0
    whole[added] = slopes.led_back(whole[added], tips[added])
    room, _ = slopes.room(whole, margins)
    _refuse_fixed(rows, (room + np.array([*margins.values()])).min(axis=1))
    bad = (room.min(axis=1) < 0.0) & ~rows.fixed
    if (new := int((bad & added).sum())) > MOST:
        message = (
            f"{new} rows between waypoints are too near: small changes do not lead "
            "round; expected a new plan"
        )
        raise Infeasible(message)
    whole[bad] = slopes.up(whole[bad], tips[bad], margins)
    joints = whole[:, : 1 + 2 * motion.n_links]
    beside = bad.copy()
    beside[1:] |= bad[:-1]
    beside[:-1] |= bad[1:]
    kept = ~added | beside | (motion.joints != rows.base).any(axis=1)
    moved = Trajectory(
        motion.on_path[kept],
        motion.path_m[kept],
        joints[kept, 0],
        joints[kept, 1::2],
        joints[kept, 2::2],
        times=None if motion.times is None else motion.times[kept],
    )
    return _Rows(moved, rows.base[kept], rows.given[kept], rows.fixed[kept])


def _refuse_fixed(rows: _Rows, room: FloatArray) -> None:
    """Name a row that stays and has no room; shape (n_rows,); [m].

    Raises:
        Infeasible: If there is one.
    """
    for k in np.flatnonzero(rows.fixed & (room < 0.0)):
        message = (
            f"waypoint {rows.given[k]} stays, and there the arm is "
            f"{-MM_PER_M * room[k]:.3f} mm nearer than required"
        )
        raise Infeasible(message)


def _tips(problem: PlanningProblem, motion: Trajectory) -> FloatArray:
    """Where the tip has to be, NaN where anywhere will do, shape (n_rows, 3); [m]."""
    tips = np.full((motion.n_samples, 3), np.nan)
    if problem.tip_path is not None:
        on, path = motion.on_path, problem.path
        tips[on] = path.at(wrapped(path, motion.path_m[on]))
    return tips


def _why(found: ArmVerification) -> str:
    """What is still wrong and where."""
    check = next(c for c in found.checks if c.verdict is not Verdict.CERTIFIED)
    where = f" ({check.where})" if check.where else ""
    return (
        f"no certified motion was found: {check.name}{where} is {check.verdict.value} "
        f"at waypoint {check.moment:.3f} of the last attempt"
    )
