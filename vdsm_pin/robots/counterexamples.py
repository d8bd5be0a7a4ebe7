"""Configurations of a robot within its errors that miss a required clearance."""

from dataclasses import replace

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.proof.paths import Path
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.errors import joint_errors
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.counterexample import (
    ErringPair,
    Moment,
    counterexamples,
    grown_by,
    moments_of,
)
from vdsm_pin.verification.moving import Knots
from vdsm_pin.verification.records import Counterexample, Pair


def robot_counterexamples(
    cell: Cell,
    path: Path,
    pairs: tuple[Pair, ...],
    least: LeastClearances,
    weakest: IntArray,
    deadline: Deadline,
) -> tuple[Counterexample, ...]:
    """Motions within the errors that miss what the proof left undecided.

    Args:
        cell: Robot, scene, required clearances, errors.
        path: The nominal motion, and that of what moves beside.
        pairs: As the cell's, by their names.
        least: Their least clearances under the errors.
        weakest: Of each the interval of its least lower bound, shape (n_pairs,).
        deadline: When to give up.

    Raises:
        OutOfTime: If the time is over.
    """
    if cell.errors == ErrorBox():
        return ()

    def moments(k: int) -> tuple[Moment, ...]:
        nearest = Moment(int(least.interval[k]), float(least.share[k]))
        return moments_of(nearest, int(weakest[k]))

    return counterexamples(
        pairs,
        least.verdict,
        least.lower,
        lambda k: _erring_pair(cell, path, k, pairs[k]),
        moments,
        deadline,
    )


def _erring_pair(cell: Cell, path: Path, k: int, named: Pair) -> ErringPair:
    """Of a pair of the cell, the link first."""
    pair, tree = cell.pairs[k], cell.tree
    one, other = cell.bodies[pair.one], cell.bodies[pair.other]

    n, sizes = len(cell.robot.joints), np.zeros(tree.n_columns)
    sizes[:n] = joint_errors(cell.robot.joints, cell.errors)
    return ErringPair(
        pair=named,
        tree=tree,
        bodies=(other, one) if named.obstacle else (one, other),
        required=pair.required,
        rows=path.at_moments,
        sizes=sizes,
        grown=grown_by(cell.errors, named),
        n_joints=n,
    )


def in_rows(
    found: tuple[Counterexample, ...], knots: Knots
) -> tuple[Counterexample, ...]:
    """The same, their moments in intervals of the robot's own path."""
    if knots.are_rows:
        return found
    inner = np.array([one.interval for one in found], np.int64)
    shares = knots.share(inner, np.array([one.share for one in found]))
    rows = zip(found, knots.interval(inner).tolist(), shares.tolist(), strict=True)
    return tuple(replace(one, interval=k, share=share) for one, k, share in rows)
