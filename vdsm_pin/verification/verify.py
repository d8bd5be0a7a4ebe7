"""The judgement of a trajectory: every check, one row each, in a fixed order."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.winding import Location, Side
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import with_hulls
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import LOW
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification import cable_check, fk, pointing
from vdsm_pin.verification.approaches import closest_approaches
from vdsm_pin.verification.arm_counterexamples import find_counterexamples
from vdsm_pin.verification.besides import Besides, guarded
from vdsm_pin.verification.clearance import (
    ClearanceProof,
    least_clearances,
    prove_clearance,
)
from vdsm_pin.verification.clearance_check import check_clearance
from vdsm_pin.verification.coal_carried import CARRIED, check_coal_carried
from vdsm_pin.verification.coal_check import (
    LINKS,
    OBSTACLES,
    check_coal_links,
    check_coal_obstacles,
)
from vdsm_pin.verification.coal_distances import reach_of
from vdsm_pin.verification.coal_log import CoalLog
from vdsm_pin.verification.enclosed import (
    EnclosedSink,
    enclosed_checks,
    enclosed_least,
    enclosed_profile,
    pairs_inside,
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
from vdsm_pin.verification.proved_lowers import LowersSink
from vdsm_pin.verification.records import (
    ArmVerification,
    Check,
    ClearanceSink,
    Counterexample,
)
from vdsm_pin.verification.robot_model import RobotModel
from vdsm_pin.verification.robust import largest_joint_error, refuted_joint_error
from vdsm_pin.verification.task import ArmPairs, all_pairs
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
    located = locate_arm(problem, trajectory, box, deadline)
    around = bodies_inside(problem, trajectory, arm_inside(located))
    asked = _Judgement(problem, trajectory, box, deadline)
    proof = asked.proved(around, sinks, reach_of(problem) if reach is None else reach)
    counterexamples = asked.counterexamples(proof)
    clear = bool(counterexamples) and asked.is_nominally_clear()
    contacts = asked.contacts(proof)
    if sinks and proof.sent < proof.n_intervals:
        asked.besides.note(f"clearance.csv from interval {proof.sent} on", deadline)
    tip = check_tip(problem, trajectory)
    near_misses = closest_approaches(problem, trajectory, proof, around)
    log = CoalLog(proof.pairs, near_misses, tuple(around))
    clearance = check_clearance(
        problem, proof, counterexamples, contacts, deadline, nominal=clear
    )
    checks = [
        *guarded(fk.NAME, lambda: fk.check_fk(robot, problem, trajectory, deadline)),
        *asked.planned(robot, centres),
        *check_limits(problem, trajectory),
        *tip.checks,
        *guarded(
            pointing.NAME,
            lambda: pointing.check_pointing(problem, trajectory, deadline, box),
        ),
        *check_inside(located),
        *enclosed_checks(clearance, problem, around),
        *asked.by_coal(robot, proof, log),
        *guarded(
            cable_check.NAME,
            lambda: cable_check.check_cables(problem, trajectory, deadline),
        ),
    ]
    survived = asked.survived(proof, located) if joint_error else (nan, nan)
    inside, depth = pairs_inside(proof.pairs, around), -problem.manipulator.least_radius
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
        counterexamples=counterexamples,
        nominal_clear=clear,
        not_done=tuple(asked.besides.not_done),
        time_limit=deadline.limit,
        least=enclosed_least(least_clearances(proof), inside, depth),
        coal=log.rows(),
    )


class _Judgement:
    """What is worked out of one motion, and what there was no time for.

    Args:
        problem: What is asked.
        trajectory: The motion.
        errors: Every motion within it is meant.
        deadline: When to give up what is left.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        trajectory: Trajectory,
        errors: ErrorBox,
        deadline: Deadline,
    ) -> None:
        self.problem, self.trajectory = problem, trajectory
        self.errors, self.deadline, self.besides = errors, deadline, Besides()
        self.lowers = LowersSink(problem, trajectory)
        self.too_close: Noted | None = None

    def proved(
        self, around: Enclosed, sinks: Sequence[ClearanceSink], reach: float
    ) -> ClearanceProof:
        """The clearance of every pair; `sinks` and `reach` are those of `verify`."""
        problem, trajectory = self.problem, self.trajectory
        wanted = [
            EnclosedSink(one, problem, around) if around else one for one in sinks
        ]
        noted = TooClose(all_pairs(problem), max(1, trajectory.n_samples - 1))
        if sinks or self.lowers.fits:
            wanted += [self.lowers.keep, noted]
        proof = prove_clearance(
            problem,
            trajectory,
            self.errors,
            wanted,
            deadline=self.deadline,
            reach=math.inf if around else reach,
        )
        if proof.sent == proof.n_intervals:
            self.too_close = noted.noted
        return proof

    def counterexamples(self, proof: ClearanceProof) -> tuple[Counterexample, ...]:
        """Motions within the errors that come too close."""
        problem, motion, box = self.problem, self.trajectory, self.errors
        none: tuple[Counterexample, ...] = ()
        return self.besides.take(
            "search for counterexamples",
            lambda: find_counterexamples(problem, motion, box, proof, self.deadline),
            none,
        )

    def is_nominally_clear(self) -> bool:
        """Whether the motion without errors is proved clear of everything."""
        motion = self.problem, self.trajectory, ErrorBox(), self.deadline

        def is_clear() -> bool:
            located = locate_arm(*motion)
            outside = all(one.side is Side.OUTSIDE for one in located.values())
            return outside and is_certified(*motion)

        name = "proof of the motion without errors"
        return self.besides.take(name, is_clear, False)

    def contacts(self, proof: ClearanceProof) -> tuple[FirstContact, ...]:
        """When pairs first come too close."""
        motion, known = (self.problem, self.trajectory, self.errors), self.too_close
        nowhere: tuple[FirstContact, ...] = ()
        return self.besides.take(
            "first contact",
            lambda: arm_contacts(*motion, proof, self.deadline, known),
            nowhere,
        )

    def planned(
        self, robot: RobotModel, centres: FloatArray | None
    ) -> tuple[Check, ...]:
        """Joint centres by Pinocchio against those planned, where there are any."""
        if centres is None:
            return ()
        motion = robot, self.trajectory, centres, self.deadline
        return guarded(fk.PLANNED, lambda: fk.check_planned(*motion))

    def by_coal(
        self, robot: RobotModel, proof: ClearanceProof, log: CoalLog
    ) -> tuple[Check, ...]:
        """The second opinions on distances."""
        asked, deadline = (robot, self.problem, self.trajectory), self.deadline
        proved = self.lowers.proved(proof)
        checks = {
            OBSTACLES: lambda: check_coal_obstacles(*asked, proved, deadline, log),
            LINKS: lambda: check_coal_links(*asked, deadline, log),
            CARRIED: lambda: check_coal_carried(*asked, proved, log, deadline),
        }
        return tuple(row for name, run in checks.items() for row in guarded(name, run))

    def survived(
        self, proof: ClearanceProof, located: Mapping[str, Location]
    ) -> tuple[float, float]:
        """The largest joint error that is proved, and the smallest found that is lost.

        NaN where there was no time; nothing is proved of an arm that may be inside a
        mesh. Nothing is refuted by a mesh's hull, and nothing survives that may enter
        it.
        """
        if any(where.side is not Side.OUTSIDE for where in located.values()):
            return 0.0, nan
        problem, motion, errors = self.problem, self.trajectory, self.errors
        hulls, hulled = unlocated(locate_start(problem, motion)), problem
        if hulls:  # else with what the problem keeps packed
            hulled = replace(problem, scene=with_hulls(problem.scene, hulls))
        lower = np.append(proof.best[:, LOW], np.inf)  # -1 is no pair
        least = lower[ArmPairs(problem).number].min(axis=0)
        least[[name in hulls for name in problem.scene.names]] = -math.inf
        known = self.deadline, least
        largest = self.besides.take(
            "largest joint error",
            lambda: largest_joint_error(hulled, motion, errors, *known),
            nan,
        )
        if np.isnan(largest):
            return nan, nan
        return largest, self.besides.take(
            "joint error that loses the clearance",
            lambda: refuted_joint_error(problem, motion, errors, largest, *known),
            nan,
        )


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
