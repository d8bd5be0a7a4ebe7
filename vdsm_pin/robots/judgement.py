"""The judgement of a robot's trajectory: every check, one row each."""

from dataclasses import dataclass, fields, replace
from math import inf, nan
from typing import Final

import numpy as np

from vdsm_pin.errors import OutOfTime, VdsmError
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import Proof, prove
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.contacts import common_ball
from vdsm_pin.robots.errors import proof_box
from vdsm_pin.robots.inside import by_mesh, enclosed, enclosed_profile, locate_links
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.rates import rate_checks
from vdsm_pin.robots.second_opinion import pose_difference
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.clearance import profile_of
from vdsm_pin.verification.inside import LINKS as INSIDE
from vdsm_pin.verification.inside import check_inside
from vdsm_pin.verification.moving import Knots, path_beside
from vdsm_pin.verification.records import (
    Check,
    ClosestApproach,
    LeastClearances,
    Pair,
    Verdict,
    Verification,
)

POSES: Final = "link poses by Pinocchio against the tree's"
LIMITS: Final = "joint {name!r} in its limits"
OBSTACLES: Final = "clearance from obstacles"
LINKS: Final = "clearance between links"
COAL: Final = "distances by Coal against the proved brackets"
POSE_ERROR: Final = 1e-9
"""Where Pinocchio and the tree must agree; [m] or, of rotations, [-]."""

MEETING: Final = 2.0 * TOLERANCES.bracket_gap
"""Bodies that come so near may meet; [m]."""

BESIDE: Final = (0.0, 0.01, -0.01, 0.05, -0.05)
"""Where a ball in both is looked for, beside the moment at which bodies meet; [-]."""

COMPARED: Final = 1000
"""Most waypoints at which poses are compared, spread evenly."""

POINTS: Final = ("link_point", "other_point")

CLOSEST: Final = 10
"""Pairs listed as the closest approaches."""


@dataclass(frozen=True, repr=False, kw_only=True)
class RobotVerification(Verification):
    """The judgement of one trajectory of a robot.

    Args:
        problem: The robot, its obstacles, the clearances asked for.
        trajectory: What was judged.
        least: The least clearance of every pair.
        notes: Of the trajectory's file, a sentence each.
    """

    problem: Cell
    trajectory: Path
    least: LeastClearances
    notes: tuple[str, ...] = ()


def verify_robot(
    cell: Cell, path: Path, deadline: Deadline = NO_LIMIT
) -> RobotVerification:
    """The judgement of a motion; what is not judged in time is undecided."""
    robot = cell.robot
    columns, budget = np.arange(len(cell.bodies)), Budget(until=deadline.end)
    box = proof_box(robot, cell.scene, cell.errors)
    whole, knots = path_beside(path, cell.scene)
    proof = prove(cell.tree, cell.bodies, whole, cell.pairs, box, budget, columns)
    located = locate_links(cell, whole, box, budget)
    named, least = _named(cell), _met(cell, whole, _least(cell, proof))
    coal, measured = _coal(cell, whole, proof, knots)
    least = _told(enclosed(least, located), knots)
    profile = profile_of(proof.profile, proof.stride, knots, len(robot.bodies))
    late = "" if proof.in_time else f": {OutOfTime(deadline.limit)}"
    checks = [
        _poses(robot, path),
        *_limits(robot, path),
        *rate_checks(robot.joints, path),
        *check_inside(by_mesh(cell, located), INSIDE),
        *_clearances(cell, named, least, late),
        coal,
    ]
    return RobotVerification(
        problem=cell,
        trajectory=path,
        errors=cell.errors,
        pairs=named,
        checks=tuple(checks),
        approaches=_closest(named, least, measured),
        profile=enclosed_profile(profile, cell, located),
        least=least,
        time_limit=deadline.limit,
    )


def _named(cell: Cell) -> tuple[Pair, ...]:
    """The pairs by the names of their bodies, a link first."""
    n, found = len(cell.robot.bodies), []
    for pair in cell.pairs:
        one, other = cell.bodies[pair.one].name, cell.bodies[pair.other].name
        if pair.one >= n:
            found.append(Pair(link=pair.other + 1, obstacle=one, body=other))
        else:
            found.append(
                Pair(
                    link=pair.one + 1,
                    other_link=pair.other + 1,
                    body=one,
                    other_body=other,
                )
            )
    return tuple(found)


def _least(cell: Cell, proof: Proof) -> LeastClearances:
    """The least clearances, the witness on the link first."""
    outer = np.array([pair.one >= len(cell.robot.bodies) for pair in cell.pairs], bool)
    points = proof.points.copy()
    points[outer] = points[outer, ::-1]
    return LeastClearances(
        interval=proof.interval,
        time=proof.share,
        lower=proof.lower,
        upper=proof.upper,
        verdict=proof.verdict,
        link_point=frozen(points[:, 0]),
        other_point=frozen(points[:, 1]),
    )


def _told(least: LeastClearances, knots: Knots) -> LeastClearances:
    """The same, its moments in intervals of the robot's own path."""
    if knots.are_rows:
        return least
    time = knots.share(least.interval, least.time)
    return replace(least, interval=knots.interval(least.interval), time=time)


def _met(cell: Cell, path: Path, least: LeastClearances) -> LeastClearances:
    """The same, refuted and so deep where a ball is proved to lie in both bodies."""
    near = (least.verdict != CERTIFIED) & (least.upper <= MEETING)
    changed = {one.name: getattr(least, one.name).copy() for one in fields(least)}
    for k in np.flatnonzero(near):
        moment = least.interval[k] + least.time[k]
        middle = 0.5 * (least.link_point[k] + least.other_point[k])
        moments = np.clip(moment + np.array(BESIDE), 0.0, path.n_intervals)
        intervals = np.minimum(moments.astype(np.int64), path.n_intervals - 1)
        shares = moments - intervals
        poses = cell.poses(path.within(intervals, shares))
        for at, pose in enumerate(poses):
            bodies = cell.coal.pieces(cell.pairs[k], pose)
            radius, centre = common_ball(*bodies, middle)
            if radius > 0.0:
                found = intervals[at], shares[at], -radius, REFUTED, centre, centre
                names = "interval", "time", "upper", "verdict", *POINTS
                for name, value in zip(names, found, strict=True):
                    changed[name][k] = value
                break
    return LeastClearances(**changed)


def _closest(
    pairs: tuple[Pair, ...], least: LeastClearances, coal: FloatArray
) -> tuple[ClosestApproach, ...]:
    """The pairs that come nearest, by their upper bounds; obstacles first."""
    of_links = np.array([not pair.obstacle for pair in pairs], bool)
    seen = np.flatnonzero(np.isfinite(least.upper))
    order = seen[np.lexsort((least.upper[seen], of_links[seen]))]
    return tuple(
        ClosestApproach(
            interval=int(least.interval[k]),
            share=float(least.time[k]),
            pair=pairs[k],
            lower=float(least.lower[k]),
            upper=float(least.upper[k]),
            station=nan,
            link_point=least.link_point[k],
            other_point=least.other_point[k],
            deeper=bool(least.verdict[k] == REFUTED and least.upper[k] <= MEETING),
            coal=float(coal[k]),
        )
        for k in order[:CLOSEST]
    )


def _poses(robot: Robot, path: Path) -> Check:
    step = -(-len(path.knots) // COMPARED)
    rows = np.arange(0, len(path.knots), step)
    try:
        off = pose_difference(robot, path.knots[rows])
    except VdsmError as error:
        where = f"not done: {error}"
        return Check(POSES, Verdict.UNDECIDED, 0, nan, POSE_ERROR, "-", where)
    k = int(np.argmax(off))
    good = bool((off <= POSE_ERROR).all())
    verdict = Verdict.CERTIFIED if good else Verdict.REFUTED
    where = f"{len(robot.frames)} links at {len(rows)} of {len(path.knots)} waypoints"
    count = len(rows) * len(robot.frames)
    return Check(
        POSES, verdict, count, float(off[k]), POSE_ERROR, "-", where, float(rows[k])
    )


def _limits(robot: Robot, path: Path) -> list[Check]:
    """A row for each joint with limits; the control points hold what lies between."""
    checks = []
    slack = TOLERANCES.arithmetic
    for k, joint in enumerate(robot.joints):
        if not np.isfinite([joint.lower, joint.upper]).all():
            continue
        past = np.maximum(
            path.knots[:, k] - joint.upper, joint.lower - path.knots[:, k]
        )
        between = path.controls[..., k]
        all_past = np.maximum(between - joint.upper, joint.lower - between)
        row = int(np.argmax(past))
        verdict = Verdict.CERTIFIED
        if not (past <= slack).all():
            verdict = Verdict.REFUTED
        elif not (all_past <= slack).all():
            verdict = Verdict.UNDECIDED
        upper = path.knots[row, k] - joint.upper >= joint.lower - path.knots[row, k]
        checks.append(
            Check(
                LIMITS.format(name=joint.name),
                verdict,
                len(past),
                float(path.knots[row, k]),
                joint.upper if upper else joint.lower,
                "rad" if joint.turns else "m",
                moment=float(row),
            )
        )
    return checks


def _clearances(
    cell: Cell, pairs: tuple[Pair, ...], least: LeastClearances, late: str
) -> list[Check]:
    rows, outer = [], np.array([bool(pair.obstacle) for pair in pairs], bool)
    moments = least.interval + least.time
    for name, mine, needed in (
        (OBSTACLES, np.flatnonzero(outer), cell.required_clearance),
        (LINKS, np.flatnonzero(~outer), cell.required_self_clearance),
    ):
        if not mine.size:
            continue
        lost, left = (least.verdict[mine] == v for v in (REFUTED, UNDECIDED))
        verdict = Verdict.UNDECIDED if left.any() else Verdict.CERTIFIED
        # A refuted motion is as bad as its witness, another one as good as its proof.
        values = least.lower[mine]
        if lost.any():
            verdict = Verdict.REFUTED
            values = np.where(lost, least.upper[mine], np.inf)
        k = int(mine[np.argmin(values)])
        where = str(pairs[k])
        if left.any():
            where += f"; {int(left.sum())} of {mine.size} pairs undecided{late}"
        moment = float(moments[k]) if np.isfinite(least.upper[k]) else nan
        worst = float(values.min())
        meet = bool(lost.any() and worst <= MEETING)
        row = Check(name, verdict, mine.size, worst, needed, "m", where, moment)
        rows.append(replace(row, deeper=meet))
    return rows


def _coal(
    cell: Cell, path: Path, proof: Proof, knots: Knots
) -> tuple[Check, FloatArray]:
    """Coal's distance of each pair at its witness, which the bracket must hold.

    Args:
        cell: Robot and scene.
        path: Of all that moves.
        proof: Of the pairs along it.
        knots: Those of the robot's own path.

    Returns:
        The check, and the distances, NaN where there is none, shape (n_pairs,); [m].
    """
    found = np.full(len(cell.pairs), nan)
    seen = np.flatnonzero(np.isfinite(proof.upper))
    poses = cell.poses(path.within(proof.interval[seen], proof.share[seen]))
    found[seen] = cell.coal.distances([cell.pairs[k] for k in seen], poses)
    # Where bodies meet only the sign counts, on both sides.
    value = np.maximum(found, 0.0)
    low, high = np.maximum(proof.lower, 0.0), np.maximum(proof.upper, 0.0)
    off = np.maximum(low - value, value - high)
    off[np.isinf(found)] = inf
    measured = ~np.isnan(found)
    count = int(measured.sum())
    k = int(np.argmax(np.where(measured, off, -inf))) if count else 0
    agreed = count > 0 and off[k] <= TOLERANCES.coal_agreement
    check = Check(
        COAL,
        Verdict.CERTIFIED if agreed else Verdict.UNDECIDED,
        count,
        float(off[k]) if count else nan,
        TOLERANCES.coal_agreement,
        "m",
        f"{count} of {len(cell.pairs)} pairs measured, each where it was found nearest",
        float(knots.moments(proof.interval, proof.share)[k]) if count else nan,
    )
    return check, found
