"""A certified motion of a robot near one that is not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.repair.causes import Place, end_limits
from vdsm_pin.repair.rounds import Origins, Places, Repaired, parts_of, repaired
from vdsm_pin.repair.smooth import bulged, on_curve, sampled
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.judgement import RobotVerification, verify_robot
from vdsm_pin.robots.model import RobotJoint
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.moving import check_timed

MARGINS: Final = 1e-3, 8e-3
"""Room beyond the required clearance that a pair gets first, and the most; [m]."""

PUSHES: Final = 25
"""Most steps of one sample up the slopes."""

LONGEST: Final = 0.1
"""Longest such step; [rad], [m]."""

STEP: Final = 1e-6
"""Of the differences that slopes are taken from; [rad], [m]."""


@dataclass(frozen=True)
class _Motion:
    """A motion on its way to be certified.

    Args:
        cell: Robot and scene.
        given: The motion that is repaired.
        pushed_rows: The motion now, its new waypoints at the times where they were put.
        moments: Where its waypoints were in the given motion, shape (n_rows,).
        origins: The same as joint values.
    """

    cell: Cell
    given: JointTrajectory
    pushed_rows: JointTrajectory
    moments: FloatArray
    origins: Origins

    @property
    def rows(self) -> JointTrajectory:
        """The motion now; given waypoints keep their times."""
        rows = self.pushed_rows
        if rows.times is None or rows.rates is not None or self.cell.scene.carriers:
            return rows
        velocities = np.array([joint.velocity for joint in self._joints])
        return replace(rows, times=spread(rows, self.origins.given >= 0, velocities))

    def pushed(self, margins: dict[int, float], moments: FloatArray) -> "_Motion":
        """The motion sampled closely, its pairs pushed apart by margins; [m]."""
        places = Places.within(
            parts_of(self.pushed_rows), moments, self.pushed_rows.times
        )
        origins, at = self.origins.at(places), places.through(self.moments)
        rows = sampled(self.pushed_rows, places)
        if rows.rates is not None:
            origins, rows = on_curve(self.given, at, origins, rows)
        others = self._others(rows.times, rows.n_samples)
        asked, more = self.cell.asked, np.array([*margins.values()])
        slopes = _Slopes(self.cell, np.array([*margins]), more)
        names = [str(asked.pair(k)) for k in margins]
        required = asked.table.required[[*margins]]
        bad = origins.too_near(slopes.gaps(rows.q, others), more, required, names)
        if rows.times is not None and rows.rates is not None:
            rows, bad = bulged(
                rows,
                lambda q: slopes.gaps(q, others).min(axis=1),
                lambda k, q: slopes.up(q, others[k : k + 1]),
                origins.fixed,
            )
            kept = origins.kept(rows.q, bad)
        else:
            kept, q = origins.kept(rows.q, bad), rows.q.copy()
            for k in np.flatnonzero(bad):
                q[k] = slopes.up(q[k], others[k : k + 1])
            rows = replace(rows, q=q)
        rows, origins = rows.only(kept), origins.only(kept)
        return replace(self, pushed_rows=rows, moments=at[kept], origins=origins)

    def at(self, moment: float, margins: dict[int, float]) -> Place:
        """What pairs have of their margins at a moment in waypoints, and why; [m]."""
        (q,) = self.rows.path.at_moments(np.array([moment]))
        times = self.rows.times_at(np.array([moment]))
        others, names = self._others(times, 1), [joint.name for joint in self._joints]
        slopes = _Slopes(self.cell, np.array([*margins]), np.array([*margins.values()]))
        ends = np.array([(joint.lower, joint.upper) for joint in self._joints])
        room = slopes.gaps(q[None], others)[0]
        steep = [slopes.slope(k, q, others, room[k]) for k in range(len(margins))]
        return Place(
            [str(self.cell.asked.pair(k)) for k in margins],
            room,
            np.array(steep),
            end_limits(q, ends, [f"joint {name!r}" for name in names]),
        )

    @property
    def _joints(self) -> tuple[RobotJoint, ...]:
        return self.cell.robot.joints

    def _others(self, times: FloatArray | None, n_rows: int) -> FloatArray:
        """Columns of what moves beside rows, shape (n_rows, n_more)."""
        none = np.zeros((n_rows, 0))
        if times is None:
            return none
        return np.hstack(
            [none, *(one.path.at(times) for one in self.cell.scene.carriers)]
        )


def repair_robot(
    cell: Cell,
    motion: JointTrajectory,
    pinned: Sequence[int] = (),
    deadline: Deadline = NO_LIMIT,
) -> Repaired[JointTrajectory, RobotVerification]:
    """A certified motion near a given one; start, goal and pinned waypoints stay.

    Args:
        cell: Robot, scene and required clearances.
        motion: Its joints; waypoints keep their times, new ones have some between them;
            straight lines stay straight lines and smooth pieces smooth ones.
        pinned: Numbers of waypoints, from 0, that stay besides start and goal.
        deadline: When to give up.

    Raises:
        InvalidInput: If there is no such waypoint, or no times beside what moves.
        Infeasible: If none was found; the message says why and where.
        OutOfTime: If none was found in time.
    """
    check_timed(cell.scene, motion)
    origins = Origins.of(motion.q, [0, motion.n_samples - 1], pinned)
    moments = np.arange(float(motion.n_samples))
    return repaired(
        _Motion(cell, motion, motion, moments, origins),
        lambda found: verify_robot(cell, found.rows, deadline, contacts=False),
        MARGINS,
        deadline,
        under_errors=cell.errors != ErrorBox(),
    )


def spread(
    motion: JointTrajectory, given: BoolArray, velocities: FloatArray
) -> FloatArray:
    """Times of waypoints, those between given ones by how far joints move, (n_rows,).

    What is inserted lies closely where rows were pushed, and may go a long way in the
    time that it had before it was.

    Args:
        motion: With times, of straight lines.
        given: Which waypoints keep their times, both ends among them, (n_rows,).
        velocities: Limits; a joint without counts by its values; [rad/s], [m/s].
    """
    assert motion.times is not None
    least = np.abs(np.diff(motion.q, axis=0)) / np.where(
        np.isfinite(velocities), velocities, 1.0
    )
    way = np.concatenate([[0.0], np.cumsum(least.max(axis=1))])
    known = np.flatnonzero(given)
    distances, indices = way[known], np.arange(len(way))
    part = np.clip(np.searchsorted(known, indices, "right") - 1, 0, len(known) - 2)
    start, length = distances[part], np.diff(distances)[part]
    times = motion.times[known]
    share = (way - start) / np.where(length > 0.0, length, np.inf)
    found = np.where(given, motion.times, times[part] + share * np.diff(times)[part])
    return found if (np.diff(found) > 0.0).all() else motion.times


class _Slopes:
    """How much room pairs have beyond what is asked, and where it grows."""

    def __init__(self, cell: Cell, pairs: IntArray, margins: FloatArray) -> None:
        self._cell, self._table = cell, cell.asked.among(pairs).table
        self._target = self._table.required + margins
        joints = cell.robot.joints
        self._limits = [j.lower for j in joints], [j.upper for j in joints]

    def gaps(self, q: FloatArray, others: FloatArray) -> FloatArray:
        """Room of every pair at rows of q, shape (n_rows, n_pairs); [m].

        Args:
            q: Columns of the robot, shape (n_rows, n_columns); [rad], [m].
            others: Of what moves beside, shape (n_rows, n_more).
        """
        columns = [self._of(k, q, others) for k in range(self._table.size)]
        return np.stack(columns, axis=1)

    def up(self, q: FloatArray, others: FloatArray) -> FloatArray:
        """A row of q that has room, or what steps along slopes lead to."""
        best, most = q, -np.inf
        for _ in range(PUSHES):
            gaps = self.gaps(q[None], others)[0]
            k = int(np.argmin(gaps))
            if gaps[k] > most:
                best, most = q, gaps[k]
            if not -np.inf < gaps[k] < 0.0:
                break
            slope = self.slope(k, q, others, gaps[k])
            squared = float(slope @ slope)
            if not squared > 0.0:
                break
            step = 1.02 * -gaps[k] * slope / squared
            step *= min(1.0, LONGEST / np.abs(step).max())
            q = np.clip(q + step, *self._limits)
        return best

    def slope(
        self, k: int, q: FloatArray, others: FloatArray, room: float
    ) -> FloatArray:
        """How the room of one pair, that of a row, grows, shape (n_columns,)."""
        rows = q + STEP * np.eye(len(q))
        return np.asarray((self._of(k, rows, others) - room) / STEP)

    def _of(self, k: int, q: FloatArray, others: FloatArray) -> FloatArray:
        """Room of one pair at rows of q, shape (n_rows,); [m]."""
        others = np.broadcast_to(others, (len(q), others.shape[1]))
        poses = self._cell.asked.poses(np.hstack([q, others]))
        one, other = self._table.one[k], self._table.other[k]
        both = np.full(len(q), one), np.full(len(q), other)
        found = self._cell.distances(*both, poses)
        return np.asarray(found - self._target[k])
