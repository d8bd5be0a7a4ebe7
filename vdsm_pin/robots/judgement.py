"""The judgement of a robot's trajectory: every check, one row each."""

from dataclasses import dataclass, replace
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, first_equal
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import Proof
from vdsm_pin.proof.terms import REFUTED
from vdsm_pin.robots.by_itself import checks_by_itself
from vdsm_pin.robots.cell import Cell
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.approaches import nearest_pairs
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.best_effort import BestEffort
from vdsm_pin.verification.clearance_check import LINKS, Evidence, clearance_checks
from vdsm_pin.verification.clearances import in_rows as least_in_rows
from vdsm_pin.verification.clearances import least_clearances, profile_of, with_depths
from vdsm_pin.verification.coal_check import CoalEvidence
from vdsm_pin.verification.coal_shapes import disagreement
from vdsm_pin.verification.contact_search import contacts_of
from vdsm_pin.verification.contacts import MEETING
from vdsm_pin.verification.counterexample import find_counterexamples, in_rows
from vdsm_pin.verification.enclosed import (
    enclosed_checks,
    enclosed_least,
    enclosed_profile,
    pairs_inside,
)
from vdsm_pin.verification.first_contact import FirstContact
from vdsm_pin.verification.inside import (
    LINKS_OUTSIDE,
    check_inside,
    is_outside,
    located,
)
from vdsm_pin.verification.limits import checks_of_others
from vdsm_pin.verification.records import Check, Verdict, Verification

NO_PAIR: Final = "no pair to check: no obstacle, no two links that are held apart"
WIDTH: Final = 0.1
"""Brackets wider than this part of the clearance are asked of a new plane; [-]."""


@dataclass(frozen=True, repr=False, kw_only=True)
class RobotVerification(Verification):
    """The judgement of one trajectory of a robot.

    Args:
        problem: The robot, its obstacles, the clearances asked for.
        trajectory: What was judged.
        motion: The waypoints it was made of; None where a path alone was given.
    """

    problem: Cell
    trajectory: Path
    motion: JointTrajectory | None = None


def verify_robot(
    cell: Cell, path: Path, deadline: Deadline = NO_LIMIT, *, contacts: bool = True
) -> RobotVerification:
    """The judgement of a motion; what is not judged in time is undecided.

    Args:
        cell: The robot, its obstacles, the clearances asked for.
        path: The motion.
        deadline: When to give up what is left.
        contacts: Whether to look for when bodies first and last come too close.
    """
    robot, extras = cell.robot, BestEffort()
    budget = Budget(until=deadline.end, slack=WIDTH)
    motion = AskedMotion.of_robot(cell.asked, path, cell.errors)
    knots, named = motion.knots, cell.asked.pairs
    proof = motion.proof(budget)
    places = located(motion, deadline)
    inside = pairs_inside(cell.asked, places)
    least = least_clearances(cell.asked, proof)
    proved = with_depths(motion, least, deadline=deadline)
    coal, measured = _coal(cell, motion, proof)
    least = enclosed_least(proved, inside)
    profile = profile_of(proof.profile, proof.stride, knots, len(robot.bodies))
    sought = motion.in_itself, least, proof.lower_interval, deadline
    lost = extras.take("search for counterexamples", (), find_counterexamples, *sought)
    met: tuple[FirstContact, ...] = ()
    if contacts:
        of_all = cell, path, motion, proved, deadline
        met = extras.take("first contact", (), contacts_of, *of_all, balls=True)
    lost, least = in_rows(lost, knots), least_in_rows(least, knots)
    name = "proof of the motion without errors"
    clear = bool(lost) and extras.take(name, False, _is_clear, motion, budget, deadline)
    evidence = Evidence(
        pairs=named,
        least=least,
        counts=np.eye(3, dtype=np.int64)[least.verdict],
        deepest=lambda k, worst: bool(least.verdict[k] == REFUTED) and worst <= MEETING,
        counterexamples=lost,
        nominal=clear,
        contacts=met,
    )
    rows = clearance_checks(cell, evidence, None if proof.in_time else deadline)
    checks = [
        *checks_by_itself(robot, path),
        *checks_of_others(cell.scene),
        *check_inside(cell.asked, places, LINKS_OUTSIDE),
        *enclosed_checks(rows, cell.asked, places),
        *([coal] if named else [_no_pair(cell)]),
    ]
    nearest = nearest_pairs(named, least).items()
    approaches = tuple(
        replace(one, coal=float(measured[k]), deeper=evidence.deepest(k, one.upper))
        for k, one in nearest
    )
    return RobotVerification(
        problem=cell,
        trajectory=path,
        pairs=named,
        checks=tuple(checks),
        approaches=approaches,
        profile=enclosed_profile(profile, cell.asked, inside),
        least=least,
        counterexamples=lost,
        nominal_clear=clear,
        not_done=tuple(extras.not_done),
        time_limit=deadline.limit,
    )


def _no_pair(cell: Cell) -> Check:
    """The row of a robot of which nothing is held apart."""
    needed = cell.required_self_clearance
    return Check(LINKS, Verdict.UNDECIDED, 0, nan, needed, "m", NO_PAIR)


def _is_clear(motion: AskedMotion, budget: Budget, deadline: Deadline) -> bool:
    """Whether the motion is proved clear of everything, without errors."""
    nominal = motion.under(ErrorBox())
    return is_outside(located(nominal, deadline)) and nominal.proof(budget).is_certified


def _coal(cell: Cell, motion: AskedMotion, proof: Proof) -> tuple[Check, FloatArray]:
    """Coal's distance of each pair at its witness, which the bracket must hold.

    Args:
        cell: Robot and scene.
        motion: What is asked.
        proof: Of its pairs.

    Returns:
        The check, and the distances, NaN where there is none, shape (n_pairs,); [m].
    """
    asked, path = cell.asked, motion.path
    table, found = asked.table, np.full(asked.table.size, nan)
    seen = np.flatnonzero(np.isfinite(proof.upper))
    when = np.stack([proof.interval[seen], proof.share[seen]], axis=1)
    first, row = first_equal(when)
    poses = asked.poses(path.within(proof.interval[seen[first]], when[first, 1]))
    found[seen] = cell.distances(table.one[seen], table.other[seen], poses, row)
    off = disagreement(found, proof.lower, proof.upper)
    moments = motion.knots.moments(proof.interval, proof.share)
    measured = np.flatnonzero(~np.isnan(found))
    evidence = CoalEvidence(count=len(measured))
    if measured.size:
        worst = measured[np.argmax(off[measured])]
        evidence.add(float(off[worst]), "", float(moments[worst]))
    where = f"{evidence.count} of {table.size} pairs measured"
    untold = cell.coal.untold([body.name for body in asked.bodies])
    note = f"{where}, each where it was found nearest{untold}"
    return evidence.check(note), found
