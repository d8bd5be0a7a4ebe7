"""The clearances of a motion judged, of an arm's or a robot's, meshes as solids."""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.problem.error_boxes import NO_ERRORS
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.terms import REFUTED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.approaches import nearest_pairs
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.best_effort import BestEffort
from vdsm_pin.verification.brackets import ClearanceProfile, LeastClearances
from vdsm_pin.verification.clearance import ClearanceProof
from vdsm_pin.verification.clearance_check import Evidence, clearance_checks
from vdsm_pin.verification.enclosed import (
    enclosed_checks,
    enclosed_least,
    enclosed_profile,
    pairs_inside,
)
from vdsm_pin.verification.first_contact import FirstContact, contacts_of
from vdsm_pin.verification.inside import Places, check_inside, is_outside, located
from vdsm_pin.verification.protocols import AnyMotion
from vdsm_pin.verification.records import (
    Check,
    ClosestApproach,
    Counterexample,
    is_deepest,
)

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
    def least(self) -> LeastClearances:
        """The least clearances of all pairs."""
        inside = pairs_inside(self.proof.motion.asked, self.places)
        return enclosed_least(self.proof.least, inside)

    @property
    def profile(self) -> ClearanceProfile:
        """Brackets along the motion."""
        asked = self.proof.motion.asked
        return enclosed_profile(
            self.proof.profile, asked, pairs_inside(asked, self.places)
        )

    @property
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
    name = "search for counterexamples"
    found = extras.take(name, (), proof.counterexamples, deadline)
    clear = bool(found) and extras.take(NOMINAL, False, _is_clear, nominal, deadline)
    about = problem, trajectory, proof.motion, proof.inner, deadline
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
    proof = motion.proof(Budget(until=deadline.end))
    return proof.is_certified and is_outside(located(motion, deadline))
