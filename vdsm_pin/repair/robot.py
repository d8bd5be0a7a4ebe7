"""A certified motion of a robot near one that is not.

Where the proof finds bodies too near, samples of the motion are pushed up the slopes of
the clearance until they keep it with a margin; they become waypoints, and the proof
judges the whole again. Start, goal and pinned waypoints stay, and limits are kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible, InvalidInput
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.proof.bodies import Pair
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.judgement import RobotVerification, verify_robot
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.records import Verdict

FIRST: Final = 1e-3
"""Room beyond the required clearance that a pair gets first; [m]."""

WIDEST: Final = 8e-3
"""The most, after it was doubled whenever the pair was still too near; [m]."""

ROUNDS: Final = 12
"""Of pushing and judging."""

APART: Final = float(np.radians(1.0))
"""How far samples lie apart in the joint that moves most; [rad], [m]."""

MOST: Final = 200
"""Samples that a round may push: more are pushed to different sides and lead apart."""

PUSHES: Final = 25
"""Most steps of one sample up the slopes."""

LONGEST: Final = 0.1
"""Longest such step; [rad], [m]."""

STEP: Final = 1e-6
"""Of the differences that slopes are taken from; [rad], [m]."""


@dataclass(frozen=True)
class Repaired:
    """A motion that is certified, and how far it is from the one that was given.

    Args:
        verification: Of the motion.
        given: Number of the given waypoint that each waypoint was, -1 for a new one,
            shape (n_rows,).
        moved: How far each waypoint lies off its place in the given motion, in the
            joint that differs most, shape (n_rows,); [rad], [m].
    """

    verification: RobotVerification
    given: IntArray
    moved: FloatArray


@dataclass(frozen=True)
class _Rows:
    """Waypoints, and where each was in the given motion.

    Args:
        q: Shape (n_rows, n_columns); [rad], [m].
        base: Their places in the given motion, the same shape.
        given: As in `Repaired`.
        fixed: Which stay, shape (n_rows,).
    """

    q: FloatArray
    base: FloatArray
    given: IntArray
    fixed: BoolArray

    def sampled(self, moments: FloatArray) -> "_Rows":
        """The same motion with samples between the waypoints, and at some moments."""
        parts = []
        for k, way in enumerate(np.diff(self.q, axis=0)):
            count = max(1, int(np.ceil(np.abs(way).max() / APART)))
            parts.append(k + np.arange(count) / count)
        last = len(self.q) - 1.0
        places = np.unique(
            np.concatenate([*parts, [last], np.clip(moments, 0.0, last)])
        )
        first = np.minimum(places.astype(np.int64), max(len(self.q) - 2, 0))
        share = (places - first)[:, None]
        after = np.minimum(first + 1, len(self.q) - 1)
        old = places == np.floor(places)
        row = places.astype(np.int64)
        q = np.where(
            old[:, None],
            self.q[row],
            (1.0 - share) * self.q[first] + share * self.q[after],
        )
        base = (1.0 - share) * self.base[first] + share * self.base[after]
        base = np.where(old[:, None], self.base[row], base)
        given = np.where(old, self.given[row], -1)
        return _Rows(q, base, given, np.where(old, self.fixed[row], False))

    def only(self, keep: BoolArray) -> "_Rows":
        """Some of them."""
        return _Rows(self.q[keep], self.base[keep], self.given[keep], self.fixed[keep])


def repair_robot(
    cell: Cell,
    path: Path,
    pinned: Sequence[int] = (),
    deadline: Deadline = NO_LIMIT,
) -> Repaired:
    """A certified motion near a given one.

    Args:
        cell: Robot, scene and required clearances.
        path: Straight lines between waypoints.
        pinned: Numbers of waypoints, from 0, that stay besides start and goal.
        deadline: When to give up.

    Raises:
        InvalidInput: If the motion is not of straight lines or has no such waypoint.
        Infeasible: If none was found; the message says why and where.
    """
    n = len(path.knots)
    if path.degree != 1:
        message = "repair takes straight lines between waypoints, without velocities"
        raise InvalidInput(message)
    for k in pinned:
        if not 0 <= k < n:
            message = f"pinned waypoint is {k}, expected 0 to {n - 1}"
            raise InvalidInput(message)
    fixed = np.isin(np.arange(n), [0, n - 1, *pinned])
    rows = _Rows(path.knots, path.knots, np.arange(n), fixed)
    near: dict[int, float] = {}
    lost: dict[int, float] = {}
    found = verify_robot(cell, path, deadline)
    for _ in range(ROUNDS):
        bad = np.flatnonzero(found.least.verdict != CERTIFIED).tolist()
        if not bad or deadline.passed:
            break
        near |= {k: min(2.0 * near.get(k, 0.5 * FIRST), WIDEST) for k in bad}
        if cell.errors != ErrorBox():
            lost |= {k: _lost(found, k) for k in bad}
        margins = np.array([room + lost.get(k, 0.0) for k, room in near.items()])
        slopes = _Slopes(cell, [cell.pairs[k] for k in near], margins)
        moments = found.least.interval[bad] + found.least.time[bad]
        rows = _pushed(rows.sampled(moments[moments >= 0.0]), slopes)
        found = verify_robot(cell, Path(rows.q), deadline)
    if found.verdict is not Verdict.CERTIFIED:
        raise Infeasible(_why(found))
    return Repaired(found, rows.given, np.abs(rows.q - rows.base).max(axis=1))


def _lost(found: RobotVerification, pair: int) -> float:
    """What errors take of the clearance of a pair, about; [m]."""
    bracket = found.least.upper[pair] - found.least.lower[pair]
    return float(bracket) if np.isfinite(bracket) else 0.0


def _pushed(rows: _Rows, slopes: "_Slopes") -> _Rows:
    """The motion with waypoints where pairs come too near, pushed apart.

    Raises:
        Infeasible: If a waypoint that stays is too near.
    """
    gaps = slopes.gaps(rows.q)
    room = gaps + slopes.margins
    for k in np.flatnonzero(rows.fixed & (room.min(axis=1) < 0.0)):
        words = slopes.words(int(np.argmin(room[k])))
        short = -MM_PER_M * room[k].min()
        message = (
            f"waypoint {rows.given[k]} stays, and there {words} are "
            f"{short:.3f} mm nearer than required"
        )
        raise Infeasible(message)
    bad = (gaps.min(axis=1) < 0.0) & ~rows.fixed
    if bad.sum() > MOST:
        words = slopes.words(int(np.argmin(gaps.min(axis=0))))
        message = (
            f"{int(bad.sum())} samples are too near, {words} most: small "
            "changes do not lead round; expected a new plan"
        )
        raise Infeasible(message)
    q = rows.q.copy()
    for k in np.flatnonzero(bad):
        q[k] = slopes.up(q[k])
    beside = bad.copy()
    beside[1:] |= bad[:-1]
    beside[:-1] |= bad[1:]
    moved = _Rows(q, rows.base, rows.given, rows.fixed)
    old = np.isin(np.arange(len(q)), np.flatnonzero(rows.given >= 0))
    new = (rows.q != rows.base).any(axis=1)
    return moved.only(old | beside | new)


class _Slopes:
    """How much room pairs have beyond what is asked, and where it grows."""

    def __init__(self, cell: Cell, pairs: Sequence[Pair], margins: FloatArray) -> None:
        self._tree, self._coal, self._pairs = cell.robot.tree, cell.coal, pairs
        self._cell, self.margins = cell, margins
        self._target = np.array([pair.required for pair in pairs]) + margins
        joints = cell.robot.joints
        self._limits = [j.lower for j in joints], [j.upper for j in joints]

    def words(self, k: int) -> str:
        """Both bodies of a pair."""
        return self._cell.names(self._pairs[k])

    def gaps(self, q: FloatArray) -> FloatArray:
        """Room of every pair at rows of q, shape (n_rows, n_pairs); [m]."""
        columns = [self._of(k, q) for k in range(len(self._pairs))]
        return np.stack(columns, axis=1)

    def up(self, q: FloatArray) -> FloatArray:
        """A row of q that has room, or what steps along slopes lead to."""
        best, most = q, -np.inf
        for _ in range(PUSHES):
            gaps = self.gaps(q[None])[0]
            k = int(np.argmin(gaps))
            if gaps[k] > most:
                best, most = q, gaps[k]
            if not -np.inf < gaps[k] < 0.0:
                break
            slope = (self._of(k, q + STEP * np.eye(len(q))) - gaps[k]) / STEP
            squared = float(slope @ slope)
            if not squared > 0.0:
                break
            step = 1.02 * -gaps[k] * slope / squared
            step *= min(1.0, LONGEST / np.abs(step).max())
            q = np.clip(q + step, *self._limits)
        return best

    def _of(self, k: int, q: FloatArray) -> FloatArray:
        """Room of one pair at rows of q, shape (n_rows,); [m]."""
        pair, poses = self._pairs[k], self._tree.poses(q)
        found = [self._coal.measured(pair, row).distance for row in poses]
        return np.asarray(np.array(found) - self._target[k])


def _why(found: RobotVerification) -> str:
    """What is still wrong and where."""
    check = next(c for c in found.checks if c.verdict is not Verdict.CERTIFIED)
    where = f" ({check.where})" if check.where else ""
    return (
        f"no certified motion was found: {check.name}{where} is {check.verdict.value} "
        f"at waypoint {check.moment:.3f} of the last attempt"
    )
