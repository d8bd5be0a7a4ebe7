"""What the proof for an error box leaves undecided of an arm, as the search asks it."""

from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from vdsm_pin.arm.tree import arm_tree, link_frame
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.bodies import Body
from vdsm_pin.proof.layouts import AT_LOWER, AT_UPPER, LOW, OTHER, OWN, TIME, UP
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.clearance import ClearanceProof
from vdsm_pin.verification.contacts import BESIDE, MEETING
from vdsm_pin.verification.counterexample import (
    ErringPair,
    Moment,
    counterexamples,
    grown_by,
    moments_of,
)
from vdsm_pin.verification.moving import joined_tree, obstacle_frames, whole_rows
from vdsm_pin.verification.records import Counterexample, Pair
from vdsm_pin.verification.task import ball_of

MOST_MEETINGS: Final = 32
"""Pairs in which a ball in both is looked for."""


def erring_pair(
    problem: PlanningProblem, trajectory: Trajectory, pair: Pair, errors: ErrorBox
) -> ErringPair:
    """What is asked of a pair of an arm."""
    mine = np.array([name == pair.obstacle for name in problem.scene.names], bool)
    problem, arm = problem.among(mine), problem.manipulator
    own, required = arm_tree(arm), problem.required_self_clearance
    tree = joined_tree(own, problem.scene)
    bodies = {
        body.name: Body(link_frame(body.link), (body.piece,), body.name)
        for body in arm.convex_bodies
    }
    if pair.obstacle:
        required = problem.required_clearance
        (frame,) = obstacle_frames(own, problem.scene)
        bodies[pair.label] = Body(frame, problem.scene.obstacles[0].pieces, pair.label)
    sizes, angles = np.zeros(tree.n_columns), errors.angles(arm.n_links)
    sizes[1 : 1 + angles.size] = angles.reshape(-1)
    return ErringPair(
        pair=pair,
        tree=tree,
        bodies=(bodies[pair.own], bodies[pair.label]),
        required=required,
        rows=partial(whole_rows, problem, trajectory),
        sizes=sizes,
        grown=grown_by(errors, pair),
        n_joints=1 + angles.size,
        ball=ball_of(problem, pair),
    )


def with_meetings(
    problem: PlanningProblem,
    trajectory: Trajectory,
    proof: ClearanceProof,
    deadline: Deadline = NO_LIMIT,
) -> ClearanceProof:
    """The proof with pairs refuted of which a ball is proved to lie in both bodies.

    No depth is measured of bodies that nothing grows: where they meet their clearance
    is 0 at most, which refutes no required clearance of 0.
    """
    counts, best = proof.counts.copy(), proof.best.copy()
    open_ = (counts[:, UNDECIDED] > 0) & (counts[:, REFUTED] == 0)
    near = np.flatnonzero(open_ & (best[:, UP] <= MEETING))
    for k in near[:MOST_MEETINGS].tolist():
        if deadline.passed:
            break
        asked = erring_pair(problem, trajectory, proof.pairs[k], ErrorBox())
        middle = 0.5 * (best[k, OWN:OTHER] + best[k, OTHER:])
        moments = best[k, AT_UPPER] + best[k, TIME] + BESIDE
        moments = np.clip(moments, 0.0, trajectory.n_samples - 1.0)
        for moment, q in zip(moments.tolist(), asked.rows(moments), strict=True):
            radius, centre = asked.common_ball(q, middle)
            if radius > 0.0:
                interval = min(int(moment), proof.n_intervals - 1)
                best[k, UP:OWN] = -radius, interval, moment - interval
                best[k, OWN:] = np.tile(centre, 2)
                counts[k] += np.eye(3, dtype=np.int64)[REFUTED]
                counts[k, UNDECIDED] -= 1
                break
    return replace(proof, counts=frozen(counts, np.int64), best=frozen(best))


def of_best(row: FloatArray) -> tuple[Moment, ...]:
    """Where the search of a pair starts, by its best row (`proof.layouts`)."""
    return moments_of(Moment(int(row[AT_UPPER]), float(row[TIME])), int(row[AT_LOWER]))


def find_counterexamples(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    proof: ClearanceProof,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Counterexample, ...]:
    """Motions within the box that miss what the proof left undecided.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The nominal motion.
        errors: The box.
        proof: The proof for it.
        deadline: When to give up.

    Returns:
        One against obstacles and one between links, at most; none where the nominal
        motion itself is refuted.

    Raises:
        OutOfTime: If the time is over.
    """
    if errors == ErrorBox():
        return ()
    lost, left = (proof.counts[:, k] > 0 for k in (REFUTED, UNDECIDED))
    return counterexamples(
        proof.pairs,
        np.select([lost, left], [REFUTED, UNDECIDED], CERTIFIED),
        proof.best[:, LOW],
        lambda k: erring_pair(problem, trajectory, proof.pairs[k], errors),
        lambda k: of_best(proof.best[k]),
        deadline,
    )
