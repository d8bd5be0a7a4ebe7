"""The clearances of a motion judged, of an arm's or a robot's, meshes as solids.

Besides: the pairs that come nearest, and the policy for errors and time limits:

* A check that raises is an undecided row (`guarded`). Of an arithmetic error, which is
  a fault of this package, the traceback is logged too.
* Another result that is not there in time is left out, with a note (`BestEffort`).
* What takes a deadline and need not raise, as `located`, returns what it has proved.
* Anything else that is raised ends the verification: there is no result.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import nan
from typing import Final, TypeVar, TypeVarTuple

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import OutOfTime, VdsmError
from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.problem.any_problem import AnyMotion, AnyProblem
from vdsm_pin.problem.error_boxes import NO_ERRORS
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.progress import step
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.terms import REFUTED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.brackets import ClearanceProfile, LeastClearances
from vdsm_pin.verification.clearance import ClearanceProof
from vdsm_pin.verification.clearance_check import Evidence, clearance_checks
from vdsm_pin.verification.enclosed import (
    Inside,
    enclosed_checks,
    enclosed_least,
    enclosed_profile,
    pairs_inside,
)
from vdsm_pin.verification.first_contact import FirstContact, contacts_of
from vdsm_pin.verification.inside import Places, check_inside, is_outside, located
from vdsm_pin.verification.records import (
    Check,
    ClosestApproach,
    Counterexample,
    Pair,
    Verdict,
    is_deepest,
)

LOG: Final = logging.getLogger(__name__)

T = TypeVar("T")
A = TypeVarTuple("A")


class BestEffort:
    """Results besides the checks, as far as the time allows them.

    Attributes:
        not_done: What the time did not allow, and why, one entry each.
    """

    def __init__(self) -> None:
        self.not_done: list[str] = []

    def take(self, name: str, otherwise: T, run: Callable[[*A], T], *args: *A) -> T:
        """What `run` returns, or `otherwise` and a note if it raises `OutOfTime`.

        Args:
            name: What is worked out, for the note and the progress bar.
            otherwise: What stands for the result if the time is over.
            run: Works it out.
            args: What it is given.
        """
        step("%s", name)
        try:
            return run(*args)
        except OutOfTime as error:
            self.not_done.append(f"{name}: {error}")
            return otherwise

    def note(self, name: str, deadline: Deadline) -> None:
        """Note that the time did not allow a result."""
        self.not_done.append(f"{name}: {OutOfTime(deadline.limit)}")


def guarded(
    name: str, run: Callable[[*A], Check | tuple[Check, ...]], *args: *A
) -> tuple[Check, ...]:
    """A check's rows; one undecided row if it raises a domain or arithmetic error."""
    step("%s", name)
    try:
        rows = run(*args)
    except (VdsmError, ArithmeticError) as error:
        if not isinstance(error, VdsmError):
            LOG.exception("%s failed", name)
        return (Check(name, Verdict.UNDECIDED, 0, nan, nan, "-", f"not done: {error}"),)
    return rows if isinstance(rows, tuple) else (rows,)


NOMINAL: Final = "proof of the motion without errors"


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is proved of the clearances of a motion.

    Args:
        proof: Of the surfaces of meshes.
        places: Where bodies begin as seen from meshes.
        counterexamples: Motions within the errors that refute what is undecided.
        nominal_clear: Whether the motion without errors is proved clear; not asked
            where there is no counterexample.
        checks: The rows of evidence.
    """

    proof: ClearanceProof
    places: Places
    counterexamples: tuple[Counterexample, ...]
    nominal_clear: bool
    checks: tuple[Check, ...]

    @cached_property
    def _inside(self) -> dict[int, Inside]:
        return pairs_inside(self.proof.motion.asked, self.places)

    @cached_property
    def least(self) -> LeastClearances:
        """The least clearances of all pairs."""
        return enclosed_least(self.proof.least, self._inside)

    @cached_property
    def profile(self) -> ClearanceProfile:
        """Brackets along the motion."""
        asked = self.proof.motion.asked
        return enclosed_profile(self.proof.profile, asked, self._inside)

    @cached_property
    def nearest(self) -> dict[int, ClosestApproach]:
        """The pairs that come nearest, by their numbers."""
        asked, least = self.proof.motion.asked, self.least
        found = nearest_pairs(asked.pairs, asked.outer, least)
        for k, one in found.items():
            if _is_deepest(asked, least, k, one.upper):
                found[k] = replace(one, deeper=True)
        return found


def judge_clearance(
    problem: AnyProblem,
    trajectory: AnyMotion,
    proof: ClearanceProof,
    places: Places,
    extras: BestEffort,
    deadline: Deadline = NO_LIMIT,
    *,
    contacts: bool = True,
) -> Judgement:
    """Judge the clearances of a motion.

    Args:
        problem: With the clearances asked for.
        trajectory: What is judged.
        proof: Of all pairs.
        places: Where bodies begin as seen from meshes.
        extras: Takes what is not done in time.
        deadline: When to give up.
        contacts: Whether to look for when bodies first and last come too close.
    """
    asked, nominal = proof.motion.asked, proof.motion.under(NO_ERRORS)
    name, search = "search for counterexamples", proof.counterexamples
    found: tuple[Counterexample, ...] = extras.take(name, (), search, deadline)
    clear = bool(found) and extras.take(NOMINAL, False, _is_clear, nominal, deadline)
    about = problem, trajectory, proof.motion, proof.on_path, deadline
    met: tuple[FirstContact, ...] = ()
    if contacts:
        met = extras.take("first contact", (), contacts_of, *about)
    evidence = Evidence(
        pairs=asked.pairs,
        outer=asked.outer,
        least=proof.least,
        counts=proof.counts,
        deepest=partial(_is_deepest, asked, proof.least),
        counterexamples=found,
        nominal=clear,
        contacts=met,
    )
    rows = clearance_checks(problem, evidence, deadline if proof.late else None)
    checks = *check_inside(asked, places), *enclosed_checks(rows, asked, places)
    return Judgement(proof, places, found, clear, checks)


def _is_deepest(
    asked: Assembly, least: LeastClearances, k: int, clearance: float
) -> bool:
    """Whether a pair is found as deep as is measured."""
    return bool(least.verdict[k] == REFUTED) and is_deepest(clearance, asked.ball(k))


def _is_clear(motion: AskedMotion, deadline: Deadline) -> bool:
    """Whether a motion is proved clear of everything."""
    proof = motion.proving(Budget(until=deadline.end)).prove()
    return proof.is_certified and is_outside(located(motion, deadline))


CLOSEST: Final = 10
"""Most pairs that are listed."""


def closest_approaches(
    problem: PlanningProblem,
    trajectory: Trajectory,
    nearest: Mapping[int, ClosestApproach],
) -> dict[int, ClosestApproach]:
    """The pairs that come nearest in a snake arm's motion, with places along links."""
    return {
        k: replace(near, station=_station(problem, trajectory, near))
        for k, near in nearest.items()
    }


def nearest_pairs(
    pairs: Sequence[Pair], outer: BoolArray, least: LeastClearances
) -> dict[int, ClosestApproach]:
    """The pairs of least upper bounds by their numbers, obstacles first.

    Links keep near each other all the time, which is rarely news. The lower bound of
    the nearest is narrowed; another may lie below it by the width of that bracket.
    Under errors one that comes less near may be proved to keep less than any of these
    from its obstacle; then it takes the place of the last.

    Args:
        pairs: Every pair, of an arm or a robot.
        outer: Which of them are with an obstacle, shape (n_pairs,).
        least: What is proved of them.
    """
    of_links, seen = ~outer, np.flatnonzero(np.isfinite(least.upper))

    def nearest(some: IntArray) -> IntArray:
        return some[np.lexsort((least.upper[some], of_links[some]))][:CLOSEST]

    order = nearest(seen)
    lower = np.where(of_links, np.inf, least.lower)[seen]
    least_of_all = lower.min(initial=np.inf) + 2.0 * TOLERANCES.least_bracket
    if order.size and (least.lower[order] > least_of_all).all():
        weakest = seen[np.argmin(lower)]
        order = nearest(np.append(order[: CLOSEST - 1], weakest))
    return {
        k: ClosestApproach(
            interval=int(least.interval[k]),
            share=float(least.share[k]),
            pair=pairs[k],
            lower=float(least.lower[k]),
            upper=float(least.upper[k]),
            station=nan,
            link_point=least.link_point[k],
            other_point=least.other_point[k],
        )
        for k in order.tolist()
    }


def _station(
    problem: PlanningProblem, trajectory: Trajectory, near: ClosestApproach
) -> float:
    """Arc length along the link's axis of the point nearest to the witness; [m].

    Of the feed, which lies along the rail, it counts back from O_1 and is negative.
    """
    arm, link = problem.manipulator, near.pair.link
    joints = trajectory.path.at_moments(np.array([near.moment]))
    if not link and arm.feed:
        return float(np.clip(near.link_point[0] - joints[0, 0], -arm.feed.length, 0.0))
    now = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    centres = joint_centres(arm, *now)[0]
    length = float(arm.link_lengths[link - 1])
    axis = (centres[link] - centres[link - 1]) / length
    along = float(axis @ (near.link_point - centres[link - 1]))
    return min(max(along, 0.0), length)
