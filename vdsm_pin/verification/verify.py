"""The judgement of a trajectory: every check, one row each, in a fixed order."""

import math
from collections.abc import Sequence
from dataclasses import replace
from math import nan

import numpy as np

from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.winding import Side
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import with_hulls
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification import cable_check, fk, pointing
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceSink
from vdsm_pin.verification.clearance import ClearanceProof, prove_motion
from vdsm_pin.verification.coal_arm import coal_reach
from vdsm_pin.verification.coal_check import LowersSink, ProvedLowers, ask_coal
from vdsm_pin.verification.enclosed import EnclosedSink, pairs_inside
from vdsm_pin.verification.inside import (
    Places,
    by_mesh,
    is_outside,
    located,
    located_at_start,
    unlocated,
)
from vdsm_pin.verification.judgement import (
    BestEffort,
    closest_approaches,
    guarded,
    judge_clearance,
)
from vdsm_pin.verification.limits import check_limits, checks_of_others
from vdsm_pin.verification.moving import check_timed
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import ArmVerification
from vdsm_pin.verification.robust import largest_joint_error, refuted_joint_error
from vdsm_pin.verification.tip import check_tip


def verify(
    problem: PlanningProblem,
    trajectory: Trajectory,
    *,
    sinks: Sequence[ClearanceSink] = (),
    joint_error: bool = False,
    deadline: Deadline = NO_LIMIT,
    reach: float | None = None,
    centres: FloatArray | None = None,
) -> ArmVerification:
    """Judge a trajectory against a problem.

    Args:
        problem: What is asked; the clearance proof covers every motion within its
            errors.
        trajectory: What is judged, whoever made it.
        sinks: Receive the clearance brackets in chunks, in order.
        joint_error: Whether to find the largest joint error that is still certified.
        deadline: When to give up what is left.
        reach: Obstacles that no link is proved nearer to than this are left out of
            what the sinks receive; `coal_reach(problem)` where it is None; [m].
        centres: The joint centres that were planned, to be held against Pinocchio's,
            shape (n_samples, N + 1, 3); [m].

    Returns:
        All rows of evidence. A check that could not be carried out, or not in time, is
        an undecided row.

    Raises:
        InvalidInput: If the trajectory is of another arm.
    """
    _check_input(problem, trajectory)
    model, box = load_arm(problem.manipulator), problem.errors
    motion, extras = AskedMotion.of_arm(problem, trajectory, box), BestEffort()
    places = located(motion, deadline)
    reach = coal_reach(problem) if reach is None else reach
    asked = problem, trajectory, motion, places
    proof, lowers = _proved(*asked, sinks, deadline, reach)
    found = judge_clearance(problem, trajectory, proof, places, extras, deadline)
    if sinks and proof.sent < motion.n_trajectory_intervals:
        extras.note(f"clearance.csv from interval {proof.sent} on", deadline)
    tip = check_tip(problem, trajectory)
    meshes = by_mesh(motion.asked, places).items()
    around = [name for name, where in meshes if where.side is Side.INSIDE]
    nearest = closest_approaches(problem, trajectory, found.nearest)
    args = problem, trajectory, deadline
    before_coal = (
        *guarded(fk.NAME, fk.check_fk, model, problem, trajectory, centres, deadline),
        *check_limits(problem, trajectory),
        *checks_of_others(problem.scene),
        *tip.checks,
        *guarded(pointing.NAME, pointing.check_pointing, *args, box),
        *found.checks,
    )
    coal = ask_coal(problem, trajectory, lowers, nearest, around, deadline)
    cables = guarded(cable_check.NAME, cable_check.check_cables, *args)
    survived = nan, nan
    if joint_error:
        survived = _survived(problem, trajectory, proof, places, extras, deadline)
    return ArmVerification(
        problem=problem,
        trajectory=trajectory,
        pairs=proof.pairs,
        checks=(*before_coal, *coal.checks, *cables),
        approaches=coal.approaches,
        profile=found.profile,
        coverage=tip.coverage,
        undrawn=tip.undrawn,
        joint_error=survived[0],
        refuted_joint_error=survived[1],
        counterexamples=found.counterexamples,
        nominal_clear=found.nominal_clear,
        not_done=tuple(extras.not_done),
        time_limit=deadline.limit,
        least=found.least,
        coal=coal.rows,
    )


def _proved(
    problem: PlanningProblem,
    trajectory: Trajectory,
    motion: AskedMotion,
    places: Places,
    sinks: Sequence[ClearanceSink],
    deadline: Deadline,
    reach: float,
) -> tuple[ClearanceProof, ProvedLowers]:
    """The clearance of every pair, and its lower bounds where they fit into memory.

    `sinks` and `reach` are those of `verify`.
    """
    inside = pairs_inside(motion.asked, places)
    wanted = [EnclosedSink(one, inside) if inside else one for one in sinks]
    lowers = LowersSink(problem, trajectory)
    wanted += [lowers.keep] if sinks or lowers.fits else []
    reach = math.inf if inside else reach
    proof = prove_motion(motion, Budget(until=deadline.end), wanted, reach)
    proof = proof.with_depths(deadline)
    return proof, lowers.proved(proof)


def _survived(
    problem: PlanningProblem,
    motion: Trajectory,
    proof: ClearanceProof,
    places: Places,
    extras: BestEffort,
    deadline: Deadline,
) -> tuple[float, float]:
    """The largest joint error that is certified, and the least refuted one; [rad].

    Each is NaN where the time was over; 0 and NaN for an arm that may be inside a mesh.
    Where the inside of a mesh cannot be told, its hull stands for it in what is
    certified, and the mesh itself in what is refuted.
    """
    if not is_outside(places):
        return 0.0, nan
    doubtful = unlocated(located_at_start(proof.motion))
    hulls, hulled = {proof.pairs[k].obstacle for k in doubtful}, problem
    if hulls:  # else with what the problem keeps packed
        hulled = replace(problem, scene=with_hulls(problem.scene, hulls))
    asked, least = proof.motion.asked, np.full(len(problem.scene.names), math.inf)
    obstacle = asked.table.one[asked.outer] - len(asked.own)
    np.minimum.at(least, obstacle, proof.least.lower[asked.outer])
    least[[name in hulls for name in problem.scene.names]] = -math.inf
    errors, known = problem.errors, (deadline, least)
    args, name = (hulled, motion, errors, *known), "largest joint error"
    largest = extras.take(name, nan, largest_joint_error, *args)
    if np.isnan(largest):
        return nan, nan
    name, more = "joint error that loses the clearance", (largest, *known)
    found = extras.take(name, nan, refuted_joint_error, problem, motion, errors, *more)
    return largest, found


def _check_input(problem: PlanningProblem, trajectory: Trajectory) -> None:
    expected, found = problem.manipulator.n_links, trajectory.n_links
    if expected != found:
        message = f"trajectory has {found} links, the problem's arm has {expected}"
        raise InvalidInput(message)
    check_timed(problem.scene, trajectory)
    arm = problem.manipulator
    for pair in arm.ignore_pairs:
        arm.check_ignored(pair, problem.scene.names)
        for name in (name for name in pair if arm.owner_of(name) != name):
            known = tuple(one.name for one in arm.convex_bodies)
            if name not in known:
                raise UnknownName(kind="part of a body", name=name, known=known)
    problem.check_errors(problem.errors)
