"""Coal's distances of feed, carried bodies and moving obstacles, against the proof.

Poses come from Pinocchio and shapes from the problem. A mesh is proved clear by hulls
around it, which are nearer than its triangles: there Coal can contradict the lower
bound alone.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving, solid_of
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.coal_bodies import (
    CoalBody,
    CoalCloud,
    CoalObstacle,
    coal_bodies,
    distance_request,
    measure,
)
from vdsm_pin.verification.coal_check import Evidence
from vdsm_pin.verification.coal_log import CoalLog
from vdsm_pin.verification.proved_lowers import ProvedLowers
from vdsm_pin.verification.records import Check, Pair
from vdsm_pin.verification.robot_model import RobotModel

CARRIED: Final = (
    "distances of feed, carried and moving bodies by Coal against the proof"
)
"""Name of the row."""

ROWS: Final = 32
"""Rows at which each pair is measured, evenly over the motion."""

Names = tuple[str, str]


@dataclass(frozen=True)
class _Rider:
    """What rides on a link or moves by itself, as Coal has it.

    Args:
        link: 1 to N, 0 for the feed's frame, -1 for the base.
        parts: In the frame of the link, or of what moves.
        moving: The obstacle that it is, if it moves.
    """

    link: int
    parts: CoalObstacle
    moving: Moving | None = None


def check_coal_carried(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers,
    log: CoalLog,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Check, ...]:
    """Hold Coal's distances of feed, carried and moving bodies against the proof.

    Args:
        robot: The arm in Pinocchio and Coal.
        problem: The arm and the scene.
        trajectory: What is judged.
        proved: Proved lower bounds of the intervals.
        log: Has the pairs and the closest approaches, and keeps every answer.
        deadline: When to give up.

    Returns:
        One row of evidence with the largest disagreement; none without such bodies.

    Raises:
        OutOfTime: If the time is over.
    """
    groups = _groups(problem, log.pairs)
    if not groups:
        return ()
    riders = _riders(robot, problem)
    evidence = Evidence(CARRIED)
    meshes = tuple(
        b.name for b in problem.manipulator.bodies if isinstance(b.solid, Mesh)
    )
    for names in groups:
        deadline.check()
        both = riders[names[0]], riders[names[1]]
        rows = _at_rows(robot, trajectory, both, proved, groups[names])
        near = _at_approaches(robot, trajectory, both, log, names, meshes)
        for moment, distance, excess in (*rows, *near):
            where = f"{' and '.join(names)}: Coal {distance * MM_PER_M:.6f} mm"
            evidence.count += 1
            evidence.add(excess, where, moment)
    return (evidence.check(),)


def _groups(
    problem: PlanningProblem, pairs: tuple[Pair, ...]
) -> Mapping[Names, IntArray]:
    """Numbers of the pairs of each two bodies, parts of one taken together."""
    arm, found = problem.manipulator, dict[Names, list[int]]()
    carried = {solid.name for _, solid in arm.carried}
    moving = {one.name for one in problem.scene.moving}
    for number, pair in enumerate(pairs):
        other = arm.owner_of(pair.other_body)
        names = arm.owner_of(pair.own), pair.obstacle or other or pair.label
        if carried & {names[0], other} or pair.obstacle in moving:
            found.setdefault(names, []).append(number)
    return {names: np.array(numbers) for names, numbers in found.items()}


def _riders(robot: RobotModel, problem: PlanningProblem) -> dict[str, _Rider]:
    """Every body and obstacle by its name."""
    import coal

    arm, found = problem.manipulator, dict[str, _Rider]()
    for obstacle in problem.scene.obstacles:
        moving = obstacle if isinstance(obstacle, Moving) else None
        parts = coal_bodies(solid_of(obstacle))
        found[obstacle.name] = _Rider(-1, parts, moving)
    for k, name in enumerate(arm.axis_names):
        local = robot.T_link_capsule[k]
        pose = coal.Transform3s(local[:3, :3].copy(), local[:3, 3].copy())
        rod = CoalBody(robot.capsules[k], pose)
        found[name] = _Rider(min(k + 1, arm.n_links), (rod,))
    for link, solid in arm.carried:
        found[solid.name] = _Rider(link, coal_bodies(solid))
    return found


def _at_rows(
    robot: RobotModel,
    trajectory: Trajectory,
    both: tuple[_Rider, _Rider],
    proved: ProvedLowers,
    numbers: IntArray,
) -> Iterator[tuple[float, float, float]]:
    """Moment, distance and excess at rows all over the motion."""
    steps = np.linspace(0, trajectory.n_samples - 1, ROWS)
    rows = np.unique(steps.astype(np.int64))
    found = _distances(robot, trajectory, both, rows.astype(np.float64))
    for row, distance in zip(rows, found, strict=True):
        waypoint = np.full(numbers.size, row)
        lower = proved.at(waypoint, numbers).min()
        yield float(row), distance, float(lower - max(distance, 0.0))


def _at_approaches(
    robot: RobotModel,
    trajectory: Trajectory,
    both: tuple[_Rider, _Rider],
    log: CoalLog,
    names: Names,
    meshes: tuple[str, ...],
) -> Iterator[tuple[float, float, float]]:
    """The same where the two come nearest, upper bounds included."""
    for k, near in enumerate(log.approaches):
        if (near.pair.own, near.pair.label) != names or names[1] in log.around:
            continue
        moments = np.array([near.moment])
        distance = float(_distances(robot, trajectory, both, moments)[0])
        log.keep_approaches(np.array([k]), np.array([distance]))
        value, excess = max(distance, 0.0), near.lower - max(distance, 0.0)
        if not set(names) & set(meshes):
            excess = max(excess, value - max(near.upper, 0.0))
        yield near.moment, distance, excess


def _distances(
    robot: RobotModel,
    trajectory: Trajectory,
    both: tuple[_Rider, _Rider],
    moments: FloatArray,
) -> FloatArray:
    """Coal's distances at moments in waypoints, shape (m,); [m]."""
    found, request = np.full(moments.size, np.inf), distance_request()
    mine, theirs = (_frames(robot, trajectory, one, moments) for one in both)
    own = both[0].parts
    assert not isinstance(own, CoalCloud)  # an obstacle is the other one
    for row, (frame, other) in enumerate(zip(mine, theirs, strict=True)):
        # The other one rests: a cloud has no pose.
        seen = other.inverse() * frame
        for part in own:
            pose = seen * part.pose
            answer = measure(request, part.geometry, pose, both[1].parts)
            found[row] = min(found[row], answer.distance)
    return found


def _frames(
    robot: RobotModel, trajectory: Trajectory, rider: _Rider, moments: FloatArray
) -> list[Any]:
    """Coal's poses of what carries a rider, at moments in waypoints."""
    import coal

    if rider.moving is not None:
        times = trajectory.times_at(moments)
        assert times is not None  # whoever judges beside what moves has them
        poses = rider.moving.poses(times)
        return [coal.Transform3s(p[:3, :3].copy(), p[:3, 3].copy()) for p in poses]
    if rider.link < 0:
        return [coal.Transform3s.Identity()] * moments.size
    rows = trajectory.at(moments)
    found = robot.link_poses(rows.x0, rows.alpha, rows.theta)
    origins = found.origins[:, max(0, rider.link - 1)]
    turned = found.rotations[:, rider.link - 1]
    if not rider.link:
        turned = np.tile(np.eye(3), (moments.size, 1, 1))
    return [coal.Transform3s(R, p) for R, p in zip(turned, origins, strict=True)]
