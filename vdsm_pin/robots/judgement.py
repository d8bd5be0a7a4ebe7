"""The judgement of a robot's trajectory: every check, one row each."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.robots.by_itself import checks_by_itself
from vdsm_pin.robots.cell import Cell
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.clearance import ClearanceProof, prove_motion
from vdsm_pin.verification.coal_check import CoalEvidence
from vdsm_pin.verification.coal_shapes import Sides, disagreement
from vdsm_pin.verification.inside import located
from vdsm_pin.verification.judgement import BestEffort, judge_clearance
from vdsm_pin.verification.limits import checks_of_others
from vdsm_pin.verification.records import Check, CheckKind, Verdict, Verification

NO_PAIR: Final = "no pair to check: no obstacle, no two links that are held apart"
WIDTH: Final = 0.4
"""Brackets wider than this part of the clearance are asked of a new plane; [-]."""

NEAR: Final = 0.02
"""Coal measures pairs that may come nearer than this beyond what is required; of others
wider brackets do; [m]."""


@dataclass(frozen=True, repr=False, kw_only=True)
class RobotVerification(Verification):
    """The judgement of one trajectory of a robot.

    Args:
        problem: The robot, its obstacles, the clearances asked for.
        trajectory: What was judged.
    """

    problem: Cell
    trajectory: JointTrajectory


def verify_robot(
    cell: Cell,
    trajectory: JointTrajectory,
    deadline: Deadline = NO_LIMIT,
    *,
    contacts: bool = True,
) -> RobotVerification:
    """The judgement of a motion; what is not judged in time is undecided.

    Args:
        cell: The robot, its obstacles, the clearances asked for.
        trajectory: Its columns are of the joints that move, in their order.
        deadline: When to give up what is left.
        contacts: Whether to look for when bodies first and last come too close.
    """
    path = trajectory.path
    motion = AskedMotion.of_robot(cell.asked, path, cell.errors)
    far = NEAR + max(cell.required_clearance, cell.required_self_clearance)
    budget, extras = Budget(until=deadline.end, slack=WIDTH, far=far), BestEffort()
    proof, places = prove_motion(motion, budget), located(motion, deadline)
    asked = cell, trajectory, proof.with_depths(deadline), places, extras, deadline
    found = judge_clearance(*asked, contacts=contacts)
    nearest = found.nearest
    coal, measured = _coal(cell, proof, [*nearest])
    checks = [
        *checks_by_itself(cell.robot, path),
        *checks_of_others(cell.scene),
        *found.checks,
        *([coal] if proof.pairs else [_no_pair(cell)]),
    ]
    return RobotVerification(
        problem=cell,
        trajectory=trajectory,
        pairs=proof.pairs,
        checks=tuple(checks),
        approaches=tuple(
            replace(one, coal=float(measured[k])) for k, one in nearest.items()
        ),
        profile=found.profile,
        least=found.least,
        counterexamples=found.counterexamples,
        nominal_clear=found.nominal_clear,
        not_done=tuple(extras.not_done),
        time_limit=deadline.limit,
    )


def _no_pair(cell: Cell) -> Check:
    """The row of a robot of which nothing is held apart."""
    needed = cell.required_self_clearance
    return Check(CheckKind.LINKS.value, Verdict.UNDECIDED, 0, nan, needed, "m", NO_PAIR)


def _coal(
    cell: Cell, proof: ClearanceProof, told: Sequence[int]
) -> tuple[Check, FloatArray]:
    """Coal's distance of each near pair at its witness, which the bracket must hold.

    Of a pair that is proved to keep farther off Coal's balls about its bodies must not
    contradict the bracket, where each is of one part.

    Args:
        cell: Robot and scene.
        proof: Of its pairs.
        told: Numbers of the pairs whose distance is told.

    Returns:
        The check, and the distances, NaN where there is none, shape (n_pairs,); [m].
    """
    asked, least, motion = cell.asked, proof.on_path, proof.motion
    table, found = asked.table, np.full(asked.table.size, nan)
    seen = np.flatnonzero(np.isfinite(least.upper))
    when = least.interval[seen] + least.share[seen]
    _, first, row = np.unique(when, return_index=True, return_inverse=True)
    at = seen[first]
    poses = asked.poses(motion.path.within(least.interval[at], least.share[at]))
    sides = cell.sides(table.one[seen], table.other[seen], row)
    lower, upper = least.lower[seen], least.upper[seen]
    low, high = cell.coal.between_balls(poses[:, :, :3], sides)
    listed = np.zeros(table.size, np.bool_)
    listed[told] = True
    close = (lower < table.required[seen] + NEAR) | np.isnan(low) | listed[seen]
    near = Sides(*(side[close] for side in sides))
    found[seen[close]] = cell.coal.distances(poses[:, :, :3], near)
    off = disagreement(found[seen], lower, upper)
    off[~close] = np.maximum(low - upper, lower - high)[~close]
    evidence = CoalEvidence(count=int((~np.isnan(found)).sum()))
    answered = np.flatnonzero(~np.isnan(off))
    if answered.size:
        worst = answered[np.argmax(off[answered])]
        k = seen[worst : worst + 1]
        (moment,) = motion.knots.moments(least.interval[k], least.share[k])
        evidence.add(float(off[worst]), "", float(moment))
    where = f"{evidence.count} of {table.size} pairs measured"
    untold = cell.coal.untold([body.name for body in asked.bodies])
    others = "" if close.all() else "; the others are far, by balls about the bodies"
    note = f"{where}, each where it was found nearest{others}{untold}"
    return evidence.check(note), found
