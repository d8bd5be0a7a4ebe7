"""Coal's distances against the proof: a second opinion on every clearance.

It is compared with what is proved interval by interval. Coal proves nothing, so
agreement certifies no clearance, and a disagreement leaves the motion undecided. Of a
mesh that a link carries both measure the hulls around it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.brackets import ClearanceChunk, CoalRows
from vdsm_pin.verification.clearance import ClearanceProof
from vdsm_pin.verification.coal_arm import CoalArm, CoalDistances
from vdsm_pin.verification.judgement import guarded
from vdsm_pin.verification.records import Check, ClosestApproach, Verdict

COMPARED: Final = 2_000_000
"""Most proved bounds kept to hold Coal's distances against."""


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


class LowersSink:
    """Collects the proved bounds of the intervals, where they fit into memory."""

    def __init__(self, problem: PlanningProblem, trajectory: Trajectory) -> None:
        n_intervals = max(1, trajectory.n_samples - 1)
        columns = len(problem.scene.obstacles) * problem.manipulator.axis_radii.size
        self.fits = 0 < n_intervals * columns <= COMPARED
        self._parts: list[FloatArray] = []
        self._pairs, self._size = np.zeros(0, np.int64), 0

    def keep(self, chunk: ClearanceChunk) -> None:
        """Receive a chunk."""
        self._size += chunk.lower.size
        if self._size <= COMPARED and chunk.pairs is not None:
            self._parts.append(chunk.lower)
            self._pairs = chunk.pairs

    def proved(self, proof: ClearanceProof) -> ProvedLowers:
        """The bounds of the intervals, and of the whole motion for other pairs."""
        least = proof.least.lower
        column = np.full(len(least), -1)
        lower = np.zeros((1, 1))
        whole = (
            proof.sent == proof.motion.n_trajectory_intervals and self._size <= COMPARED
        )
        if self._pairs.size and whole:
            column[self._pairs] = np.arange(self._pairs.size)
            lower = np.concatenate(self._parts)
        return ProvedLowers(least, column, lower)


COAL: Final = "distances by Coal against the proved brackets"
"""Name of the row."""


@dataclass
class CoalEvidence:
    """Counts answers of Coal and remembers the one that disagrees the most.

    Args:
        count: How many there were.
        worst: The largest disagreement; [m].
        where: The two bodies and their distances, by Coal and proved, in words.
        moment: When the worst answer was measured, in waypoints.
    """

    count: int = 0
    worst: float = float("-inf")
    where: str = ""
    moment: float = float("nan")

    def add(self, excess: float, where: str, moment: float) -> None:
        """Remember an answer that disagrees more than all before."""
        if excess > self.worst:
            self.worst, self.where, self.moment = excess, where, moment

    def check(self, note: str = "") -> Check:
        """The row of evidence: undecided where the two disagree, or none answers."""
        agreed = self.count > 0 and self.worst <= TOLERANCES.coal_agreement
        return Check(
            name=COAL,
            verdict=Verdict.CERTIFIED if agreed else Verdict.UNDECIDED,
            count=self.count,
            worst=self.worst if self.count else float("nan"),
            limit=TOLERANCES.coal_agreement,
            unit="m",
            where=f"{self.where}{note}",
            moment=self.moment,
        )


class CoalLog:
    """What Coal is asked besides its rows, and all that it answers.

    Args:
        approaches: The closest approaches by their pairs' numbers, measured at their
            moments.
        enclosing: Names of the meshes that the arm is inside of; Coal measures to
            their surface alone, which is no clearance, so no distance is kept.
    """

    def __init__(
        self,
        approaches: Mapping[int, ClosestApproach] | None = None,
        enclosing: Sequence[str] = (),
    ) -> None:
        self.approaches, self._enclosing = dict(approaches or {}), tuple(enclosing)
        self._parts: list[tuple[IntArray, IntArray, FloatArray]] = []

    def answers(self, arm: CoalArm, trajectory: Trajectory) -> Iterator[CoalDistances]:
        """Coal's answers at the closest approaches."""
        for k, near in self.approaches.items():
            if near.pair.obstacle in self._enclosing:
                continue
            found = arm.measured(trajectory, np.array([near.moment]), np.array([k]))
            self.approaches[k] = replace(near, coal=float(found.distance[0]))
            if not np.isfinite(found.upper[0]):  # as the proof has it
                bracket = np.array([near.lower]), np.array([near.upper])
                found = replace(found, lower=bracket[0], upper=bracket[1])
            yield found

    def keep(self, arm: CoalArm, found: CoalDistances) -> None:
        """Receive distances at waypoints."""
        around = [
            arm.pairs.names.index(name, arm.pairs.n_own) for name in self._enclosing
        ]
        usable = np.where(np.isfinite(found.distance), found.distance, np.nan)
        wanted = ~np.isin(arm.pairs.other[found.pair], around)
        row = found.moment.astype(np.int64)
        self._parts.append((row[wanted], found.pair[wanted], usable[wanted]))

    def rows(self) -> CoalRows:
        """All distances at waypoints, in the order in which they came."""
        none = np.zeros(0, np.int64)
        parts = [*self._parts, (none, none, np.zeros(0))]
        waypoint, pair, distance = (
            np.concatenate(one) for one in zip(*parts, strict=True)
        )
        return CoalRows(
            frozen(waypoint, np.int64), frozen(pair, np.int64), frozen(distance)
        )


class CoalAnswer(NamedTuple):
    """Coal's row of evidence, and the distances that it told before it ended.

    Args:
        checks: The row, undecided where Coal failed or was not done in time.
        approaches: The closest approaches, with Coal's distance where it was measured.
        rows: Distances at waypoints.
    """

    checks: tuple[Check, ...]
    approaches: tuple[ClosestApproach, ...]
    rows: CoalRows


def ask_coal(
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers,
    approaches: Mapping[int, ClosestApproach],
    enclosing: Sequence[str],
    deadline: Deadline = NO_LIMIT,
) -> CoalAnswer:
    """What `check_coal` finds, and all distances until it returned or failed.

    `approaches` and `enclosing` are those of a `CoalLog`.
    """
    log = CoalLog(approaches, enclosing)
    checks = guarded(COAL, check_coal, problem, trajectory, proved, log, deadline)
    return CoalAnswer(checks, tuple(log.approaches.values()), log.rows())


def check_coal(
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers | None = None,
    log: CoalLog | None = None,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Check, ...]:
    """Hold Coal's distances of all pairs that are judged against our brackets.

    Measured are the closest approaches, links at every row where they are nearer than
    required and a link's radius past it, what is carried or moves at rows all over the
    motion, and every pair at least once.

    Args:
        problem: The arm and the scene.
        trajectory: What is judged.
        proved: Proved lower bounds; Coal must not fall below them at either end of an
            interval; None for the brackets of the rows alone.
        log: Asks for the closest approaches too, and keeps every answer.
        deadline: When to give up.

    Returns:
        One row of evidence with the largest disagreement; none where there is no pair.

    Raises:
        OutOfTime: If the time is over.
        VerificationFailed: If Coal refuses a shape.
    """
    arm, evidence = CoalArm(problem, deadline), CoalEvidence()
    log = log or CoalLog()
    if not arm.pairs.one.size:
        return ()
    room, travel = problem.manipulator.most_radius, TOLERANCES.coal_travel
    rows = chain(
        arm.near(trajectory, room, travel, deadline), arm.spread(trajectory, deadline)
    )
    for found in chain(log.answers(arm, trajectory), _kept(rows, arm, proved, log)):
        # A distance is NaN for a flat hull, which Coal cannot take: not compared.
        silent, excess = np.isnan(found.distance), found.disagreement
        excess[np.isnan(excess)] = np.inf
        excess[silent] = -np.inf
        evidence.count += int((~silent).sum())
        k = int(np.argmax(excess))
        evidence.add(float(excess[k]), _words(arm, found, k), float(found.moment[k]))
    total = arm.pairs.one.size * trajectory.n_samples
    note = f"; {evidence.count} of {total} pairs measured{arm.untold}"
    if proved is None:
        note += "; against brackets of the rows alone"
    return (evidence.check(note),)


def _kept(
    rows: Iterator[CoalDistances],
    arm: CoalArm,
    proved: ProvedLowers | None,
    log: CoalLog,
) -> Iterator[CoalDistances]:
    """Distances at rows, kept, and with the proved bounds of the intervals beside."""
    for found in rows:
        log.keep(arm, found)
        if proved is not None:
            row = found.moment.astype(np.int64)
            lower = proved.at(row, found.pair)
            yield replace(found, lower=np.maximum(found.lower, lower))
        else:
            yield found


def _words(arm: CoalArm, found: CoalDistances, k: int) -> str:
    """Which bodies one answer is about, what Coal says and what the bracket."""
    distance, lower, upper = (
        float(one[k]) * MM_PER_M for one in (found.distance, found.lower, found.upper)
    )
    ours = f"{lower:.6f}" if lower == upper else f"[{lower:.6f}, {upper:.6f}]"
    both = " and ".join(arm.pairs.named(found.pair[k]))
    return f"{both}: Coal {distance:.6f} mm, proved {ours} mm"
