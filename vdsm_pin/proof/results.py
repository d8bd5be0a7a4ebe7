"""Where a sweep writes: least bounds, counts, profile, candidates, dense rows."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.proof.layouts import (
    AT_LOWER,
    AT_UPPER,
    CANDIDATES,
    LOST,
    LOW,
    OWN,
    TIME,
    UP,
)
from vdsm_pin.proof.plane_bounds import Runs
from vdsm_pin.proof.terms import UNDECIDED, Task


class Candidates(NamedTuple):
    """Blocks of one pair that may hold the least bound.

    Args:
        lower: Least lower bound over the block, shape (room,); [m].
        first: First interval of the block, shape (room,).
        size: Intervals in it, shape (room,).
        pair: The pair, shape (room,).
    """

    lower: FloatArray
    first: IntArray
    size: IntArray
    pair: IntArray


class Dense(NamedTuple):
    """Brackets of every interval and pair, or arrays of no rows if nobody wants them.

    Args:
        lower: Shape (m, n_pairs); [m].
        upper: Shape (m, n_pairs); [m].
        time: Place of the upper bounds in their intervals, shape (m, n_pairs).
        verdict: Shape (m, n_pairs).
        own: Witnesses on the links, base frame, shape (m, n_pairs, 3); [m].
        other: Witnesses on the partners, shape (m, n_pairs, 3); [m].
    """

    lower: FloatArray
    upper: FloatArray
    time: FloatArray
    verdict: IntArray
    own: FloatArray
    other: FloatArray


class Results(NamedTuple):
    """Where a sweep writes.

    Args:
        best: Least bounds of each pair, shape (n_pairs, BEST).
        counts: Intervals of each pair by verdict, shape (n_pairs, 3).
        profile: Lower and upper bounds by column, of bodies and partners, in each bin,
            shape (2, n_columns, n_bins); [m].
        stride: Intervals per bin.
        limit: Least bound that some instant cannot pass, by group, shape (2,); [m].
        candidates: Blocks that may hold the least bound.
        overflow: Least bounds of candidates that found no room, shape (2,); [m].
        tally: What is counted, shape (TALLY,).
        dense: Dense rows.
    """

    best: FloatArray
    counts: IntArray
    profile: FloatArray
    stride: int
    limit: FloatArray
    candidates: Candidates
    overflow: FloatArray
    tally: IntArray
    dense: Dense


@compiled
def any_below(values: FloatArray, bar: float) -> bool:
    """Whether a value is below the bar."""
    below = 0
    for k in range(values.size):
        below |= values[k] < bar
    return below != 0


@compiled
def _least(values: FloatArray) -> int:
    """Number of the least value."""
    at = 0
    for k in range(1, values.size):
        if values[k] < values[at]:
            at = k
    return at


@compiled
def note_upper(
    best: FloatArray, runs: Runs, points: FloatArray, start: int, first: int, last: int
) -> None:
    """Keep the least upper bound of intervals that one witness bounds.

    Args:
        best: The pair's, shape (BEST,).
        runs: The bounds of the block.
        points: The witnesses on the body and on the partner, shape (6,); [m].
        start: First interval of the block.
        first: First interval, counted in the block.
        last: One past the last.
    """
    upper, at_rows = runs.upper[first:last], runs.at_rows
    if any_below(upper, best[UP]):
        at = first + _least(upper)
        later = 1.0 if at_rows[at + 1] < at_rows[at] else 0.0
        best[UP], best[AT_UPPER], best[TIME] = runs.upper[at], start + at, later
        best[OWN:] = points


@compiled(inline=False)
def _drop_candidates(task: Task, results: Results) -> None:
    """Drop the candidates that can no longer hold the least bound."""
    held, kept = results.candidates, 0
    for k in range(results.tally[CANDIDATES]):
        group = task.pairs.group[held.pair[k]]
        if held.lower[k] < results.limit[group] - task.rules.gap:
            held.lower[kept], held.first[kept] = held.lower[k], held.first[k]
            held.size[kept], held.pair[kept] = held.size[k], held.pair[k]
            kept += 1
    results.tally[CANDIDATES] = kept


@compiled(inline=False)
def nominate(
    task: Task, results: Results, pair: int, first: int, lower: FloatArray
) -> None:
    """Remember a block of a pair whose least bound is below the limit.

    Args:
        task: The scene, pairs and rules.
        results: Where to.
        pair: The pair.
        first: First interval of the block.
        lower: Lower bounds of its intervals, shape (count,); [m].
    """
    held, room = results.candidates, results.candidates.lower.size
    least = lower[_least(lower)]
    if results.tally[CANDIDATES] == room:
        # Not each time: where nothing can be dropped that would take for ever.
        if results.tally[LOST] % max(1, room // 4) == 0:
            _drop_candidates(task, results)
        results.tally[LOST] += 1
    at = results.tally[CANDIDATES]
    if at == room:
        group = task.pairs.group[pair]
        results.overflow[group] = min(results.overflow[group], least)
        return
    held.lower[at], held.first[at], held.size[at] = least, first, lower.size
    held.pair[at] = pair
    results.tally[CANDIDATES] = at + 1


@compiled
def _lower_column(
    column: FloatArray, stride: int, values: FloatArray, first: int
) -> None:
    """Lower one column of the profile to the bounds of consecutive intervals."""
    if stride == 1:
        part = column[first : first + values.size]
        for r in range(part.size):
            part[r] = part[r] if part[r] < values[r] else values[r]
        return
    for r in range(values.size):
        at = (first + r) // stride
        column[at] = min(column[at], values[r])


@compiled
def note_block(
    task: Task,
    results: Results,
    pair: int,
    first: int,
    lower: FloatArray,
    upper: FloatArray,
) -> None:
    """Record the bounds of a pair over a block, but for the least upper one.

    Args:
        task: The pairs.
        results: Where to.
        pair: The pair.
        first: First interval of the block.
        lower: Lower bounds of the intervals, shape (count,); [m].
        upper: Upper bounds, shape (count,); [m].
    """
    pairs, best = task.pairs, results.best[pair]
    profile, stride = results.profile, results.stride
    column, own = pairs.column[pair], task.bodies.column[pairs.body[pair]]
    if column >= 0:
        _lower_column(profile[0, own], stride, lower, first)
        _lower_column(profile[1, own], stride, upper, first)
        _lower_column(profile[0, column], stride, lower, first)
        _lower_column(profile[1, column], stride, upper, first)
    if any_below(lower, best[LOW]):
        at = _least(lower)
        best[LOW], best[AT_LOWER] = lower[at], first + at
    if any_below(lower, results.limit[pairs.group[pair]] - task.rules.gap):
        nominate(task, results, pair, first, lower)


@compiled(inline=False)
def count_the_rest(results: Results, n_intervals: int) -> None:
    """Count as undecided what the time did not allow to judge of n_intervals."""
    for pair in range(results.counts.shape[0]):
        counts = results.counts[pair]
        left = n_intervals - counts.sum()
        if left != 0:
            counts[UNDECIDED] += left
            results.best[pair, LOW] = -np.inf
            results.profile[0] = -np.inf
