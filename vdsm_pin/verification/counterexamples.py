"""What the proof under errors leaves undecided, as the search asks it."""

from dataclasses import replace

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.counterexample import (
    ErringPair,
    Moment,
    counterexamples,
    grown_by,
    moments_of,
)
from vdsm_pin.verification.moving import Knots
from vdsm_pin.verification.records import Counterexample


def erring_pair(motion: AskedMotion, number: int) -> ErringPair:
    """What is asked of a pair, by its number."""
    asked, errors = motion.asked, motion.errors
    pair, (one, other) = asked.pair(number), asked.sides(number)
    sizes, own = np.zeros(asked.tree.n_columns), asked.column_errors(errors)
    sizes[: own.size] = own
    return ErringPair(
        pair=pair,
        tree=asked.tree,
        bodies=(asked.bodies[one], asked.bodies[other]),
        required=float(asked.table.required[number]),
        rows=motion.rows,
        sizes=sizes,
        grown=grown_by(errors, pair),
        n_joints=own.size,
        ball=asked.ball(number),
    )


def starts(least: LeastClearances, weakest: IntArray, k: int) -> tuple[Moment, ...]:
    """Where the search of a pair starts.

    Args:
        least: What is proved.
        weakest: Of each pair the interval of its least lower bound, shape (n_pairs,).
        k: The pair.
    """
    nearest = Moment(int(least.interval[k]), float(least.share[k]))
    return moments_of(nearest, int(weakest[k]))


def find_counterexamples(
    motion: AskedMotion,
    least: LeastClearances,
    weakest: IntArray,
    deadline: Deadline,
) -> tuple[Counterexample, ...]:
    """Motions within the errors that miss what the proof left undecided.

    Args:
        motion: What is asked.
        least: What is proved of it, in intervals of its trajectory.
        weakest: Of each pair the interval of its least lower bound, shape (n_pairs,).
        deadline: When to give up.

    Returns:
        One against obstacles and one between links, at most; none where the nominal
        motion itself is refuted.

    Raises:
        OutOfTime: If the time is over.
    """
    if motion.errors == ErrorBox():
        return ()
    return counterexamples(
        motion.asked.pairs,
        least.verdict,
        least.lower,
        lambda k: erring_pair(motion, k),
        lambda k: starts(least, weakest, k),
        deadline,
    )


def in_rows(
    found: tuple[Counterexample, ...], knots: Knots
) -> tuple[Counterexample, ...]:
    """The same, their moments in intervals of the trajectory."""
    if knots.are_rows:
        return found
    inner = np.array([one.interval for one in found], np.int64)
    shares = knots.share(inner, np.array([one.share for one in found]))
    rows = zip(found, knots.interval(inner).tolist(), shares.tolist(), strict=True)
    return tuple(replace(one, interval=k, share=share) for one, k, share in rows)
