"""Coal's distances at the rows of a trajectory, a second opinion on the proved ones.

Poses come from Pinocchio, shapes from the URDF and distances from Coal; the brackets
they are held against come from the closed-form kinematics and our own kernels. Coal
proves nothing, so agreement certifies no clearance, and a disagreement leaves the
motion undecided.

Pairs that are far apart add no evidence. A chain of balls along each link against the
boxes of the obstacles bounds every distance from below at a hundredth of the price; a
row is measured where that bound is within reach, and every pair at its nearest row. Nor
does a row add any at which the arm has hardly moved since the row before.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.row_bounds import coarse_bounds, row_brackets
from vdsm_pin.geometry.solids import Solid
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving, solid_of
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.coal_bodies import (
    CoalObstacle,
    coal_bodies,
    distance_request,
    measure,
)
from vdsm_pin.verification.coal_log import CoalLog
from vdsm_pin.verification.records import Check, Verdict
from vdsm_pin.verification.robot_model import LinkPoses, RobotModel
from vdsm_pin.verification.task import ArmPairs

CHUNK_BOUNDS: Final = 1 << 17
"""Coarse bounds held in memory at a time: rows times links times obstacles."""

CHUNK_PAIRS: Final = 1 << 10
"""Pairs measured between two looks at the time."""

MANY: Final = 10_000
"""Of more obstacles than this only the nearest link of each is measured when far."""


@dataclass(frozen=True)
class CoalDistances:
    """Measured distances between links and obstacles, with our brackets beside them.

    Args:
        waypoint: Row of the trajectory, from 0, shape (m,).
        link: Link, from 0, or N for the tool, shape (m,).
        obstacle: Number of the obstacle in the scene, from 0, shape (m,).
        distance: By Coal; -inf where its answer is unusable, shape (m,); [m].
        lower: Proved lower bound at the row; [m].
        upper: Proved upper bound at the row; [m].
        link_point: Coal's witness on the link, base frame, shape (m, 3); [m].
        other_point: Coal's witness on the obstacle, shape (m, 3); [m].
    """

    waypoint: IntArray
    link: IntArray
    obstacle: IntArray
    distance: FloatArray
    lower: FloatArray
    upper: FloatArray
    link_point: FloatArray
    other_point: FloatArray

    @property
    def disagreement(self) -> FloatArray:
        """How far Coal lies outside the bracket, inf if unusable, shape (m,); [m].

        Where bodies meet only the sign counts, on both sides.
        """
        value, lower, upper = (
            np.maximum(number, 0.0)
            for number in (self.distance, self.lower, self.upper)
        )
        outside = np.maximum(np.maximum(lower - value, value - upper), 0.0)
        return np.where(np.isfinite(self.distance), outside, np.inf)


@dataclass(frozen=True)
class CoalScene:
    """The obstacles, as the proof and as Coal see them.

    Args:
        pieces: Convex pieces for the proof's kernels.
        bodies: Coal's, obstacle by obstacle.
    """

    pieces: PackedPieces
    bodies: tuple[CoalObstacle, ...]

    @classmethod
    def of(cls, problem: PlanningProblem, deadline: Deadline) -> "CoalScene":
        """The obstacles of a problem, none of which moves.

        Raises:
            OutOfTime: If the time is over.
        """
        obstacles = problem.scene.obstacles
        pieces = problem.packed_obstacles
        bodies = (_bodies_of(solid_of(one), deadline) for one in obstacles)
        return cls(pieces, tuple(bodies))


@dataclass(frozen=True)
class ProvedLowers:
    """Proved lower bounds of the pairs over intervals, or else over the whole motion.

    Args:
        least: Over the motion, shape (n_pairs,); [m].
        column: Column of a pair in `lower`, below 0 for none, shape (n_pairs,).
        lower: Over each interval, shape (n_intervals, n_columns); [m].
    """

    least: FloatArray
    column: IntArray
    lower: FloatArray

    def at(self, waypoint: IntArray, pair: IntArray) -> FloatArray:
        """The larger bound of the two intervals that meet at a row, shape (m,); [m]."""
        column = self.column[pair]
        last = len(self.lower) - 1
        before = self.lower[np.minimum(np.maximum(waypoint - 1, 0), last), column]
        after = self.lower[np.minimum(waypoint, last), column]
        return np.where(column < 0, self.least[pair], np.maximum(before, after))


NAME: Final = "distances by Coal against the proved brackets"
"""Name of the row."""


def check_coal(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers | None = None,
    deadline: Deadline = NO_LIMIT,
    log: CoalLog | None = None,
) -> tuple[Check, ...]:
    """Hold Coal's distances to the obstacles at rest against the proved brackets.

    Args:
        robot: The arm in Pinocchio and Coal.
        problem: The scene.
        trajectory: What is judged.
        proved: Proved lower bounds; Coal must not fall below them at either end of an
            interval.
        deadline: When to give up.
        log: Asks for the closest approaches too, and keeps every answer.

    Returns:
        One row of evidence with the largest disagreement; none for an empty scene.

    Raises:
        OutOfTime: If the time is over.
    """
    scene, names = problem.scene.at_rest, problem.manipulator.axis_names
    if not scene.obstacles:
        return ()
    count, worst, where, moment = 0, -np.inf, "", float("nan")
    answers = _answers(robot, problem, trajectory, proved, deadline, log)
    for found, moments, excess in answers:
        count += excess.size
        k = int(np.argmax(excess))
        if excess[k] > worst:
            worst, moment = float(excess[k]), float(moments[k])
            where = (
                f"{names[found.link[k]]} and {scene.names[found.obstacle[k]]}: "
                f"Coal {found.distance[k] * MM_PER_M:.6f} mm, "
                f"proved [{found.lower[k] * MM_PER_M:.6f}, "
                f"{found.upper[k] * MM_PER_M:.6f}] mm"
            )
    total = trajectory.n_samples * len(names) * len(scene.obstacles)
    agreed = worst <= TOLERANCES.coal_agreement
    alone = "" if proved is not None else "; against brackets of the rows alone"
    check = Check(
        name=NAME,
        verdict=Verdict.CERTIFIED if agreed else Verdict.UNDECIDED,
        count=count,
        worst=worst,
        limit=TOLERANCES.coal_agreement,
        unit="m",
        where=f"{where}; {count} of {total} pairs within reach measured{alone}",
        moment=moment,
    )
    return (check,)


def _answers(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers | None,
    deadline: Deadline,
    log: CoalLog | None,
) -> Iterator[tuple[CoalDistances, FloatArray, FloatArray]]:
    """What Coal measures, when (in waypoints), and how far it is off, (m,) each."""
    still = np.array([not isinstance(o, Moving) for o in problem.scene.obstacles])
    numbers = ArmPairs(problem).number[:, still]
    if not still.all():
        problem = replace(problem, scene=problem.scene.at_rest)
    scene = CoalScene.of(problem, deadline)
    if log is not None:
        near = log.asked(problem.scene.names)
        if near.size:
            found, moments = _at_approaches(robot, problem, trajectory, scene, log)
            log.keep_approaches(near, found.distance)
            yield found, moments, _no_pass(found.disagreement)
    reach, travel = reach_of(problem), TOLERANCES.coal_travel
    for found in coal_distances(
        robot, problem, trajectory, reach, travel, deadline, scene
    ):
        excess, pair = found.disagreement, numbers[found.link, found.obstacle]
        held = pair >= 0
        if log is not None:
            log.keep(found.waypoint[held], pair[held], found.distance[held])
        if proved is not None:
            below = np.where(held, _below_proof(found, proved, pair), -np.inf)
            excess = np.maximum(excess, below)
        yield found, found.waypoint.astype(np.float64), _no_pass(excess)


def _no_pass(excess: FloatArray) -> FloatArray:
    """The same with infinity where there is no number."""
    return np.where(np.isnan(excess), np.inf, excess)


def _at_approaches(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    scene: CoalScene,
    log: CoalLog,
) -> tuple[CoalDistances, FloatArray]:
    """Distances at the closest approaches to obstacles, and their moments, (m,).

    Their brackets are those of the configurations at these moments.
    """
    near = [log.approaches[k] for k in log.asked(problem.scene.names)]
    moments = np.array([one.moment for one in near])
    bodies, names = problem.manipulator.axis_names, problem.scene.names
    pairs = [
        (k, bodies.index(one.pair.own), names.index(one.pair.obstacle))
        for k, one in enumerate(near)
    ]
    rows = trajectory.at(moments)
    return _measured(robot, rows, scene, np.array(pairs)), moments


def reach_of(problem: PlanningProblem) -> float:
    """Distance up to which pairs are measured at every row; [m].

    The required clearance and the arm's own radius past it.
    """
    return problem.required_clearance + problem.manipulator.most_radius


def coal_distances(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    reach: float,
    travel: float = 0.0,
    deadline: Deadline = NO_LIMIT,
    scene: CoalScene | None = None,
) -> Iterator[CoalDistances]:
    """Measure the pairs within reach, chunk by chunk, then every pair not yet seen.

    Args:
        robot: The arm in Pinocchio and Coal.
        problem: The scene.
        trajectory: The rows.
        reach: Measure where the coarse bound is at most this; inf for everything; [m].
        travel: Look at one row of each stretch in which the joint centres move by this
            much; 0 for every row; [m].
        deadline: When to give up.
        scene: The obstacles, where they are there already.

    Yields:
        Distances in the order of the rows; last the pairs that were not measured, each
        at the row where its coarse bound is least; of more than `MANY` obstacles each
        with the link that is nearest then.

    Raises:
        OutOfTime: If the time is over.
    """
    arm, obstacles = problem.manipulator, problem.scene.obstacles
    if not obstacles:
        return
    scene = scene or CoalScene.of(problem, deadline)
    least = np.full((arm.axis_radii.size, len(obstacles)), np.inf)
    nearest = np.zeros(least.shape, dtype=np.int64)
    seen = np.zeros(least.shape, dtype=np.bool_)
    moved = _Moved(travel)
    step = max(1, CHUNK_BOUNDS // least.size)
    for first in range(0, trajectory.n_samples, step):
        deadline.check()
        part = slice(first, first + step)
        joints = trajectory.x0[part], trajectory.alpha[part], trajectory.theta[part]
        centres = joint_centres(arm, *joints)
        axes = np.ascontiguousarray(arm.axes(centres))
        bounds = coarse_bounds(scene.pieces, axes, arm.axis_radii)
        here = np.argmin(bounds, axis=0)
        value = np.take_along_axis(bounds, here[None], axis=0)[0]
        nearer = value < least
        least[nearer], nearest[nearer] = value[nearer], here[nearer] + first
        within = (bounds <= reach) & moved(centres)[:, None, None]
        seen |= within.any(axis=0)
        close = np.argwhere(within)
        if close.size:
            close[:, 0] += first
            for some in in_turns(close, deadline):
                yield _measured(robot, trajectory, scene, some)
    if len(obstacles) > MANY:  # of the far ones the nearest link alone
        seen |= np.arange(len(least))[:, None] != np.argmin(least, axis=0)
    unseen = np.argwhere(~seen)
    if unseen.size:
        rows = nearest[unseen[:, 0], unseen[:, 1]]
        far = np.column_stack([rows, unseen])
        for some in in_turns(far, deadline):
            yield _measured(robot, trajectory, scene, some)


def _bodies_of(obstacle: Solid, deadline: Deadline) -> CoalObstacle:
    deadline.check()
    return coal_bodies(obstacle)


def in_turns(pairs: IntArray, deadline: Deadline) -> Iterator[IntArray]:
    """The same pairs, so many at a time that a deadline is heard in between."""
    for first in range(0, len(pairs), CHUNK_PAIRS):
        deadline.check()
        yield pairs[first : first + CHUNK_PAIRS]


class _Moved:
    """Picks the first row of each stretch of a motion, part after part.

    Args:
        travel: How far the joint centres move in a stretch; [m].
    """

    def __init__(self, travel: float) -> None:
        self._travel = travel
        self._way, self._last = 0.0, np.zeros((0, 0, 3))

    def __call__(self, centres: FloatArray) -> BoolArray:
        """Which rows of the next part to look at, shape (n,).

        Args:
            centres: Joint centres of the rows, shape (n, N + 1, 3); [m].
        """
        if self._travel == 0.0:
            return np.ones(len(centres), dtype=np.bool_)
        begin = self._last if len(self._last) else centres[:1]
        steps = np.linalg.norm(np.diff(centres, axis=0, prepend=begin), axis=2)
        ways = self._way + np.cumsum(steps.max(axis=1))
        marks = np.floor(np.append(self._way, ways) / self._travel)
        found = np.diff(marks) > 0.0
        found[0] |= not len(self._last)
        self._way, self._last = float(ways[-1]), centres[-1:]
        return np.asarray(found)


def _measured(
    robot: RobotModel,
    trajectory: Trajectory,
    scene: CoalScene,
    pairs: IntArray,
) -> CoalDistances:
    """Ask both about (waypoint, link, obstacle) triples, shape (m, 3)."""
    rows, row_of_pair = np.unique(pairs[:, 0], return_inverse=True)
    joints = trajectory.x0[rows], trajectory.alpha[rows], trajectory.theta[rows]
    poses = robot.link_poses(*joints)
    arm = robot.manipulator
    centres = arm.axes(joint_centres(arm, *joints))
    link, obstacle = pairs[:, 1], pairs[:, 2]
    ends = np.stack(
        [centres[row_of_pair, link], centres[row_of_pair, link + 1]], axis=1
    )
    bounds = row_brackets(scene.pieces, ends, obstacle, TOLERANCES.bracket_gap)
    bounds -= arm.axis_radii[link, None]
    transforms = capsule_transforms(robot, poses, row_of_pair, link)
    request = distance_request()
    distance = np.zeros(len(pairs))
    near, far = np.zeros((2, len(pairs), 3))
    for k, transform in enumerate(transforms):
        capsule = robot.capsules[link[k]]
        found = measure(request, capsule, transform, scene.bodies[obstacle[k]])
        distance[k], near[k], far[k] = found.distance, found.near, found.far
    return CoalDistances(
        pairs[:, 0], link, obstacle, distance, bounds[:, 0], bounds[:, 1], near, far
    )


def capsule_transforms(
    robot: RobotModel, poses: LinkPoses, row: IntArray, link: IntArray
) -> Iterator[Any]:
    """Coal's pose of a link's capsule for each (row, link), one after the other."""
    import coal

    on = np.minimum(link, robot.manipulator.n_links - 1)  # the tool is on the last one
    rotations = poses.rotations[row, on]
    local = robot.T_link_capsule[link]
    turned = rotations @ local[:, :3, :3]
    shifted = poses.origins[row, on] + np.einsum(
        "nij,nj->ni", rotations, local[:, :3, 3]
    )
    return (coal.Transform3s(R, p) for R, p in zip(turned, shifted, strict=True))


def _below_proof(
    found: CoalDistances, proved: ProvedLowers, pair: IntArray
) -> FloatArray:
    """By how much Coal falls below what was proved over the intervals at a row; [m]."""
    bound = proved.at(found.waypoint, pair)
    # Where bodies meet only the sign counts.
    return np.asarray(bound - np.maximum(found.distance, 0.0))
