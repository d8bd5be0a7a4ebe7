"""Coal's distances of feed, carried bodies and moving obstacles, against the proof.

Poses come from Pinocchio and shapes from the problem. A mesh is proved clear by hulls
around it, which are nearer than its triangles: there Coal can contradict the lower
bound alone.
"""

from collections.abc import Iterator, Mapping
from math import inf
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.coal_arm import arm_poses, arm_shapes
from vdsm_pin.verification.coal_check import Evidence
from vdsm_pin.verification.coal_log import CoalLog
from vdsm_pin.verification.coal_shapes import CoalShapes, Sides, disagreement
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


class _Bodies(NamedTuple):
    """Two bodies along a motion.

    Args:
        robot: The arm in Pinocchio and Coal.
        scene: The obstacles.
        trajectory: The motion.
        shapes: Of all bodies.
        one: Number of the first body.
        other: Of the other one.
    """

    robot: RobotModel
    scene: Scene
    trajectory: Trajectory
    shapes: CoalShapes
    one: int
    other: int

    def distances(self, moments: FloatArray) -> FloatArray:
        """Coal's distances at moments in waypoints, shape (m,); [m]."""
        rows, times = self.trajectory.at(moments), self.trajectory.times_at(moments)
        moving = [] if times is None else [m.poses(times) for m in self.scene.moving]
        poses = arm_poses(self.robot, (rows.x0, rows.alpha, rows.theta), moving)
        one, other = np.full((2, moments.size), [[self.one], [self.other]])
        sides = Sides(np.arange(moments.size), one, other)
        return self.shapes.distances(poses, sides).distance


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
    bodies = problem.manipulator.carried, problem.scene.obstacles
    shapes, number = arm_shapes(robot, *bodies, deadline)
    evidence = Evidence(CARRIED)
    meshes = tuple(
        b.name for b in problem.manipulator.bodies if isinstance(b.solid, Mesh)
    )
    for names in groups:
        deadline.check()
        numbers = (number[name] for name in names)
        both = _Bodies(robot, problem.scene, trajectory, shapes, *numbers)
        rows = _at_rows(both, proved, groups[names])
        near = _at_approaches(both, log, names, meshes)
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


def _at_rows(
    both: _Bodies, proved: ProvedLowers, numbers: IntArray
) -> Iterator[tuple[float, float, float]]:
    """Moment, distance and excess at rows all over the motion."""
    steps = np.linspace(0, both.trajectory.n_samples - 1, ROWS)
    rows = np.unique(steps.astype(np.int64))
    found = both.distances(rows.astype(np.float64))
    for row, distance in zip(rows, found, strict=True):
        waypoint = np.full(numbers.size, row)
        lower = proved.at(waypoint, numbers).min()
        yield float(row), distance, float(lower - max(distance, 0.0))


def _at_approaches(
    both: _Bodies, log: CoalLog, names: Names, meshes: tuple[str, ...]
) -> Iterator[tuple[float, float, float]]:
    """The same where the two come nearest, upper bounds included."""
    for k, near in enumerate(log.approaches):
        if (near.pair.own, near.pair.label) != names or names[1] in log.enclosing:
            continue
        found = both.distances(np.array([near.moment]))
        log.keep_approaches(np.array([k]), found)
        upper = inf if set(names) & set(meshes) else near.upper
        excess = disagreement(found, np.array([near.lower]), np.array([upper]))
        yield near.moment, float(found[0]), float(excess[0])
