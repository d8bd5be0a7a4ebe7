"""Proofs of stretches of one motion, one after the other, by one task."""

from math import floor
from typing import Final

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.kernels import NEAR, NORMAL
from vdsm_pin.proof.layouts import (
    AT_LOWER,
    AT_UPPER,
    END,
    HELD_CLEARANCE,
    INTERVAL,
    KEY,
    KNOWN,
    LOW,
    MET,
    MET_AT,
    OWN,
    PAIR,
    SLICE,
    START,
    SUPPORT,
    TIME,
    UP,
)
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.proofs import Proof, summed
from vdsm_pin.proof.proving import Proving, dense_rows
from vdsm_pin.proof.search import Slicing, new_witness, resolve
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.witnesses import place_witness
from vdsm_pin.proof.workspace import Workspace

MOST_BRACKETS: Final = 500_000
"""Brackets of intervals that are held at once."""


class Stretches:
    """A motion of which stretches are asked about.

    Args:
        proving: Of the whole motion.
        pairs: Numbers of the pairs that are asked about within intervals; the others
            are known to be certified.
    """

    def __init__(self, proving: Proving, pairs: IntArray) -> None:
        self._proving, self._pairs = proving, pairs

    def over(self, low: float, high: float) -> Proof:
        """What is proved of every pair between two moments, no bracket narrowed.

        Args:
            low: In knots of the path, as 1.25 is a quarter of the way from 1 to 2.
            high: Not before; both may be one moment.
        """
        proving = self._proving
        results = proving.new_results()
        if low == floor(low) < high == floor(high):
            return proving.fresh(results).judge(int(low), int(high))
        slices = _slices(low, high, proving.n_intervals)
        asked = proving.task, proving.motion, proving.work, self._pairs
        _judge_slices(*asked, results.best, results.counts, slices)
        return summed(results, proving.plan, True)

    def each(self) -> tuple[IntArray, FloatArray] | None:
        """What is proved of every interval by itself.

        Returns:
            Verdicts and upper bounds, shape (n_intervals, n_pairs) each; [m]. None
            where they are more than `MOST_BRACKETS`, or the time ended before.
        """
        n_intervals, n_pairs = self._proving.n_intervals, self._proving.n_pairs
        if n_intervals * n_pairs > MOST_BRACKETS:
            return None
        dense = dense_rows(n_intervals, n_pairs)
        results = self._proving.new_results()._replace(dense=dense)
        if not self._proving.fresh(results).sweep(0, n_intervals):
            return None
        return dense.verdict, dense.upper


def _slices(low: float, high: float, n_intervals: int) -> FloatArray:
    """Intervals, and from when to when in each, shape (n, 3)."""
    first = min(floor(low), n_intervals - 1)
    last = max(first + 1, int(np.ceil(high)))
    k = np.arange(float(first), last)
    return np.stack([k, np.maximum(low - k, 0.0), np.minimum(high - k, 1.0)], axis=1)


@compiled
def _judge_slices(
    task: Task,
    motion: Motion,
    work: Workspace,
    pairs: IntArray,
    best: FloatArray,
    counts: IntArray,
    slices: FloatArray,
) -> None:
    """Decide some pairs over some slices, each as a whole of its own.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        work: Working space; what the pairs remember is carried on.
        pairs: Their numbers, shape (m,).
        best: Least bounds of each pair, nothing found yet, shape (n_pairs, BEST).
        counts: Slices of each pair by verdict, shape (n_pairs, 3).
        slices: Interval, start and end of each, shape (n, 3).
    """
    task, motion, work = borrowed(task), borrowed(motion), borrowed(work)
    row, space = np.zeros(SLICE), work.space
    slicing = Slicing(task, motion, work.ends, space)
    for pair in pairs:
        least, plane = best[pair], work.planes[pair]
        for k in range(slices.shape[0]):
            row[INTERVAL], row[PAIR] = slices[k, 0], pair
            row[START], row[END], row[KEY] = slices[k, 1], slices[k, 2], -np.inf
            witness = new_witness()
            witness.value[KNOWN] = least[UP]
            space.out[NORMAL:NEAR] = plane[:3]
            verdict, _ = resolve(slicing, work.heap, row, witness)
            plane[:3] = space.out[NORMAL:NEAR]
            counts[pair, verdict] += 1
            if row[KEY] < least[LOW]:
                least[LOW], least[AT_LOWER] = row[KEY], slices[k, 0]
            if witness.value[MET] < least[UP]:
                least[UP], least[AT_UPPER] = witness.value[MET], slices[k, 0]
                least[TIME], least[OWN:] = witness.value[MET_AT], witness.points
        # The support that is remembered is of another direction.
        plane[SUPPORT] = plane[HELD_CLEARANCE] = -np.inf
        place_witness(task, motion, work.ends, pair, least)
