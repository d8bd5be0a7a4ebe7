"""The least clearance of every pair of a cell, and a ball in both where they meet."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.proof.bodies import Pair as BodyPair
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import Proof
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.robots.cell import Cell
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.contacts import BESIDE, MEETING, common_ball
from vdsm_pin.verification.moving import Knots


def least_clearances(
    cell: Cell,
    pairs: Sequence[BodyPair],
    path: Path,
    proof: Proof,
    enough: float = np.inf,
    span: FloatArray | None = None,
) -> LeastClearances:
    """What a proof says of some pairs, the witness on the link first.

    Where a ball is proved to lie in both bodies they are refuted, and so deep.

    Args:
        cell: Robot and scene.
        pairs: The pairs.
        path: Of all that moves.
        proof: Of them along it.
        enough: No ball deeper than this is looked for; [m].
        span: From when to when it is, in knots of the path; None for all of it.
    """
    span = np.array([0.0, path.n_intervals]) if span is None else span
    return _met(cell, pairs, path, _least(cell, pairs, proof), enough, span)


def _least(cell: Cell, pairs: Sequence[BodyPair], proof: Proof) -> LeastClearances:
    outer = np.array([pair.one >= len(cell.robot.bodies) for pair in pairs], bool)
    points = proof.points.copy()
    points[outer] = points[outer, ::-1]
    return LeastClearances(
        interval=proof.interval,
        share=proof.share,
        lower=proof.lower,
        upper=proof.upper,
        verdict=proof.verdict,
        link_point=frozen(points[:, 0]),
        other_point=frozen(points[:, 1]),
    )


def _met(
    cell: Cell,
    pairs: Sequence[BodyPair],
    path: Path,
    least: LeastClearances,
    enough: float,
    span: FloatArray,
) -> LeastClearances:
    """The same, with the balls in both bodies that are deeper than what is proved."""
    near = (least.verdict != CERTIFIED) & (least.upper <= MEETING)
    changed = dict[int, tuple[Any, ...]]()
    beside = min(1.0, span[1] - span[0]) * BESIDE
    for k in np.flatnonzero(near).tolist():
        moment = least.interval[k] + least.share[k]
        middle = 0.5 * (least.link_point[k] + least.other_point[k])
        moments = np.clip(moment + beside, *span)
        intervals, shares = path.split(moments)
        poses = cell.poses(path.within(intervals, shares))
        for at, pose in enumerate(poses):
            bodies = cell.placed(pairs[k], pose)
            radius, centre = common_ball(*bodies, middle, enough)
            if radius > max(0.0, -float(least.upper[k])):
                when = intervals[at], shares[at], least.lower[k]
                changed[k] = *when, -radius, REFUTED, centre, centre
                break
    return least.with_rows(changed)


def least_in_rows(least: LeastClearances, knots: Knots) -> LeastClearances:
    """The same, its moments in intervals of the robot's own path."""
    if knots.are_rows:
        return least
    share = knots.share(least.interval, least.share)
    return replace(least, interval=knots.interval(least.interval), share=share)
