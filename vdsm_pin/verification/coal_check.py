"""Coal's distances against the proof: a second opinion on every clearance.

Coal proves nothing, so agreement certifies no clearance, and a disagreement leaves the
motion undecided.
"""

from collections.abc import Collection, Iterator
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
    Partners,
    coal_reach,
    links_farther_out,
    obstacles_at_rest,
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
"""What Coal measured, at which moments in waypoints, and how far each distance lies
outside its bracket [m]; the arrays have shape (m,)."""


@dataclass
class Evidence:
    """Counts answers of Coal and remembers the one that disagrees the most.

    Args:
        name: Of the row.
        count: How many there were.
        worst: The largest disagreement; [m].
        where: The two bodies and their distances, by Coal and proved, in words.
        moment: When the worst answer was measured, in waypoints.
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


@dataclass(frozen=True)
class _Asked:
    """Distances that Coal is asked for, and what they are held against.

    Args:
        partners: Of links and tool.
        numbers: Of the pairs, as they are judged; below 0 where they are not, shape
            (n_axes, n_partners).
        near: Names of the obstacles of closest approaches among them.
        reach: Pairs are measured within it; [m].
        travel: How far the arm moves from a row that is looked at to the next; [m].
        proved: Proved lower bounds; Coal must not fall below them at either end of an
            interval; None for the brackets of the rows alone.
        against: Where the brackets come from.
    """

    partners: Partners
    numbers: IntArray
    near: Collection[str]
    reach: float
    travel: float
    proved: ProvedLowers | None
    against: str


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
    still = [not isinstance(one, Moving) for one in problem.scene.obstacles]
    if not any(still):
        return ()
    numbers = ArmPairs(problem).number[:, still]
    if not all(still):  # else with what the problem keeps packed
        problem = replace(problem, scene=problem.scene.at_rest)
    asked = _Asked(
        partners=obstacles_at_rest(robot, problem, deadline),
        numbers=numbers,
        near=problem.scene.names,
        reach=coal_reach(problem),
        travel=TOLERANCES.coal_travel,
        proved=proved,
        against="proved",
    )
    note = "" if proved is not None else "; against brackets of the rows alone"
    return _check(Evidence(OBSTACLES), asked, trajectory, deadline, log, note)


def check_coal_links(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    deadline: Deadline = NO_LIMIT,
    log: CoalLog | None = None,
) -> tuple[Check, ...]:
    """Hold Coal's distances between links two or more apart against the closed form.

    Measured are the pairs nearer than the required self-clearance and a link's radius
    past it, and every pair where it is nearest. Arguments, result and errors are those
    of `check_coal_obstacles`; of an arm of two links there is no row.
    """
    asked = _Asked(
        partners=links_farther_out(robot),
        numbers=_numbers_of_links(problem),
        near=BETWEEN_LINKS,
        reach=problem.required_self_clearance + robot.manipulator.most_radius,
        travel=0.0,
        proved=None,
        against="closed form",
    )
    return _check(Evidence(LINKS), asked, trajectory, deadline, log)


def _check(
    evidence: Evidence,
    asked: _Asked,
    trajectory: Trajectory,
    deadline: Deadline,
    log: CoalLog | None,
    note: str = "",
) -> tuple[Check, ...]:
    """The row of evidence; none where there is no pair."""
    n_pairs = int(asked.partners.apart.sum())
    if not n_pairs:
        return ()
    for found, moments, beyond in _answers(asked, trajectory, deadline, log):
        # Where there is no number the two do not agree.
        excess = np.where(np.isnan(beyond), np.inf, beyond)
        evidence.count += excess.size
        k = int(np.argmax(excess))
        evidence.add(float(excess[k]), _words(asked, found, k), float(moments[k]))
    total = n_pairs * trajectory.n_samples
    note = f"; {evidence.count} of {total} pairs within reach measured{note}"
    return (evidence.check(note),)


def _words(asked: _Asked, found: CoalDistances, k: int) -> str:
    """Which bodies one answer is about, what Coal says and what the bracket."""
    distance, lower, upper = (
        float(one[k]) * MM_PER_M for one in (found.distance, found.lower, found.upper)
    )
    ours = f"{lower:.6f}" if lower == upper else f"[{lower:.6f}, {upper:.6f}]"
    links = asked.partners.robot.manipulator.axis_names
    both = f"{links[found.link[k]]} and {asked.partners.names[found.other[k]]}"
    return f"{both}: Coal {distance:.6f} mm, {asked.against} {ours} mm"


def _answers(
    asked: _Asked, trajectory: Trajectory, deadline: Deadline, log: CoalLog | None
) -> Iterator[Answer]:
    """Coal's answers: those at the closest approaches first, then those at rows."""
    partners, axes = asked.partners, asked.partners.robot.manipulator.axis_names
    if log is not None and (near := log.asked(asked.near)).size:
        approaches = [log.approaches[k] for k in near]
        pairs = [
            (k, axes.index(one.pair.own), partners.names.index(one.pair.label))
            for k, one in enumerate(approaches)
        ]
        moments = np.array([one.moment for one in approaches])
        found = partners.measured(trajectory.at(moments), np.array(pairs))
        log.keep_approaches(near, found.distance)
        yield found, moments, found.disagreement
    for found in partners.distances(trajectory, asked.reach, asked.travel, deadline):
        excess, pair = found.disagreement, asked.numbers[found.link, found.other]
        judged = pair >= 0
        if log is not None:
            log.keep(found.waypoint[judged], pair[judged], found.distance[judged])
        if asked.proved is not None:
            # Where bodies meet only the sign counts.
            lower = asked.proved.at(found.waypoint[judged], pair[judged])
            below = lower - np.maximum(found.distance[judged], 0.0)
            excess = excess.copy()
            excess[judged] = np.maximum(excess[judged], below)
        yield found, found.waypoint.astype(np.float64), excess


def _numbers_of_links(problem: PlanningProblem) -> IntArray:
    """Numbers of the pairs of axes, as they are judged; below 0 where they are not."""
    table, n_axes = ArmPairs(problem), problem.manipulator.axis_radii.size
    numbers = np.full((n_axes, n_axes), -1)
    for number, (one, other) in enumerate(table.between.held, start=len(table.outer)):
        if max(one, other) < n_axes:
            numbers[[one, other], [other, one]] = number
    return numbers
