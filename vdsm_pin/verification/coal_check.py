"""Coal's distances against the proof: a second opinion on every clearance.

Coal proves nothing, so agreement certifies no clearance, and a disagreement leaves the
motion undecided.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.coal_distances import (
    CoalDistances,
    CoalScene,
    against_obstacles,
    between_links,
    coal_distances,
    link_distances,
    reach_of,
)
from vdsm_pin.verification.coal_log import BETWEEN_LINKS, CoalLog
from vdsm_pin.verification.proved_lowers import ProvedLowers
from vdsm_pin.verification.records import Check, Verdict
from vdsm_pin.verification.robot_model import RobotModel
from vdsm_pin.verification.task import ArmPairs

OBSTACLES: Final = "distances by Coal against the proved brackets"
"""Name of the row of obstacles at rest."""

LINKS: Final = "distances between links by Coal against the closed form"
"""Name of the row of the links."""


Answer = tuple[CoalDistances, FloatArray, FloatArray]
"""What Coal measured, when (in waypoints) and how far it is off, shape (m,) each."""


@dataclass
class Evidence:
    """Counts answers of Coal and remembers the one that disagrees the most.

    Args:
        name: Of the row.
        count: How many there were.
        worst: The largest disagreement; [m].
        where: Which bodies these are, and what Coal says.
        moment: In waypoints.
    """

    name: str
    count: int = 0
    worst: float = float("-inf")
    where: str = ""
    moment: float = float("nan")

    def add(self, excess: float, where: str, moment: float) -> None:
        """Remember an answer that disagrees more than all before."""
        if excess > self.worst:
            self.worst, self.where, self.moment = excess, where, moment

    def check(self, note: str = "") -> Check:
        """The row of evidence: undecided where the two disagree."""
        agreed = self.worst <= TOLERANCES.coal_agreement
        return Check(
            name=self.name,
            verdict=Verdict.CERTIFIED if agreed else Verdict.UNDECIDED,
            count=self.count,
            worst=self.worst,
            limit=TOLERANCES.coal_agreement,
            unit="m",
            where=f"{self.where}{note}",
            moment=self.moment,
        )


def check_coal_obstacles(
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
    evidence = Evidence(OBSTACLES)
    answers = _of_obstacles(robot, problem, trajectory, proved, deadline, log)
    for answer in answers:
        _add(evidence, answer, names, scene.names, "proved")
    total = trajectory.n_samples * len(names) * len(scene.obstacles)
    alone = "" if proved is not None else "; against brackets of the rows alone"
    note = f"; {evidence.count} of {total} pairs within reach measured{alone}"
    return (evidence.check(note),)


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
    evidence = Evidence(LINKS)
    for answer in _of_links(robot, problem, trajectory, deadline, log):
        _add(evidence, answer, names, names, "closed form")
    total = n_pairs * trajectory.n_samples
    note = f"; {evidence.count} of {total} pairs within reach measured"
    return (evidence.check(note),)


def _add(
    evidence: Evidence,
    answer: Answer,
    links: Sequence[str],
    others: Sequence[str],
    against: str,
) -> None:
    """Add many answers; where there is no number the two do not agree."""
    found, moments, excess = answer
    excess = np.where(np.isnan(excess), np.inf, excess)
    evidence.count += excess.size
    k = int(np.argmax(excess))
    distance, lower, upper = (
        float(one[k]) * MM_PER_M for one in (found.distance, found.lower, found.upper)
    )
    ours = f"{lower:.6f}" if lower == upper else f"[{lower:.6f}, {upper:.6f}]"
    both = f"{links[found.link[k]]} and {others[found.other[k]]}"
    where = f"{both}: Coal {distance:.6f} mm, {against} {ours} mm"
    evidence.add(float(excess[k]), where, float(moments[k]))


def _of_obstacles(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers | None,
    deadline: Deadline,
    log: CoalLog | None,
) -> Iterator[Answer]:
    still = np.array([not isinstance(o, Moving) for o in problem.scene.obstacles])
    numbers = ArmPairs(problem).number[:, still]
    if not still.all():
        problem = replace(problem, scene=problem.scene.at_rest)
    scene, names = CoalScene.of(robot, problem, deadline), problem.scene.names
    if log is not None and (near := log.asked(names)).size:
        axes = problem.manipulator.axis_names
        pairs = [
            (k, axes.index(one.own), names.index(one.obstacle))
            for k, one in enumerate(log.approaches[n].pair for n in near)
        ]
        rows, moments = _at_approaches(trajectory, log, near)
        found = against_obstacles(robot, rows, scene, np.array(pairs))
        log.keep_approaches(near, found.distance)
        yield found, moments, found.disagreement
    reach, travel = reach_of(problem), TOLERANCES.coal_travel
    for found in coal_distances(
        robot, problem, trajectory, reach, travel, deadline, scene
    ):
        excess, pair = found.disagreement, numbers[found.link, found.other]
        if log is not None:
            _keep(log, found, pair)
        if proved is not None:
            # Where bodies meet only the sign counts.
            below = proved.at(found.waypoint, pair) - np.maximum(found.distance, 0.0)
            excess = np.maximum(excess, np.where(pair >= 0, below, -np.inf))
        yield found, found.waypoint.astype(np.float64), excess


def _of_links(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    deadline: Deadline,
    log: CoalLog | None,
) -> Iterator[Answer]:
    axes = problem.manipulator.axis_names
    if log is not None and (near := log.asked(BETWEEN_LINKS)).size:
        pairs = [
            (k, *sorted((axes.index(one.own), axes.index(one.label))))
            for k, one in enumerate(log.approaches[n].pair for n in near)
        ]
        rows, moments = _at_approaches(trajectory, log, near)
        found = between_links(robot, rows, np.array(pairs))
        log.keep_approaches(near, found.distance)
        yield found, moments, found.disagreement
    reach = problem.required_self_clearance + robot.manipulator.most_radius
    numbers = _numbers_of_links(problem)
    for found in link_distances(robot, trajectory, reach, deadline):
        if log is not None:
            _keep(log, found, numbers[found.link, found.other])
        yield found, found.waypoint.astype(np.float64), found.disagreement


def _at_approaches(
    trajectory: Trajectory, log: CoalLog, numbers: IntArray
) -> tuple[Trajectory, FloatArray]:
    """Configurations at some closest approaches, and their moments, shape (m,)."""
    moments = np.array([log.approaches[k].moment for k in numbers])
    return trajectory.at(moments), moments


def _keep(log: CoalLog, found: CoalDistances, pair: IntArray) -> None:
    """Keep the distances of the pairs that are judged."""
    held = pair >= 0
    log.keep(found.waypoint[held], pair[held], found.distance[held])


def _numbers_of_links(problem: PlanningProblem) -> IntArray:
    """Numbers of the pairs of axes, as they are judged; below 0 where they are not."""
    table, n_axes = ArmPairs(problem), problem.manipulator.axis_radii.size
    numbers = np.full((n_axes, n_axes), -1)
    for number, (one, other) in enumerate(table.between.held, start=len(table.outer)):
        if max(one, other) < n_axes:
            numbers[[one, other], [other, one]] = number
    return numbers
