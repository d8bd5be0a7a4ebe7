"""A certified motion of a robot near one that is not."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.proof.bodies import Pair
from vdsm_pin.proof.paths import Path
from vdsm_pin.repair.rounds import APART, Origins, Places, Repaired, repaired
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.judgement import RobotVerification, verify_robot
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
        path: Straight lines between its waypoints, which keep their times.
        origins: Where its waypoints were.
    """

    cell: Cell
    path: Path
    origins: Origins

    @property
    def q(self) -> FloatArray:
        """Its waypoints, shape (n_rows, n_columns); [rad], [m]."""
        return self.path.knots

    def pushed(self, margins: dict[int, float], moments: FloatArray) -> "_Motion":
        """The motion sampled closely, its pairs pushed apart by margins; [m]."""
        steps = np.abs(np.diff(self.q, axis=0)).max(axis=1, initial=0.0)
        parts = np.maximum(1.0, np.ceil(steps / APART)).astype(np.int64)
        places = Places.within(parts, moments)
        q, origins = places.through(self.q), self.origins.at(places)
        times = self.path.times
        times = None if times is None else places.through(times)
        others = self._others(times, len(q))
        pairs = [self.cell.pairs[k] for k in margins]
        more = np.array([*margins.values()])
        slopes = _Slopes(self.cell, pairs, more)
        names = [self.cell.names(pair) for pair in pairs]
        bad = origins.too_near(slopes.gaps(q, others), more, names)
        kept, q = origins.kept(q, bad), q.copy()
        for k in np.flatnonzero(bad):
            q[k] = slopes.up(q[k], others[k : k + 1])
        path = Path(q[kept], times=None if times is None else times[kept])
        return _Motion(self.cell, path, origins.only(kept))

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
    path: Path,
    pinned: Sequence[int] = (),
    deadline: Deadline = NO_LIMIT,
) -> Repaired[RobotVerification]:
    """A certified motion near a given one; start, goal and pinned waypoints stay.

    Args:
        cell: Robot, scene and required clearances.
        path: Straight lines between waypoints, which keep their times.
        pinned: Numbers of waypoints, from 0, that stay besides start and goal.
        deadline: When to give up.

    Raises:
        InvalidInput: If the motion is not of straight lines, has no such waypoint, or
            no times beside what moves.
        Infeasible: If none was found; the message says why and where.
    """
    if path.degree != 1:
        message = "repair takes straight lines between waypoints, without velocities"
        raise InvalidInput(message)
    check_timed(cell.scene, path)
    origins = Origins.of(path.knots, [0, len(path.knots) - 1], pinned)
    return repaired(
        _Motion(cell, path, origins),
        lambda motion: verify_robot(cell, motion.path, deadline, contacts=False),
        MARGINS,
        deadline,
        under_errors=cell.errors != ErrorBox(),
    )


class _Slopes:
    """How much room pairs have beyond what is asked, and where it grows."""

    def __init__(self, cell: Cell, pairs: Sequence[Pair], margins: FloatArray) -> None:
        self._cell, self._pairs = cell, pairs
        self._target = np.array([pair.required for pair in pairs]) + margins
        joints = cell.robot.joints
        self._limits = [j.lower for j in joints], [j.upper for j in joints]

    def gaps(self, q: FloatArray, others: FloatArray) -> FloatArray:
        """Room of every pair at rows of q, shape (n_rows, n_pairs); [m].

        Args:
            q: Columns of the robot, shape (n_rows, n_columns); [rad], [m].
            others: Of what moves beside, shape (n_rows, n_more).
        """
        columns = [self._of(k, q, others) for k in range(len(self._pairs))]
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
            rows = q + STEP * np.eye(len(q))
            slope = (self._of(k, rows, others) - gaps[k]) / STEP
            squared = float(slope @ slope)
            if not squared > 0.0:
                break
            step = 1.02 * -gaps[k] * slope / squared
            step *= min(1.0, LONGEST / np.abs(step).max())
            q = np.clip(q + step, *self._limits)
        return best

    def _of(self, k: int, q: FloatArray, others: FloatArray) -> FloatArray:
        """Room of one pair at rows of q, shape (n_rows,); [m]."""
        others = np.broadcast_to(others, (len(q), others.shape[1]))
        poses = self._cell.poses(np.hstack([q, others]))
        pairs = [self._pairs[k]] * len(q)
        found = self._cell.distances(pairs, poses)
        return np.asarray(found - self._target[k])
