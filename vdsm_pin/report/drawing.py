"""What differs between a page of a snake arm and one of any other robot.

What moves beside them is drawn alike.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple, Protocol

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, quaternions
from vdsm_pin.geometry.solids import Solid
from vdsm_pin.problem.any_problem import AnyMotion, AnyProblem
from vdsm_pin.problem.scene import Moving, Obstacle, solid_of
from vdsm_pin.report.charts import packed
from vdsm_pin.report.solids import Detail, Surface, detail, surface
from vdsm_pin.report.thinning import Thinned

_TURN: Final = np.deg2rad(5.0)
"""Between two poses that a page is told nothing turns farther; [rad]."""
_MOST: Final = 4_000
"""Poses that a page is told of an obstacle, besides one a knot."""


def start_pose(obstacle: Obstacle, trajectory: AnyMotion) -> FloatArray:
    """T_base_obstacle as the motion begins, shape (4, 4); [m].

    At its first knot where the motion has no times.
    """
    if not isinstance(obstacle, Moving):
        return np.eye(4)
    times = trajectory.times
    begin = obstacle.carrier.path.own_times if times is None else times
    return np.asarray(obstacle.poses(begin[:1])[0])


def moves(obstacle: Obstacle, trajectory: AnyMotion) -> dict[str, Any]:
    """How a page moves what it draws: nothing of what rests.

    Poses at moments in waypoints, near enough to each other that going straight and
    turning evenly from one to the next is as good as the motion.
    """
    if not isinstance(obstacle, Moving):
        return {}
    moments = told_moments(obstacle, trajectory)
    times = trajectory.times_at(moments)
    if times is None:
        times = obstacle.carrier.path.own_times[:1]
    poses = obstacle.poses(times)
    turns = quaternions(poses[:, :3, :3])
    return {
        "moves": {
            "moments": packed(moments, "<f8"),
            "places": packed(poses[:, :3, 3]),
            "turns": packed(turns),
        }
    }


def told_moments(obstacle: Moving, trajectory: AnyMotion) -> FloatArray:
    """When to tell where it stands, in waypoints, rising."""
    times, path = trajectory.times, obstacle.carrier.path
    if times is None or len(times) == 1:
        return np.zeros(1)
    inside = path.own_times[(path.own_times > times[0]) & (path.own_times < times[-1])]
    knots = np.unique(np.concatenate([times[:1], inside, times[-1:]]))
    steps = np.abs(np.diff(path.at(knots), axis=0)).max(axis=1, initial=0.0)
    parts = np.ceil(steps / _TURN).clip(1, max(1, _MOST // len(steps))).astype(int)
    if path.degree > 1:
        parts = np.maximum(parts, 8)
    whole = subdivided(knots, parts)
    return np.asarray(np.interp(whole, times, np.arange(float(len(times)))))


def subdivided(knots: FloatArray, parts: IntArray) -> FloatArray:
    """Rising knots, shape (n,), and what cuts each gap into so many equal parts."""
    pairs = zip(knots[:-1], knots[1:], parts, strict=True)
    told = [np.linspace(a, b, n, endpoint=False) for a, b, n in pairs]
    return np.concatenate([*told, knots[-1:]])


class Silhouette(NamedTuple):
    """An arm or robot in one pose; base frame, [m].

    Args:
        links: Points of each link, shape (n, 3): the ends of its axis, or its corners.
        radius: Of the links that are axes; 0 where they are corners.
    """

    links: list[FloatArray]
    radius: float


class DrawnPart(NamedTuple):
    """What moves as one, and where it is at some moments.

    Args:
        name: Of the link, or of what it carries.
        skin: Its triangles, in its own frame.
        colour: As #rrggbb.
        places: Of its frame in the base frame, shape (n, 3); [m].
        turns: R_base_part, shape (n, 3, 3); [-].
    """

    name: str
    skin: Surface
    colour: str
    places: FloatArray
    turns: FloatArray


class Drawing(Protocol):
    """How the motion of an arm or robot is drawn."""

    @property
    def problem(self) -> AnyProblem:
        """What is around it."""

    @property
    def trajectory(self) -> AnyMotion:
        """The motion."""

    @property
    def extent(self) -> float:
        """How far obstacles without an end are drawn; [m]."""

    @property
    def path(self) -> FloatArray:
        """Corners of the desired path, shape (m, 3), none where none is asked; [m]."""

    @property
    def names(self) -> list[str]:
        """Names of the links, in the order of the brackets."""

    @property
    def not_drawn(self) -> list[str]:
        """What links look like that is not drawn, and why, a sentence each."""

    def scene(self, obstacles: Sequence[Obstacle]) -> dict[str, Any]:
        """The arm or robot and some obstacles; base frame, [m]."""

    def motion(self, shown: Thinned) -> dict[str, Any]:
        """What the page computes the poses of the rows from."""

    def charts(
        self, shown: Thinned, clearances: list[dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """Every plot in order, those of the clearances among them."""

    def stance(self, q: FloatArray) -> dict[str, Any]:
        """Where the links are at values of the joints, shape (n_joints,)."""

    def silhouette(self, moment: float) -> Silhouette:
        """The links at a moment in waypoints."""

    def told_moments(self) -> FloatArray:
        """Moments near enough that links go straight in between, shape (n,)."""

    def points(self, moments: FloatArray) -> FloatArray:
        """A point of every link at moments in waypoints, shape (n, k, 3); [m]."""

    def parts(self, moments: FloatArray) -> list[DrawnPart]:
        """The links and what they carry at moments in waypoints."""


def obstacle_data(
    problem: AnyProblem,
    obstacles: Sequence[Obstacle],
    trajectory: AnyMotion,
    extent: float,
) -> dict[str, Any]:
    """Some obstacles, and where their frame is; base frame, [m].

    What moves is in its own frame, which stands where `moves` says.
    """
    fine = detail(len(obstacles))
    return {
        "pose": problem.T_world_base.ravel().tolist(),
        "obstacles": [
            {**solid_data(solid_of(one), extent, fine), **moves(one, trajectory)}
            for one in obstacles
        ],
    }


def solid_data(solid: Solid, extent: float, fine: Detail) -> dict[str, Any]:
    """Triangles to draw a solid with."""
    skin = surface(solid, extent, fine)
    return {
        "name": solid.name,
        "vertices": packed(skin.vertices),
        "triangles": packed(skin.triangles, "<u4"),
        "round": skin.round,
        "creased": skin.creased,
        "count": len(skin.triangles),
    }


def row_data(trajectory: AnyMotion, shown: Thinned) -> dict[str, Any]:
    """Which rows are shown, and when they are."""
    times = {} if trajectory.times is None else {"times": trajectory.times[shown.rows]}
    return {
        "nSamples": trajectory.n_samples,
        **{name: packed(values, "<f8") for name, values in times.items()},
        "complete": shown.complete,
        "rows": packed(shown.rows, "<i4"),
    }
