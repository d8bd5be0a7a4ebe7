"""Witness motions: an insertion along a curve, then the drawing of the path.

Nothing here looks at obstacles: they are carved round the motion afterwards.
"""

import itertools
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.hrm2000.curves import TipCurve, follow_the_leader
from vdsm_pin.arm.kinematics import joint_angles, joint_centres, link_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.trajectory import Trajectory

ROW: Final = 1.6e-3
"""Travel of the tip per row; lengths of the arm."""

RESERVE: Final = np.deg2rad(0.3)
"""What a witness keeps of the limits of its joints; [rad]."""

NEWTON_STEPS: Final = 40
PULL: Final = 0.3
"""Part of the way back to the posture at the beginning, per row of a drawing."""


class DraftRejected(Exception):
    """This draft of a problem has no witness, or is none of its family."""


@dataclass(frozen=True)
class Witness:
    """A motion that solves a problem, and the path that it draws.

    Args:
        arm: The arm.
        motion: The rows.
        points: Corners of the path, shape (k, 3); [m].
        closed: Whether the last corner joins the first.
        straight: Whether the arm is straight in the first row.
        pointing: Where its last link looks on the path; None where nobody asks.
    """

    arm: Manipulator
    motion: Trajectory
    points: FloatArray
    closed: bool
    straight: bool = True
    pointing: Pointing | None = None

    @property
    def centres(self) -> FloatArray:
        """Joint centres of every row, shape (n, N + 1, 3); [m]."""
        motion = self.motion
        return joint_centres(self.arm, motion.x0, motion.alpha, motion.theta)

    @property
    def n_before(self) -> int:
        """Rows before the first one on the path."""
        return int(np.argmax(self.motion.on_path))

    def begun_at(self, row: int) -> "Witness":
        """The rest of the motion from a row, the arm bent as it is there."""
        rest = self.motion.part(row, self.motion.n_samples)
        return Witness(self.arm, rest, self.points, self.closed, straight=False)


def rows_of(arm: Manipulator, centres: FloatArray) -> Trajectory:
    """A motion off the path through these joint centres."""
    alpha, theta = joint_angles(arm, centres)
    off = np.zeros(len(centres))
    return Trajectory(off > 0.0, off, centres[:, 0, 0], alpha, theta)


def joined(first: Trajectory, second: Trajectory) -> Trajectory:
    """Two motions one after the other; the last row of the first is left out."""
    head = first.part(0, first.n_samples - 1)
    names = ("on_path", "path_m", "x0", "alpha", "theta")
    parts = [np.concatenate([getattr(head, n), getattr(second, n)]) for n in names]
    return Trajectory(*parts)


def check_limits(arm: Manipulator, motion: Trajectory) -> None:
    """Whether the joints keep their reserve.

    Raises:
        DraftRejected: If not.
    """
    psi = link_angles(motion.alpha, motion.theta).max()
    box = max(np.abs(motion.alpha).max(), np.abs(motion.theta).max())
    low, high = arm.base_range
    on_rail = low <= motion.x0.min() and motion.x0.max() <= high
    if not (
        psi <= arm.max_link_angle - RESERVE
        and box <= arm.max_joint_angle - RESERVE
        and on_rail
    ):
        raise DraftRejected


def insertion(
    arm: Manipulator, curve: TipCurve, start: float, end: float
) -> Trajectory:
    """The arm fed along the curve, its tip from one arc length to another.

    Args:
        arm: The arm.
        curve: What the tip follows.
        start: At most 0: the arm is straight there; [m].
        end: [m].

    Raises:
        DraftRejected: If the arm is too short, or a joint would pass a limit.
    """
    count = int(np.ceil((end - start) / (ROW * arm.total_length))) + 1
    return fed(arm, curve, np.linspace(start, end, count))


def fed(arm: Manipulator, curve: TipCurve, tips: FloatArray) -> Trajectory:
    """The arm fed along the curve, its tip at these arc lengths; see `insertion`."""
    centres = follow_the_leader(arm, curve, tips)
    if not (np.abs(centres[:, 0, 1:]).max() == 0.0 and centres[-1, 0, 0] < curve.lead):
        raise DraftRejected
    motion = rows_of(arm, centres)
    check_limits(arm, motion)
    return motion


def swing(arm: Manipulator, joints: FloatArray) -> Trajectory:
    """From straight at x0 = 0 to joint values, on a straight line in joint space.

    Args:
        arm: The arm.
        joints: q = (x0, alpha1, theta1, ..), shape (1 + 2N,); [m], [rad].

    Raises:
        DraftRejected: If a joint would pass a limit.
    """
    count = int(np.ceil(np.abs(joints[1:]).max() / np.deg2rad(0.5))) + 1
    rows = np.linspace(0.0, 1.0, count)[:, None] * joints
    off = np.zeros(count)
    motion = Trajectory(off > 0.0, off, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
    check_limits(arm, motion)
    return motion


def stations(path: DesiredPath, step: float) -> FloatArray:
    """Arc lengths of a path's corners and of places between them; [m]."""
    parts = [
        np.linspace(a, b, int(np.ceil((b - a) / step)) + 1)[:-1]
        for a, b in itertools.pairwise(path.corner_stations)
    ]
    return np.concatenate([*parts, path.corner_stations[-1:]])


def drawing(
    arm: Manipulator, joints: FloatArray, path: DesiredPath, free: int
) -> Trajectory:
    """The path drawn by the joints nearest to the tip (resolved rates, Newton steps).

    Args:
        arm: The arm.
        joints: Where it begins, its tip at the path's first corner, shape (1 + 2N,).
        path: What it draws.
        free: How many links may move, from the tip; all of them: the base too.

    Raises:
        DraftRejected: If it does not get round, or a joint would pass a limit.
    """
    places = stations(path, ROW * arm.total_length)
    moving = slice(1 + 2 * (arm.n_links - free) if free < arm.n_links else 0, None)
    rows, now = [], joints.copy()
    for target in path.at(places):
        pull = np.zeros(joints.size)
        pull[moving] = PULL * (joints - now)[moving]
        for _ in range(NEWTON_STEPS):
            tip, slopes = _slopes(arm, now, moving)
            miss = target - tip
            inverse = np.linalg.pinv(slopes, rcond=1e-4)
            aside = pull[moving] - inverse @ (slopes @ pull[moving])
            if np.linalg.norm(miss) <= 1e-9 * arm.total_length and not aside.any():
                break
            now = now.copy()
            now[moving] += inverse @ miss + aside
            pull = np.zeros(joints.size)
        else:
            raise DraftRejected
        rows.append(now)
    table = np.array(rows)
    drawn = np.ones(len(rows), dtype=np.bool_)
    motion = Trajectory(drawn, places, table[:, 0], table[:, 1::2], table[:, 2::2])
    check_limits(arm, motion)
    if np.abs(np.diff(motion.joints[:, 1:], axis=0)).max() > np.deg2rad(2.0):
        raise DraftRejected
    return motion


def _slopes(
    arm: Manipulator, joints: FloatArray, moving: slice
) -> tuple[FloatArray, FloatArray]:
    """The tip, shape (3,), and its central differences, shape (3, n_moving)."""
    step = 1e-6
    moves = step * np.eye(joints.size)[moving]
    rows = np.vstack([joints, joints + moves, joints - moves])
    tips = joint_centres(arm, rows[:, 0], rows[:, 1::2], rows[:, 2::2])[:, -1]
    count = len(moves)
    return tips[0], (tips[1 : 1 + count] - tips[1 + count :]).T / (2.0 * step)


def drawn_by_feeding(
    arm: Manipulator, curve: TipCurve, tips: tuple[float, float, float], step: float
) -> Witness:
    """An insertion whose last part draws: the path is a piece of the curve itself.

    Args:
        arm: The arm.
        curve: What the tip follows.
        tips: Arc lengths at the start, at the path's first and last point; [m].
        step: Distance of the path's corners along the curve; [m].

    Raises:
        DraftRejected: If the arm is too short, or a joint would pass a limit.
    """
    start, first, last = tips
    before = insertion(arm, curve, start, first)
    count = int(np.ceil((last - first) / step)) + 1
    at = np.linspace(first, last, count)
    points = curve.at(at)
    rest = fed(arm, curve, at)
    sides = np.linalg.norm(np.diff(points, axis=0), axis=1)
    drawn = Trajectory(
        np.ones(count, dtype=np.bool_),
        np.concatenate([[0.0], np.cumsum(sides)]),
        rest.x0,
        rest.alpha,
        rest.theta,
    )
    return Witness(arm, joined(before, drawn), points, closed=False)
