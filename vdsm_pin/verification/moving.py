"""What moves besides an arm or a robot: one tree and one path of all that moves.

The rows of a trajectory and the knots of what carries obstacles are joined in time.
Every interval of the trajectory is one or more intervals of the joint path; results
are told in the trajectory's own intervals.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.paths import Path, together
from vdsm_pin.proof.terms import WORLD
from vdsm_pin.proof.tree import Tree

PART: Final = 0.3
"""About how far a column of q moves in one part of a long interval; [rad], [m]."""

MOST_PARTS: Final = 64
"""Most parts that one interval is cut into."""


def joined_tree(tree: Tree, scene: Scene) -> Tree:
    """One tree: the joints of the arm or robot, then those that carry obstacles."""
    for carrier in scene.carriers:
        tree = tree.joined(carrier.tree)
    return tree


def obstacle_frames(tree: Tree, scene: Scene) -> list[int]:
    """The frame of `joined_tree` in which each obstacle is at rest.

    Args:
        tree: Of the arm or robot alone.
        scene: The obstacles.

    Returns:
        One number for each obstacle, in scene order; `WORLD` where it does not move.
    """
    first, before = {}, len(tree.joints)
    for carrier in scene.carriers:
        first[carrier] = before
        before += len(carrier.tree.joints)
    return [
        first[one.carrier] + one.frame if isinstance(one, Moving) else WORLD
        for one in scene.obstacles
    ]


def untimed(scene: Scene, trajectory: Trajectory | JointTrajectory | Path) -> str:
    """Why moving obstacles need times that a motion lacks; empty where it has them."""
    if trajectory.times is not None or not scene.moving:
        return ""
    name = scene.moving[0].name
    return f"has no column 'time_s', but obstacle {name!r} moves: rows need their times"


def check_timed(scene: Scene, trajectory: Trajectory | JointTrajectory | Path) -> None:
    """Refuse a motion without times in a scene where obstacles move.

    Raises:
        InvalidInput: If obstacles move and the motion has no times.
    """
    if why := untimed(scene, trajectory):
        message = f"trajectory {why}"
        raise InvalidInput(message)


@dataclass(frozen=True)
class Knots:
    """Where the intervals of a joint path lie in those of a trajectory.

    Args:
        moment: Of each knot, in waypoints, shape (n_knots,).
        first: Number of the first interval within each one of the trajectory, and
            after the last that of all, shape (n_intervals + 1,).
    """

    moment: FloatArray
    first: IntArray

    @classmethod
    def of(cls, path: Path, times: FloatArray | None) -> "Knots":
        """The knots of a path over a trajectory's; its rows where there are no times.

        Args:
            path: The trajectory's.
            times: Of the knots of what moves at once; [s].
        """
        rows = np.arange(float(path.n_samples))
        if times is None or path.times is None or len(rows) == 1:
            return cls(rows, np.arange(max(2, len(rows))))
        first = np.searchsorted(times, path.times)
        return cls(np.interp(times, path.times, rows), first)

    def cut(self, counts: IntArray) -> "Knots":
        """Those of a path each of whose intervals is cut in so many equal parts."""
        after = np.concatenate([[0], np.cumsum(counts)])
        places = np.interp(np.arange(after[-1] + 1.0), after, np.arange(len(after)))
        moment = np.interp(places, np.arange(len(after)), self.moment)
        return Knots(moment, after[self.first])

    @property
    def are_rows(self) -> bool:
        """Whether there are none but the rows."""
        return int(self.first[-1]) == len(self.first) - 1

    def interval(self, inner: IntArray) -> IntArray:
        """Of the trajectory, that intervals of the path lie in."""
        return np.asarray(np.searchsorted(self.first, inner, side="right") - 1)

    def moments(self, inner: IntArray, share: FloatArray) -> FloatArray:
        """Shares of intervals of the path in waypoints of the trajectory."""
        after = np.minimum(inner + 1, len(self.moment) - 1)
        step = self.moment[after] - self.moment[inner]
        return np.asarray(self.moment[inner] + share * step)

    def inner(self, moments: FloatArray) -> FloatArray:
        """Moments in waypoints of the trajectory, in knots of the path."""
        number = np.arange(float(len(self.moment)))
        return np.asarray(np.interp(moments, self.moment, number))

    def share(self, inner: IntArray, share: FloatArray) -> FloatArray:
        """The same as shares of the trajectory's intervals; [-]."""
        found = self.moments(inner, share) - self.interval(inner)
        return np.minimum(np.maximum(found, 0.0), 1.0)


def joined_path(path: Path, scene: Scene) -> tuple[Path, Knots]:
    """How all columns of `joined_tree` move, from the first row to the last.

    Args:
        path: Of the arm or robot alone.
        scene: The obstacles.

    Returns:
        The path, and where its intervals lie in the given one.

    Raises:
        InvalidInput: If obstacles move and the path has no times.
    """
    check_timed(scene, path)
    if not scene.carriers:
        return path, Knots.of(path, None)
    ends = float(path.own_times[0]), float(path.own_times[-1])
    whole = together(path, *(one.path for one in scene.carriers), within=ends)
    return whole, Knots.of(path, whole.times)


def in_short_parts(path: Path, knots: Knots) -> tuple[Path, Knots]:
    """The same motion, its long intervals cut: of short ones less is to be proved."""
    if path.n_samples == 1:
        return path, knots
    way = np.abs(np.diff(path.controls, axis=1)).sum(axis=1).max(axis=1, initial=0.0)
    counts = np.clip(np.ceil(way / PART), 1, MOST_PARTS).astype(np.int64)
    if (counts == 1).all():
        return path, knots
    return path.cut(counts), knots.cut(counts)


def whole_rows(
    problem: PlanningProblem, trajectory: Trajectory, moments: FloatArray
) -> FloatArray:
    """Rows of all columns at moments in waypoints, shape (m,): (m, n_columns)."""
    rows, times = trajectory.path.at_moments(moments), trajectory.times_at(moments)
    if times is None:
        return rows
    carried = (carrier.path.at(times) for carrier in problem.scene.carriers)
    return np.hstack([rows, *carried])
