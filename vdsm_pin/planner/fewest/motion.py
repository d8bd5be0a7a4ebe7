"""A motion as corners in the chart, and its rows (Eq. 5, 7).

The chart is (tip, D_2..D_N): D_i is the offset of joint i's projection from where the
straight arm to that tip has it, P_i = k_i T + D_i. Between corners tip and offsets run
along straight lines, so the tip is exact, links keep their length, and an arm that is
straight at both corners stays straight. An offset with a corner at joint m is a knee
there; where one knee turns into another, both are bent on the way and no third one.

Where a link leans backwards that chart ends. There the directions of the links stand in
place of the offsets (`charts`), and the base may be held to a short rail.
"""

import itertools
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_angles, joint_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.charts import Intervals
from vdsm_pin.planner.spacing import STRAYS, count_of, row_steps, spread
from vdsm_pin.tolerances import TOLERANCES

MOST_MORE, SOME_MORE = 20, 100_000
"""Rows at which adding rows ends: so many for each that the spacing asks for, and so
many besides."""
ROW_ROUNDS: Final = 12
"""Rounds of adding rows; each at least reaches what it aims at in smooth stretches."""


@dataclass(frozen=True)
class Corners:
    """Corners of the motion in the chart.

    Args:
        tips: Shape (n, 3); [m].
        offsets: D_1..D_{N+1}, shape (n, N + 1, 2), the first and last zero [m], or the
            directions of the links, shape (n, N, 3) [-].
        stations: Arc length along the desired path, on ways that of the place left,
            shape (n,); [m].
        drawn: Whether the tip draws from corner k to k + 1, shape (n - 1,).
    """

    tips: FloatArray
    offsets: FloatArray
    stations: FloatArray
    drawn: BoolArray

    def take(self, kept: IntArray) -> "Corners":
        """Only these corners; an interval is drawn if all it replaces were."""
        drawn = [self.drawn[a:b].all() for a, b in itertools.pairwise(kept)]
        return Corners(
            self.tips[kept],
            self.offsets[kept],
            self.stations[kept],
            np.array(drawn, dtype=np.bool_),
        )

    def rerouted(
        self, begin: int, end: int, tips: FloatArray, offsets: FloatArray
    ) -> "Corners":
        """Others in place of corners begin to end; nothing is drawn between them."""
        count = len(tips) - 1

        def with_those(own: Any, others: Any, rest: int) -> Any:
            return np.concatenate([own[:begin], others, own[rest:]])

        left, come = self.stations[begin], self.stations[end]
        return Corners(
            with_those(self.tips, tips, end + 1),
            with_those(self.offsets, offsets, end + 1),
            with_those(self.stations, np.append(np.full(count, left), come), end + 1),
            with_those(self.drawn, np.zeros(count, np.bool_), end),
        )

    def pick(self, intervals: IntArray) -> Intervals:
        """Some intervals on their own."""
        return Intervals(
            self.tips[intervals],
            self.tips[intervals + 1],
            self.offsets[intervals],
            self.offsets[intervals + 1],
        )


@dataclass(frozen=True)
class Rows:
    """Configurations along the motion, close enough to be rows of a trajectory.

    Args:
        interval: Interval of the corners each row lies in, shape (r,).
        share: Where in its interval, 0 to 1, shape (r,).
        centres: Joint centres, shape (r, N + 1, 3), NaN where a link is too short; [m].
    """

    interval: IntArray
    share: FloatArray
    centres: FloatArray


def rows_at(
    manipulator: Manipulator, corners: Corners, interval: IntArray, share: FloatArray
) -> Rows:
    """Configurations at given places of the motion."""
    every = corners.pick(np.arange(len(corners.drawn)))
    return Rows(interval, share, every.centres(manipulator, interval, share))


def dense_rows(
    manipulator: Manipulator,
    corners: Corners,
    spacing: float,
    turn: float,
    stray: float,
) -> Rows:
    """Rows close enough that straight lines in joint space follow the chart.

    Every corner is a row. Midway between two rows the tip strays from the path it draws
    by no more than `TOLERANCES.planned_stray`, and by a bound that verifiers know
    nowhere between them by more than the spacing.

    Args:
        manipulator: The arm.
        corners: The motion.
        spacing: Largest distance of the tips of two rows; [m].
        turn: Largest change of a joint angle between two rows; [rad].
        stray: Largest distance of a joint centre, midway between two rows in joint
            space, from where the chart has it; [m].

    Raises:
        NoPlanFound: If no number of rows is enough, as where a joint angle jumps, or
            there is no arm between two corners.
    """
    travel = np.linalg.norm(np.diff(corners.tips, axis=0), axis=1)
    asked = counts = np.maximum(1, count_of(travel / spacing))
    most = MOST_MORE * int(counts.sum()) + SOME_MORE
    excess = np.full(len(counts), np.inf)
    for _ in range(ROW_ROUNDS):
        if counts.sum() > most:
            break
        rows = rows_at(manipulator, corners, *spread(counts))
        excess = np.zeros(len(counts))
        each = _excess(manipulator, corners, rows, (spacing, turn, stray))
        np.maximum.at(excess, rows.interval[:-1], each)
        if (excess <= 1.0).all():
            return rows
        more = np.ceil(counts * excess * 1.05).astype(np.int64)
        counts = np.where(excess > 1.0, np.maximum(more, counts + 1), counts)
    # Near a stretched arm angles go with the root of the way: rows crowd at its end.
    rows = rows_at(manipulator, corners, *spread(np.where(excess > 1.0, asked, counts)))
    for _ in range(ROW_ROUNDS):
        each = _excess(manipulator, corners, rows, (spacing, turn, stray))
        if (each <= 1.0).all():
            return rows
        parts = np.ceil(np.maximum(each, 1.0) ** 2).astype(np.int64)
        if parts.sum() > most:
            break
        rows = rows_at(manipulator, corners, *_cut(rows, parts))
    message = (
        f"with {len(rows.interval)} rows {int((each > 1.0).sum())} steps still turn or "
        f"stray {each.max():.2f} times as far as a row may"
    )
    raise NoPlanFound(message)


def _cut(rows: Rows, parts: IntArray) -> tuple[IntArray, FloatArray]:
    """Places of rows with each step cut evenly into so many parts, shape (r - 1,)."""
    ends = np.where(np.diff(rows.interval) > 0, 1.0, rows.share[1:])
    step, part = (places[:-1] for places in spread(parts))
    share = rows.share[step] + part * (ends - rows.share[:-1])[step]
    return (
        np.append(rows.interval[step], rows.interval[-1]),
        np.append(share, rows.share[-1]),
    )


def _excess(
    manipulator: Manipulator,
    corners: Corners,
    rows: Rows,
    most: tuple[float, float, float],
) -> FloatArray:
    """How many times as far as a row may each step turns or strays, shape (r - 1,).

    `most` has spacing, turn and stray of `dense_rows`.

    Raises:
        NoPlanFound: If there is no arm at a row or midway between two.
    """
    spacing, turn, stray = most
    alpha, theta = joint_angles(manipulator, rows.centres)
    step, bound = row_steps(manipulator, alpha, theta)
    strays = _stray(manipulator, corners, rows, alpha, theta)
    # Straying falls with the square of the distance of the rows.
    bow = np.sqrt(strays.max(axis=1) / stray)
    proved = bound / (STRAYS * spacing)
    most_stray = TOLERANCES.planned_stray * manipulator.total_length
    tip = np.sqrt(np.maximum(strays[:, -1] / most_stray, proved))
    bow = np.where(corners.drawn[rows.interval[:-1]], np.maximum(bow, tip), bow)
    excess = np.maximum(step / turn, bow)
    if not np.isfinite(excess).all():
        message = "between two corners of the motion found no arm can stand"
        raise NoPlanFound(message)
    return np.asarray(excess)


def _stray(
    manipulator: Manipulator,
    corners: Corners,
    rows: Rows,
    alpha: FloatArray,
    theta: FloatArray,
) -> FloatArray:
    """How far joint space and chart differ midway between rows, centre by centre.

    Returns:
        Shape (r - 1, N + 1); [m].
    """
    ends = np.where(np.diff(rows.interval) > 0, 1.0, rows.share[1:])
    middle = (rows.share[:-1] + ends) / 2.0
    chart = rows_at(manipulator, corners, rows.interval[:-1], middle).centres
    joint = joint_centres(
        manipulator,
        (rows.centres[:-1, 0, 0] + rows.centres[1:, 0, 0]) / 2.0,
        (alpha[:-1] + alpha[1:]) / 2.0,
        (theta[:-1] + theta[1:]) / 2.0,
    )
    return np.asarray(np.linalg.norm(chart - joint, axis=2))
