"""The judgement of a trajectory: every check, one row each, in a fixed order."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from math import nan
from typing import Final, TypeVar

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import InvalidInput, OutOfTime, UnknownName, VdsmError
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.geometry.winding import Side
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import with_hulls
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.progress import step
from vdsm_pin.proof.layouts import AT_UPPER, LOW, OTHER, OWN, TIME, UP
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification import (
    cable_check,
    coal_carried,
    coal_check,
    fk,
    pointing,
)
from vdsm_pin.verification.arm_counterexamples import find_counterexamples
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
    enclosed_approaches,
    enclosed_checks,
    enclosed_least,
    enclosed_profile,
)
from vdsm_pin.verification.first_contact import FirstContact, TooClose, first_contacts
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
    ClosestApproach,
    Counterexample,
    Verdict,
    is_deepest,
)
from vdsm_pin.verification.robot_model import RobotModel
from vdsm_pin.verification.robust import largest_joint_error, refuted_joint_error
from vdsm_pin.verification.task import ArmPairs, all_pairs, ball_of
from vdsm_pin.verification.tip import check_tip
from vdsm_pin.verification.yes_or_no import is_certified

T = TypeVar("T")

CLOSEST: Final = 10
"""Pairs listed as the closest approaches."""


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
    kept = LowersSink(problem, trajectory)
    wanted = [EnclosedSink(sink, problem, around) if around else sink for sink in sinks]
    noted: TooClose | None = None
    if sinks or kept.fits:
        noted = TooClose(all_pairs(problem), max(1, trajectory.n_samples - 1))
        wanted += [kept.keep, noted]
    near = reach_of(problem) if reach is None else reach
    near = math.inf if around else near
    proof = prove_clearance(
        problem, trajectory, box, wanted, deadline=deadline, reach=near
    )
    besides = _Besides()
    none: tuple[Counterexample, ...] = ()
    found = besides.take(
        "search for counterexamples",
        lambda: find_counterexamples(problem, trajectory, box, proof, deadline),
        none,
    )
    nominal = bool(found) and besides.take(
        "proof of the motion without errors",
        lambda: _is_clear(problem, trajectory, deadline),
        False,
    )
    nowhere: tuple[FirstContact, ...] = ()
    contacts = besides.take(
        "first contact",
        lambda: first_contacts(
            problem,
            trajectory,
            box,
            proof,
            deadline,
            noted if proof.sent == proof.n_intervals else None,
        ),
        nowhere,
    )
    if sinks and proof.sent < proof.n_intervals:
        besides.note(f"clearance.csv from interval {proof.sent} on", deadline)
    tip = check_tip(problem, trajectory)
    near_misses = closest_approaches(problem, trajectory, proof, around)
    proved, log = kept.proved(proof), CoalLog(proof.pairs, near_misses, tuple(around))
    checks = [
        *_by_pinocchio(robot, problem, trajectory, centres, deadline),
        *check_limits(problem, trajectory),
        *tip.checks,
        *_guarded(
            pointing.NAME,
            lambda: pointing.check_pointing(problem, trajectory, deadline, box),
        ),
        *check_inside(located),
        *enclosed_checks(
            check_clearance(problem, proof, found, contacts, deadline, nominal=nominal),
            problem,
            around,
        ),
        *_by_coal(robot, problem, trajectory, proved, deadline, log),
        *_guarded(
            cable_check.NAME,
            lambda: cable_check.check_cables(problem, trajectory, deadline),
        ),
    ]
    largest = refuted = nan
    if joint_error and all(where.side is Side.OUTSIDE for where in located.values()):
        hulls = unlocated(locate_start(problem, trajectory))
        survival = _Survival(problem, trajectory, box, proof, deadline, hulls)
        largest = besides.take("largest joint error", survival.largest, nan)
        if not np.isnan(largest):
            name = "joint error that loses the clearance"
            refuted = besides.take(name, lambda: survival.refuted(largest), nan)
    elif joint_error:
        largest = 0.0
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
        joint_error=largest,
        refuted_joint_error=refuted,
        counterexamples=found,
        nominal_clear=nominal,
        not_done=tuple(besides.not_done),
        time_limit=deadline.limit,
        least=enclosed_least(least_clearances(proof), proof.pairs, problem, around),
        coal=log.rows(),
    )


def _is_clear(
    problem: PlanningProblem, trajectory: Trajectory, deadline: Deadline
) -> bool:
    """Whether a motion is proved clear of everything, without errors."""
    located = locate_arm(problem, trajectory, ErrorBox(), deadline)
    outside = all(where.side is Side.OUTSIDE for where in located.values())
    return outside and is_certified(problem, trajectory, ErrorBox(), deadline)


class _Survival:
    """The joint error that the clearance survives, from both sides."""

    def __init__(
        self,
        problem: PlanningProblem,
        trajectory: Trajectory,
        errors: ErrorBox,
        proof: ClearanceProof,
        deadline: Deadline,
        hulls: Collection[str],
    ) -> None:
        self._asked, self._deadline = (problem, trajectory, errors), deadline
        # Nothing is refuted by a hull, and nothing survives that may enter it.
        hulled = problem  # with what it keeps packed
        if hulls:
            hulled = replace(problem, scene=with_hulls(problem.scene, hulls))
        self._with_hulls = hulled, trajectory, errors
        number = ArmPairs(problem).number
        lower = np.append(proof.best[:, LOW], np.inf)  # -1 is no pair
        self._least = lower[number].min(axis=0)
        near = np.array([name in hulls for name in problem.scene.names], np.bool_)
        self._least[near] = -math.inf

    def largest(self) -> float:
        """The largest that is proved; [rad]."""
        return largest_joint_error(*self._with_hulls, self._deadline, self._least)

    def refuted(self, largest: float) -> float:
        """One that is lost, the smallest found; [rad]."""
        known = self._deadline, self._least
        return refuted_joint_error(*self._asked, largest, *known)


class _Besides:
    """What is wanted besides the checks, as far as the time allows it."""

    def __init__(self) -> None:
        self.not_done: list[str] = []

    def take(self, name: str, run: Callable[[], T], otherwise: T) -> T:
        """A result, and a note where there is none in time."""
        step("%s", name)
        try:
            return run()
        except OutOfTime as error:
            self.not_done.append(f"{name}: {error}")
            return otherwise

    def note(self, name: str, deadline: Deadline) -> None:
        """Say that something is missing."""
        self.not_done.append(f"{name}: {OutOfTime(deadline.limit)}")


def _by_pinocchio(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    centres: FloatArray | None,
    deadline: Deadline,
) -> tuple[Check, ...]:
    """Joint centres against the closed form, and against those planned."""
    rows = _guarded(fk.NAME, lambda: fk.check_fk(robot, problem, trajectory, deadline))
    if centres is None:
        return rows
    planned = _guarded(
        fk.PLANNED, lambda: fk.check_planned(robot, trajectory, centres, deadline)
    )
    return (*rows, *planned)


def _by_coal(
    robot: RobotModel,
    problem: PlanningProblem,
    trajectory: Trajectory,
    proved: ProvedLowers,
    deadline: Deadline,
    log: CoalLog,
) -> tuple[Check, ...]:
    """The second opinions on distances."""
    motion = problem, trajectory
    checks = {
        coal_check.OBSTACLES: lambda: coal_check.check_coal_obstacles(
            robot, *motion, proved, deadline, log
        ),
        coal_check.LINKS: lambda: coal_check.check_coal_links(
            robot, *motion, deadline, log
        ),
        coal_carried.CARRIED: lambda: coal_carried.check_coal_carried(
            robot, *motion, proved, log, deadline
        ),
    }
    return tuple(row for name, run in checks.items() for row in _guarded(name, run))


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


def _guarded(
    name: str, run: Callable[[], Check | tuple[Check, ...]]
) -> tuple[Check, ...]:
    """A check's rows; one undecided row where it could not be carried out."""
    step("%s", name)
    try:
        rows = run()
    except (VdsmError, ArithmeticError) as error:
        return (Check(name, Verdict.UNDECIDED, 0, nan, nan, "-", f"not done: {error}"),)
    return rows if isinstance(rows, tuple) else (rows,)


def _station(
    problem: PlanningProblem,
    trajectory: Trajectory,
    row: FloatArray,
    link: int,
    point: FloatArray,
) -> float:
    """Arc length along a link's axis of the place below its witness; [m]."""
    joints = trajectory.joints_at(row[[AT_UPPER]] + row[TIME])
    now = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    centres = joint_centres(problem.manipulator, *now)[0]
    length = float(problem.manipulator.link_lengths[link - 1])
    axis = (centres[link] - centres[link - 1]) / length
    along = float(axis @ (point - centres[link - 1]))
    return min(max(along, 0.0), length)


def closest_approaches(
    problem: PlanningProblem,
    trajectory: Trajectory,
    proof: ClearanceProof,
    around: Enclosed | None = None,
) -> tuple[ClosestApproach, ...]:
    """The pairs that come nearest, by their upper bounds; obstacles first.

    Links keep near each other all the time, which is rarely news. The lower bound of
    the nearest is narrowed; another may lie below it by the width of that bracket.

    Args:
        problem: Arm and scene.
        trajectory: The motion.
        proof: Of its distances.
        around: What begins inside the meshes that the arm is inside of.
    """
    around = around or {}
    rows = list(enclosed_approaches(problem, around))
    of_links = np.array([not pair.obstacle for pair in proof.pairs])
    seen = np.flatnonzero(np.isfinite(proof.best[:, UP]))
    for k in seen[np.lexsort((proof.best[seen, UP], of_links[seen]))][:CLOSEST]:
        pair, row = proof.pairs[k], proof.best[k]
        if pair.own in around.get(pair.obstacle, ()):
            continue
        points = row[OWN:OTHER], row[OTHER : OTHER + 3]
        # In a pair of links the sweep moves the second one against the first.
        mine, theirs = points if pair.obstacle else points[::-1]
        rows.append(
            ClosestApproach(
                interval=int(row[AT_UPPER]),
                share=float(row[TIME]),
                pair=pair,
                lower=float(row[LOW]),
                upper=float(row[UP]),
                station=_station(problem, trajectory, row, pair.link, mine),
                link_point=frozen(mine),
                other_point=frozen(theirs),
                deeper=is_deepest(float(row[UP]), ball_of(problem, pair)),
            )
        )
    return tuple(rows[:CLOSEST])
