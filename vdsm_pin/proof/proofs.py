"""What was proved of each pair, and how it is summed up."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.proof.layouts import AT_LOWER, AT_UPPER, LOW, OWN, TIME, UP
from vdsm_pin.proof.parts import PartPlan
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED

RANK: Final = np.array([0, 2, 1])
"""Of verdicts, the worst last: refuted, before it undecided; its own inverse."""


@dataclass(frozen=True)
class Proof:
    """What was proved of each pair, in the order asked.

    Args:
        verdict: CERTIFIED, REFUTED or UNDECIDED, shape (n_pairs,).
        lower: The clearance that is proved at every time, shape (n_pairs,); within
            `TOLERANCES.least_bracket` of `upper` for the nearest pair, within a part of
            the clearance for others; [m].
        upper: Clearance at the witness, below zero where the bodies meet, the depth as
            deep as is measured, shape (n_pairs,); [m].
        lower_interval: Interval of the least lower bound, shape (n_pairs,).
        interval: Interval of the witness, shape (n_pairs,).
        share: When in that interval, 0 to 1, shape (n_pairs,).
        points: Witnesses on the first and on the second body, in the world's frame,
            shape (n_pairs, 2, 3); [m].
        counts: Intervals of it certified, refuted and undecided, (n_pairs, 3).
        in_time: Whether there was time for all; what is not judged is undecided.
        profile: Least lower and upper bounds by column in each bin of intervals, shape
            (2, n_columns, n_bins); [m].
        stride: Intervals of a bin.
    """

    verdict: IntArray
    lower: FloatArray
    upper: FloatArray
    lower_interval: IntArray
    interval: IntArray
    share: FloatArray
    points: FloatArray
    counts: IntArray
    in_time: bool
    profile: FloatArray
    stride: int

    @property
    def is_certified(self) -> bool:
        """Whether every pair is; never of no pairs."""
        return bool(self.verdict.size and (self.verdict == CERTIFIED).all())


def verdicts_of(counts: IntArray) -> IntArray:
    """Of each pair the worst, by how often it has each one, shape (n_pairs, 3)."""
    found = np.where(counts[:, UNDECIDED] > 0, UNDECIDED, CERTIFIED)
    found[counts[:, REFUTED] > 0] = REFUTED
    return frozen(found, np.int64)


def summed(results: Results, plan: PartPlan, in_time: bool) -> Proof:
    """What was proved of the parts of all pairs, summed up by pair."""
    best, owner, n = results.best, plan.owner, plan.n_pairs
    judged, least = results.counts, np.arange(n)
    met = least
    if len(owner) > n:  # pairs of several parts
        first = np.searchsorted(owner, least)
        judged = np.add.reduceat(judged, first)
        least, met = (np.lexsort((best[:, side], owner))[first] for side in (LOW, UP))
    points = best[met, OWN:].reshape(-1, 2, 3)
    turned = plan.swapped[met]
    points[turned] = points[turned, ::-1]
    return Proof(
        verdict=verdicts_of(judged),
        lower=frozen(best[least, LOW]),
        upper=frozen(best[met, UP]),
        lower_interval=frozen(best[least, AT_LOWER], np.int64),
        interval=frozen(best[met, AT_UPPER], np.int64),
        share=frozen(best[met, TIME]),
        points=frozen(points),
        counts=frozen(judged, np.int64),
        in_time=in_time,
        profile=frozen(results.profile),
        stride=results.stride,
    )
