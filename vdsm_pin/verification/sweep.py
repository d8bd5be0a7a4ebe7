"""One pass over consecutive intervals and all pairs, in compiled code.

Each pair keeps the plane and the witness point that served it last. Most intervals are
proved by that plane alone; a pair whose bracket grows too wide gets a new one; where
the bound misses the required clearance the interval is subdivided.
"""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import bends_and_drifts, place
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.verification.coasting import PLANE, RUN, SUPPORT
from vdsm_pin.verification.search import (
    END,
    INTERVAL,
    KEY,
    PAIR,
    SLICE,
    START,
    Motion,
    Task,
    bound_between,
    push,
    tighten,
)
from vdsm_pin.verification.slices import (
    BASE,
    Ends,
    Space,
    base_direction,
    new_space,
)

BLOCK: Final = 32
"""Intervals whose configurations are computed at once: they fit the cache."""

LOW: Final = 0
AT_LOWER: Final = 1
UP: Final = 2
AT_UPPER: Final = 3
TIME: Final = 4
OWN: Final = 5
OTHER: Final = 8
INSTANT: Final = 11
BEST: Final = 12
"""Layout of a pair's best row: lower bound and its interval, upper bound, its interval
and time, witnesses on the link and on the partner in the base frame, least bound
proved for one instant."""


class Results(NamedTuple):
    """Where a sweep writes.

    Args:
        best: Least bounds of each pair, shape (n_pairs, BEST).
        counts: Intervals of each pair by verdict, shape (n_pairs, 3).
        profile: Lower and upper bounds by link, then by obstacle, in each bin, shape
            (n_bins, 2, N + n_obstacles); [m].
        stride: Intervals per bin.
        limit: Least instant bound over the obstacles and over the links, shape (2,).
        gap: By how much the least bounds may miss it; [m].
        candidates: Slices that may hold the least bound, shape (cap, SLICE).
        tally: Number of candidates, slices tried, shape (2,).
        overflow: Least bounds of candidates that found no room, shape (2,); [m].
        numbers: Dense rows: lower, upper, time, witnesses (6), shape (m, n_pairs, 9),
            or (0, 0, 9) where nobody wants them.
        verdicts: Dense verdicts, shape (m, n_pairs) or (0, 0).
    """

    best: FloatArray
    counts: IntArray
    profile: FloatArray
    stride: int
    limit: FloatArray
    gap: float
    candidates: FloatArray
    tally: IntArray
    overflow: FloatArray
    numbers: FloatArray
    verdicts: IntArray


class Rows(NamedTuple):
    """Configurations of a block of rows and what lies between them."""

    centres: FloatArray
    frames: FloatArray
    bends: FloatArray
    drifts: FloatArray


class Desk(NamedTuple):
    """Working space of a sweep.

    Args:
        rows: The block.
        ends: For slices inside an interval.
        space: For bounds.
        heap: For subdivision; its length is the budget of one interval and pair.
        planes: What the pairs remember, shape (n_pairs, PLANE).
        runs: Bounds of the block's intervals for one pair, shape (BLOCK, RUN).
        verdicts: Their verdicts, shape (BLOCK,).
    """

    rows: Rows
    ends: Ends
    space: Space
    heap: FloatArray
    planes: FloatArray
    runs: FloatArray
    verdicts: IntArray


@compiled
def new_desk(n_links: int, n_pairs: int, budget: int) -> Desk:
    """Fresh working space; no pair remembers a plane yet."""
    apart()
    n = n_links
    rows = Rows(
        np.zeros((BLOCK + 1, n + 1, 3)),
        np.zeros((BLOCK + 1, n, 3, 3)),
        np.zeros((BLOCK, n + 1, n + 1)),
        np.zeros((BLOCK, n + 1, n + 1)),
    )
    ends = Ends(
        np.zeros((2, n + 1, 3)),
        np.zeros((2, n, 3, 3)),
        np.zeros((n + 1, n + 1)),
        np.zeros((n + 1, n + 1)),
    )
    planes = np.zeros((n_pairs, PLANE))
    planes[:, 0] = 1.0
    planes[:, SUPPORT] = -np.inf
    runs, verdicts = np.zeros((BLOCK, RUN)), np.zeros(BLOCK, np.int64)
    heap = np.zeros((budget, SLICE))
    return Desk(rows, ends, new_space(), heap, planes, runs, verdicts)


@compiled
def fill_rows(task: Task, motion: Motion, rows: Rows, first: int, count: int) -> None:
    """Configurations of rows first .. first + count; the last row may repeat."""
    apart()
    n_rows = motion.x0.size
    lengths = task.rules.lengths
    for r in range(count + 1):
        k = min(first + r, n_rows - 1)
        place(
            motion.x0[k],
            motion.alpha[k],
            motion.theta[k],
            lengths,
            rows.centres[r],
            rows.frames[r],
        )
    for r in range(count):
        if first + r + 1 < n_rows:
            k = first + r
            alpha, theta = motion.alpha[k : k + 2], motion.theta[k : k + 2]
            bends_and_drifts(alpha, theta, lengths, rows.bends[r], rows.drifts[r])
        else:
            rows.bends[r] = 0.0
            rows.drifts[r] = 0.0


@compiled
def surface_points(
    task: Task,
    centres: FloatArray,
    frames: FloatArray,
    frame: int,
    core: FloatArray,
    out: FloatArray,
) -> None:
    """Witnesses on both surfaces in the base frame, from the core points.

    Args:
        task: For the radius of the links.
        centres: Joint centres, shape (N + 1, 3); [m].
        frames: Link frames, shape (N, 3, 3); [-].
        frame: Frame of the partner.
        core: Point on the link's axis, then on the partner, shape (6,); [m].
        out: Result, shape (6,); [m].
    """
    apart()
    gap = 0.0
    for c in range(3):
        gap += (core[3 + c] - core[c]) ** 2
    gap = sqrt(gap)
    share = task.rules.radius / gap if gap > 0.0 else 0.0
    near, far = core[:3], core[3:6]
    base_direction(frames, frame, near + share * (far - near), out[:3])
    base_direction(frames, frame, far, out[3:6])
    if frame != BASE:
        for c in range(3):
            out[c] += centres[frame, c]
            out[3 + c] += centres[frame, c]


@compiled
def drop_candidates(task: Task, results: Results) -> None:
    """Drop the candidates that can no longer hold the least bound."""
    apart()
    kept = 0
    for k in range(results.tally[0]):
        pair = int(results.candidates[k, PAIR])
        group = 0 if task.pairs.frame[pair] == BASE else 1
        if results.candidates[k, KEY] < results.limit[group] - results.gap:
            results.candidates[kept] = results.candidates[k]
            kept += 1
    results.tally[0] = kept


@compiled
def nominate(
    task: Task, results: Results, k: int, pair: int, group: int, lower: float
) -> None:
    """Remember an interval whose lower bound is below the least instant bound."""
    apart()
    if results.tally[0] == results.candidates.shape[0]:
        drop_candidates(task, results)
    if results.tally[0] == results.candidates.shape[0]:
        results.overflow[group] = min(results.overflow[group], lower)
        return
    row = results.candidates[results.tally[0]]
    row[KEY], row[INTERVAL], row[PAIR] = lower, k, pair
    row[START], row[END] = 0.0, 1.0
    results.tally[0] += 1


@compiled
def _note_bests(
    best: FloatArray,
    counts: IntArray,
    runs: FloatArray,
    verdicts: IntArray,
    first: int,
    count: int,
) -> int:
    """Keep a pair's least bounds; the local number of a new least upper one, or -1."""
    at = -1
    for local in range(count):
        counts[verdicts[local]] += 1
        if runs[local, 0] < best[KEY]:
            best[KEY], best[AT_LOWER] = runs[local, 0], first + local
        if runs[local, 1] < best[UP]:
            best[UP], best[AT_UPPER] = runs[local, 1], first + local
            best[TIME] = runs[local, 2]
            at = local
    return at


@compiled
def _note_profile(
    profile: FloatArray,
    stride: int,
    column: int,
    runs: FloatArray,
    first: int,
    count: int,
) -> None:
    """Lower the profile's column to a pair's bounds."""
    for local in range(count):
        row = (first + local) // stride
        profile[row, 0, column] = min(profile[row, 0, column], runs[local, 0])
        profile[row, 1, column] = min(profile[row, 1, column], runs[local, 1])


@compiled
def _note_dense(
    task: Task,
    results: Results,
    rows: Rows,
    pair: int,
    runs: FloatArray,
    verdicts: IntArray,
    offset: int,
    count: int,
) -> None:
    """Write a pair's bounds to the dense rows."""
    for local in range(count):
        results.verdicts[offset + local, pair] = verdicts[local]
        row = results.numbers[offset + local, pair]
        row[:3] = runs[local, :3]
        _place_run(task, rows, pair, runs, local, row[3:9])


@compiled
def _place_run(
    task: Task, rows: Rows, pair: int, runs: FloatArray, local: int, out: FloatArray
) -> None:
    """Surface points of an interval's result in the base frame, shape (6,); [m]."""
    if runs[local, 9] > 0.0:
        out[:] = runs[local, 3:9]
        return
    row = local + int(runs[local, 2])
    frame, core = task.pairs.frame[pair], runs[local, 3:9]
    surface_points(task, rows.centres[row], rows.frames[row], frame, core, out)


@compiled
def note_block(
    task: Task,
    results: Results,
    rows: Rows,
    pair: int,
    runs: FloatArray,
    verdicts: IntArray,
    first: int,
    offset: int,
    count: int,
) -> None:
    """Record the brackets of one pair over a block.

    Args:
        task: The scene, pairs and rules.
        results: Where to.
        rows: Configurations of the block.
        pair: The pair.
        runs: Its bounds and witnesses, shape (>= count, RUN).
        verdicts: Its verdicts, shape (>= count,).
        first: First interval of the block.
        offset: Its row in the dense results.
        count: Intervals in the block.
    """
    apart()
    best, frame = results.best[pair], task.pairs.frame[pair]
    at = _note_bests(best, results.counts[pair], runs, verdicts, first, count)
    if at >= 0:
        _place_run(task, rows, pair, runs, at, best[OWN : OWN + 6])
    group = 0 if frame == BASE else 1
    bar = results.limit[group] - results.gap
    for local in range(count):
        if runs[local, 0] < bar:
            nominate(task, results, first + local, pair, group, runs[local, 0])
    if frame == BASE:
        profile, stride = results.profile, results.stride
        column = task.rules.lengths.size + task.pairs.obstacle[pair]
        link = task.pairs.link[pair]
        _note_profile(profile, stride, link, runs, first, count)
        _note_profile(profile, stride, column, runs, first, count)
    if results.verdicts.shape[0] > 0:
        _note_dense(task, results, rows, pair, runs, verdicts, offset, count)


@compiled
def place_witness(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    pair: int,
    found: FloatArray,
) -> None:
    """Make what the narrowing found the best upper bound of a pair.

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        desk: Working space.
        results: Where to.
        pair: The pair.
        found: Its row of the witnesses of `search.tighten`.
    """
    apart()
    row = np.zeros(SLICE)
    row[INTERVAL], row[PAIR], row[START], row[END] = found[1], pair, found[2], found[2]
    bound_between(task, motion, desk.ends, desk.space, row)
    best = results.best[pair]
    best[UP], best[AT_UPPER], best[TIME] = found[0], found[1], found[2]
    surface_points(
        task,
        desk.ends.centres[0],
        desk.ends.frames[0],
        task.pairs.frame[pair],
        found[3:9],
        best[OWN : OWN + 6],
    )


@compiled
def narrow(
    task: Task,
    motion: Motion,
    desk: Desk,
    results: Results,
    group: int,
    heap: FloatArray,
    witnesses: FloatArray,
) -> int:
    """Narrow the least bracket over the obstacles (group 0) or over the links (1).

    Args:
        task: The scene, pairs and rules.
        motion: Rows of joint values.
        desk: Working space.
        results: Holds the candidates; best upper bounds are improved.
        group: Which pairs.
        heap: Room for the candidates and the budget of slices.
        witnesses: As for `tighten`.

    Returns:
        Number of slices in the heap, 0 without candidates.
    """
    drop_candidates(task, results)
    count = 0
    for k in range(results.tally[0]):
        row = results.candidates[k]
        if (task.pairs.frame[int(row[PAIR])] == BASE) == (group == 0):
            count = push(heap, count, row)
    if count == 0:
        return 0
    ends, space = desk.ends, desk.space
    count = tighten(task, motion, ends, space, heap, count, results.gap, witnesses)
    for pair in range(witnesses.shape[0]):
        if witnesses[pair, 0] < results.best[pair, UP]:
            place_witness(task, motion, desk, results, pair, witnesses[pair])
    return count
