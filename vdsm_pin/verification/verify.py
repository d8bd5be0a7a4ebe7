"""The judgement of a trajectory: every check, one row each, in a fixed order."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import NamedTuple

import numpy as np

from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.winding import Location, Side
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification import cable_check, pointing
from vdsm_pin.verification.approaches import closest_approaches
from vdsm_pin.verification.arm_counterexamples import find_counterexamples
from vdsm_pin.verification.besides import Besides
from vdsm_pin.verification.clearance import (
    ClearanceProof,
    least_clearances,
    prove_clearance,
)
from vdsm_pin.verification.clearance_check import check_clearance
from vdsm_pin.verification.coal_distances import reach_of
from vdsm_pin.verification.coal_log import CoalLog
from vdsm_pin.verification.enclosed import (
    EnclosedSink,
    enclosed_checks,
    enclosed_least,
    enclosed_profile,
)
from vdsm_pin.verification.first_contact import (
    FirstContact,
    Noted,
    TooClose,
    arm_contacts,
)
from vdsm_pin.verification.inside import (
    Enclosed,
    arm_inside,
    bodies_inside,
    check_inside,
    locate_arm,
    locate_start,
    unlocated,
)
from vdsm_pin.verification.limits import check_limits
from vdsm_pin.verification.moving import check_timed
from vdsm_pin.verification.proved_lowers import LowersSink, ProvedLowers
from vdsm_pin.verification.records import (
    ArmVerification,
    Check,
    ClearanceSink,
    Counterexample,
)
from vdsm_pin.verification.robot_model import RobotModel
from vdsm_pin.verification.second_opinions import by_coal, by_pinocchio, guarded
from vdsm_pin.verification.survival import Survival
from vdsm_pin.verification.task import all_pairs
from vdsm_pin.verification.tip import check_tip
from vdsm_pin.verification.yes_or_no import is_certified


def verify(
    problem: PlanningProblem,
    trajectory: Trajectory,
    robot: RobotModel,
    *,
    errors: ErrorBox | None = None,
    sinks: Sequence[ClearanceSink] = (),
    joint_error: bool = False,
    deadline: Deadline = NO_LIMIT,
    reach: float | None = None,
    centres: FloatArray | None = None,
) -> ArmVerification:
    """Judge a trajectory against a problem.

    Args:
        problem: What is asked.
        trajectory: What is judged, whoever made it.
        robot: The arm in Pinocchio and Coal.
        errors: The clearance proof covers every motion within it, and within the
            errors of the problem.
        sinks: Receive the clearance brackets in chunks, in order.
        joint_error: Whether to find the largest joint error that is still certified.
        deadline: When to give up what is left.
        reach: The sinks hear of obstacles within it, see `prove_clearance`; as far as
            Coal looks where not given; [m].
        centres: The joint centres that were planned, to be held against Pinocchio's,
            shape (n_samples, N + 1, 3); [m].

    Returns:
        All rows of evidence. A check that could not be carried out, or not in time, is
        an undecided row.

    Raises:
        InvalidInput: If the trajectory is of another arm or the errors are negative.
    """
    box = problem.errors.widened(errors or ErrorBox())
    _check_input(problem, trajectory, box)
    asked, besides = _Asked(problem, trajectory, box, deadline), Besides()
    located = locate_arm(problem, trajectory, box, deadline)
    around = bodies_inside(problem, trajectory, arm_inside(located))
    swept = _swept(asked, around, sinks, reach)
    proof, met = swept.proof, _met(asked, swept, besides)
    if sinks and proof.sent < proof.n_intervals:
        besides.note(f"clearance.csv from interval {proof.sent} on", deadline)
    tip = check_tip(problem, trajectory)
    near_misses = closest_approaches(problem, trajectory, proof, around)
    log = CoalLog(proof.pairs, near_misses, tuple(around))
    checks = [
        *by_pinocchio(robot, problem, trajectory, centres, deadline),
        *check_limits(problem, trajectory),
        *tip.checks,
        *guarded(
            pointing.NAME,
            lambda: pointing.check_pointing(problem, trajectory, deadline, box),
        ),
        *check_inside(located),
        *enclosed_checks(_clearance_rows(asked, proof, met), problem, around),
        *by_coal(robot, problem, trajectory, swept.lowers, deadline, log),
        *guarded(
            cable_check.NAME,
            lambda: cable_check.check_cables(problem, trajectory, deadline),
        ),
    ]
    survived = _survived(asked, proof, located, besides) if joint_error else (nan, nan)
    return ArmVerification(
        problem=problem,
        trajectory=trajectory,
        errors=box,
        pairs=proof.pairs,
        checks=tuple(checks),
        approaches=log.approaches,
        profile=enclosed_profile(proof.profile, problem, around),
        tip_deviation=tip.deviation,
        coverage=tip.coverage,
        undrawn=tip.undrawn,
        joint_error=survived[0],
        refuted_joint_error=survived[1],
        counterexamples=met.counterexamples,
        nominal_clear=met.nominal_clear,
        not_done=tuple(besides.not_done),
        time_limit=deadline.limit,
        least=enclosed_least(least_clearances(proof), proof.pairs, problem, around),
        coal=log.rows(),
    )


@dataclass(frozen=True)
class _Asked:
    """What is judged, and until when.

    Args:
        problem: What is asked.
        trajectory: The motion.
        errors: Every motion within it is meant.
        deadline: When to give up what is left.
    """

    problem: PlanningProblem
    trajectory: Trajectory
    errors: ErrorBox
    deadline: Deadline


class _Swept(NamedTuple):
    """What was proved of the clearance, and what was heard on the way.

    Args:
        proof: Of every pair.
        lowers: Its lower bounds in every interval.
        too_close: Where pairs come too close; None where not all was heard.
    """

    proof: ClearanceProof
    lowers: ProvedLowers
    too_close: Noted | None


def _swept(
    asked: _Asked,
    around: Enclosed,
    sinks: Sequence[ClearanceSink],
    reach: float | None,
) -> _Swept:
    """Prove the clearance; `sinks` and `reach` are those of `verify`."""
    problem, trajectory = asked.problem, asked.trajectory
    kept = LowersSink(problem, trajectory)
    wanted = [EnclosedSink(sink, problem, around) if around else sink for sink in sinks]
    noted: TooClose | None = None
    if sinks or kept.fits:
        noted = TooClose(all_pairs(problem), max(1, trajectory.n_samples - 1))
        wanted += [kept.keep, noted]
    near = reach_of(problem) if reach is None else reach
    near = math.inf if around else near
    proof = prove_clearance(
        problem,
        trajectory,
        asked.errors,
        wanted,
        deadline=asked.deadline,
        reach=near,
    )
    heard = None
    if noted is not None and proof.sent == proof.n_intervals:
        heard = noted.noted
    return _Swept(proof, kept.proved(proof), heard)


class _Met(NamedTuple):
    """How bodies come too close.

    Args:
        counterexamples: Motions within the errors that do.
        nominal_clear: Whether the motion without errors is proved clear of everything;
            asked only where there are some.
        contacts: When pairs do first.
    """

    counterexamples: tuple[Counterexample, ...]
    nominal_clear: bool
    contacts: tuple[FirstContact, ...]


def _met(asked: _Asked, swept: _Swept, besides: Besides) -> _Met:
    """How bodies come too close, as far as there is time to say."""
    problem, motion, box = asked.problem, asked.trajectory, asked.errors
    proof, deadline = swept.proof, asked.deadline
    none: tuple[Counterexample, ...] = ()
    found = besides.take(
        "search for counterexamples",
        lambda: find_counterexamples(problem, motion, box, proof, deadline),
        none,
    )
    nominal = bool(found) and besides.take(
        "proof of the motion without errors", lambda: _is_clear(asked), False
    )
    nowhere: tuple[FirstContact, ...] = ()
    contacts = besides.take(
        "first contact",
        lambda: arm_contacts(problem, motion, box, proof, deadline, swept.too_close),
        nowhere,
    )
    return _Met(found, nominal, contacts)


def _clearance_rows(
    asked: _Asked, proof: ClearanceProof, met: _Met
) -> tuple[Check, ...]:
    return check_clearance(
        asked.problem,
        proof,
        met.counterexamples,
        met.contacts,
        asked.deadline,
        nominal=met.nominal_clear,
    )


def _survived(
    asked: _Asked,
    proof: ClearanceProof,
    located: Mapping[str, Location],
    besides: Besides,
) -> tuple[float, float]:
    """The largest joint error that is proved, and the smallest found that is lost.

    NaN where there was no time; nothing is proved of an arm that may be inside a mesh.
    """
    problem, motion, deadline = asked.problem, asked.trajectory, asked.deadline
    if any(where.side is not Side.OUTSIDE for where in located.values()):
        return 0.0, nan
    hulls = unlocated(locate_start(problem, motion))
    survival = Survival(problem, motion, asked.errors, proof, deadline, hulls)
    largest = besides.take("largest joint error", survival.largest, nan)
    if np.isnan(largest):
        return nan, nan
    name = "joint error that loses the clearance"
    return largest, besides.take(name, lambda: survival.refuted(largest), nan)


def _is_clear(asked: _Asked) -> bool:
    """Whether a motion is proved clear of everything, without errors."""
    problem, trajectory, deadline = asked.problem, asked.trajectory, asked.deadline
    located = locate_arm(problem, trajectory, ErrorBox(), deadline)
    outside = all(where.side is Side.OUTSIDE for where in located.values())
    return outside and is_certified(problem, trajectory, ErrorBox(), deadline)


def _check_input(
    problem: PlanningProblem, trajectory: Trajectory, errors: ErrorBox
) -> None:
    expected, found = problem.manipulator.n_links, trajectory.n_links
    if expected != found:
        message = f"trajectory has {found} links, the problem's arm has {expected}"
        raise InvalidInput(message)
    check_timed(problem.scene, trajectory)
    for pair in problem.manipulator.ignore_pairs:
        problem.manipulator.check_ignored(pair, problem.scene.names)
    if len(errors.joints) not in (0, expected):
        message = f"errors of {len(errors.joints)} joints, expected {expected}"
        raise InvalidInput(message)
    for one in errors.obstacles:
        if one.name not in problem.scene.names:
            known = problem.scene.names
            raise UnknownName(kind="obstacle", name=one.name, known=known)
