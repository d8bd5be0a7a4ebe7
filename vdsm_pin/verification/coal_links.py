"""Coal's distances between the links themselves, against the closed form.

Both bodies are capsules, for which Coal has a closed form too. Poses come from
Pinocchio on one side and from the closed-form kinematics on the other.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.row_bounds import link_gaps
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.coal_bodies import CoalBody, distance_request, measure
from vdsm_pin.verification.coal_clearance import capsule_transforms, in_turns
from vdsm_pin.verification.coal_log import BETWEEN_LINKS, CoalLog
from vdsm_pin.verification.records import Check, Verdict
from vdsm_pin.verification.robot_model import RobotModel
from vdsm_pin.verification.task import ArmPairs

CHUNK_GAPS: Final = 1 << 20
"""Gaps held in memory at a time: rows times links times links."""


@dataclass(frozen=True)
class LinkDistances:
    """Measured distances between links, with the closed form beside them.

    Args:
        waypoint: Row of the trajectory, from 0, shape (m,).
        link: The link nearer to the base, from 0, shape (m,).
        other: The link farther out, from 0, shape (m,).
        distance: By Coal; -inf where its answer is unusable, shape (m,); [m].
        expected: In closed form, shape (m,); [m].
    """

    waypoint: IntArray
    link: IntArray
    other: IntArray
    distance: FloatArray
    expected: FloatArray

    @property
    def disagreement(self) -> FloatArray:
        """How far the two differ, inf if unusable; where links meet only the sign."""
        difference = np.abs(
            np.maximum(self.distance, 0.0) - np.maximum(self.expected, 0.0)
        )
        return np.where(np.isfinite(self.distance), difference, np.inf)


NAME: Final = "distances between links by Coal against the closed form"
"""Name of the row."""


def check_coal_links(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    deadline: Deadline = NO_LIMIT,
    log: CoalLog | None = None,
) -> tuple[Check, ...]:
    """Hold Coal's distances between links two or more apart against the closed form.

    Args:
        robot: The arm in Pinocchio and Coal.
        problem: Names the arm and the required self-clearance.
        trajectory: What is judged.
        deadline: When to give up.
        log: Asks for the closest approaches too, and keeps every answer.

    Returns:
        One row of evidence with the largest disagreement; none for an arm of two links.
        Measured are the pairs nearer than the required self-clearance and a link's
        radius past it, and every pair where it is nearest.

    Raises:
        OutOfTime: If the time is over.
    """
    names = problem.manipulator.axis_names
    n_pairs = (len(names) - 1) * (len(names) - 2) // 2
    if n_pairs == 0:
        return ()
    count, worst, where, moment = 0, -np.inf, "", float("nan")
    for found, moments in _answers(robot, problem, trajectory, deadline, log):
        excess = np.where(np.isnan(found.disagreement), np.inf, found.disagreement)
        count += excess.size
        k = int(np.argmax(excess))
        if excess[k] > worst:
            worst, moment = float(excess[k]), float(moments[k])
            where = (
                f"{names[found.link[k]]} and {names[found.other[k]]}: "
                f"Coal {found.distance[k] * MM_PER_M:.6f} mm, "
                f"closed form {found.expected[k] * MM_PER_M:.6f} mm"
            )
    agreed = worst <= TOLERANCES.coal_agreement
    check = Check(
        name=NAME,
        verdict=Verdict.CERTIFIED if agreed else Verdict.UNDECIDED,
        count=count,
        worst=worst,
        limit=TOLERANCES.coal_agreement,
        unit="m",
        where=f"{where}; {count} of {n_pairs * trajectory.n_samples} pairs within "
        "reach measured",
        moment=moment,
    )
    return (check,)


def _answers(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    deadline: Deadline,
    log: CoalLog | None,
) -> Iterator[tuple[LinkDistances, FloatArray]]:
    """What Coal measures, and when, in waypoints, shape (m,)."""
    if log is not None:
        near = log.asked(BETWEEN_LINKS)
        if near.size:
            found, moments = _at_approaches(robot, trajectory, log)
            log.keep_approaches(near, found.distance)
            yield found, moments
    reach = problem.required_self_clearance + robot.manipulator.most_radius
    numbers = _pair_numbers(problem)
    for found in link_distances(robot, trajectory, reach, deadline):
        pair = numbers[found.link, found.other]
        if log is not None:
            held = pair >= 0
            log.keep(found.waypoint[held], pair[held], found.distance[held])
        yield found, found.waypoint.astype(np.float64)


def _pair_numbers(problem: PlanningProblem) -> IntArray:
    """Numbers of the pairs of axes, as they are judged; below 0 where they are not."""
    table, n_axes = ArmPairs(problem), problem.manipulator.axis_radii.size
    numbers = np.full((n_axes, n_axes), -1)
    for number, (one, other) in enumerate(table.between.held, start=len(table.outer)):
        if max(one, other) < n_axes:
            numbers[[one, other], [other, one]] = number
    return numbers


def _at_approaches(
    robot: RobotModel, trajectory: Trajectory, log: CoalLog
) -> tuple[LinkDistances, FloatArray]:
    """Distances at the closest approaches of links, and their moments, (m,)."""
    arm = robot.manipulator
    near = [log.approaches[k] for k in log.asked(BETWEEN_LINKS)]
    moments, names = np.array([one.moment for one in near]), arm.axis_names
    pairs = np.array(
        [
            (k, *sorted((names.index(one.pair.own), names.index(one.pair.label))))
            for k, one in enumerate(near)
        ]
    )
    rows = trajectory.at(moments)
    centres = joint_centres(arm, rows.x0, rows.alpha, rows.theta)
    gaps = link_gaps(np.ascontiguousarray(arm.axes(centres)), arm.axis_radii)
    return _measured(robot, rows, pairs, gaps[tuple(pairs.T)]), moments


def link_distances(
    robot: RobotModel,
    trajectory: Trajectory,
    reach: float,
    deadline: Deadline = NO_LIMIT,
) -> Iterator[LinkDistances]:
    """Measure the pairs of links within reach, then every pair not yet seen.

    Args:
        robot: The arm in Pinocchio and Coal.
        trajectory: The rows.
        reach: Measure where the closed form is at most this; inf for everything; [m].
        deadline: When to give up.

    Yields:
        Distances in the order of the rows; last the pairs that never came within
        reach, each at the row where it is nearest.

    Raises:
        OutOfTime: If the time is over.
    """
    arm = robot.manipulator
    n_axes = arm.axis_radii.size
    least = np.full((n_axes, n_axes), np.inf)
    nearest = np.zeros(least.shape, dtype=np.int64)
    apart = np.triu(np.ones(least.shape, dtype=bool), k=2)
    step = max(1, CHUNK_GAPS // least.size)
    for first in range(0, trajectory.n_samples, step):
        deadline.check()
        part = slice(first, first + step)
        joints = trajectory.x0[part], trajectory.alpha[part], trajectory.theta[part]
        centres = np.ascontiguousarray(arm.axes(joint_centres(arm, *joints)))
        gaps = link_gaps(centres, arm.axis_radii)
        here = np.argmin(gaps, axis=0)
        value = np.take_along_axis(gaps, here[None], axis=0)[0]
        nearer = value < least
        least[nearer], nearest[nearer] = value[nearer], here[nearer] + first
        close = np.argwhere((gaps <= reach) & apart)
        for some in in_turns(close, deadline):
            expected = gaps[tuple(some.T)]
            some[:, 0] += first
            yield _measured(robot, trajectory, some, expected)
    unseen = np.argwhere((least > reach) & apart)
    if unseen.size:
        rows = nearest[tuple(unseen.T)]
        pairs = np.column_stack([rows, unseen])
        yield _measured(robot, trajectory, pairs, least[tuple(unseen.T)])


def _measured(
    robot: RobotModel, trajectory: Trajectory, pairs: IntArray, expected: FloatArray
) -> LinkDistances:
    """Ask Coal about (waypoint, link, other link) triples, shape (m, 3)."""
    rows, place = np.unique(pairs[:, 0], return_inverse=True)
    poses = robot.link_poses(
        trajectory.x0[rows], trajectory.alpha[rows], trajectory.theta[rows]
    )
    link, other = pairs[:, 1], pairs[:, 2]
    request, distance = distance_request(), np.zeros(len(pairs))
    both = zip(
        capsule_transforms(robot, poses, place, link),
        capsule_transforms(robot, poses, place, other),
        strict=True,
    )
    for k, (mine, its) in enumerate(both):
        partner = CoalBody(robot.capsules[other[k]], its)
        found = measure(request, robot.capsules[link[k]], mine, (partner,))
        distance[k] = found.distance
    return LinkDistances(pairs[:, 0], link, other, distance, expected)
