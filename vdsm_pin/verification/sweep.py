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
from vdsm_pin.geometry.compiled import compiled
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

SUPPORT: Final = 3
POINT: Final = 4
WIDTH: Final = 7
PLANE: Final = 8
"""Layout of what a pair remembers: n (3), support in n, witness on the partner (3),
width of the bracket when they were found."""

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
    """

    rows: Rows
    ends: Ends
    space: Space
    heap: FloatArray
    planes: FloatArray


@compiled
def new_desk(n_links: int, n_pairs: int, budget: int) -> Desk:
    """Fresh working space; no pair remembers a plane yet."""
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
    return Desk(rows, ends, new_space(), np.zeros((budget, SLICE)), planes)


@compiled
def fill_rows(task: Task, motion: Motion, rows: Rows, first: int, count: int) -> None:
    """Configurations of rows first .. first + count; the last row may repeat."""
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
def stale_upper(points: FloatArray, witness: FloatArray, near: FloatArray) -> float:
    """Distance of a point from the segment of the first two points, and its foot."""
    span = along = 0.0
    for c in range(3):
        d = points[1, c] - points[0, c]
        span += d * d
        along += d * (witness[c] - points[0, c])
    t = min(1.0, max(0.0, along / span)) if span > 0.0 else 0.0
    squared = 0.0
    for c in range(3):
        near[c] = points[0, c] + t * (points[1, c] - points[0, c])
        d = witness[c] - near[c]
        squared += d * d
    return sqrt(squared)


@compiled
def _surface_points(
    task: Task,
    ends: Ends,
    end: int,
    frame: int,
    link: int,
    core: FloatArray,
    out: FloatArray,
) -> None:
    """Witnesses on both surfaces in the base frame, from the core points.

    Args:
        task: For the radius of the links.
        ends: Configurations.
        end: Which of the two.
        frame: Frame of the partner.
        link: The moving link; gives a direction where the points coincide.
        core: Point on the link's axis, then on the partner, shape (2, 3); [m].
        out: Result, shape (6,); [m].
    """
    own, other, turned = out[:3], out[3:6], out[:3].copy()
    gap = 0.0
    for c in range(3):
        turned[c] = core[1, c] - core[0, c]
        gap += turned[c] * turned[c]
    gap = sqrt(gap)
    share = task.rules.radius / gap if gap > 0.0 else 0.0
    moved = core[0] + share * turned
    base_direction(ends.frames[end], frame, moved, own)
    base_direction(ends.frames[end], frame, core[1], other)
    if frame != BASE:
        for c in range(3):
            own[c] += ends.centres[end, frame, c]
            other[c] += ends.centres[end, frame, c]


@compiled
def drop_candidates(task: Task, results: Results) -> None:
    """Drop the candidates that can no longer hold the least bound."""
    kept = 0
    for k in range(results.tally[0]):
        pair = int(results.candidates[k, PAIR])
        group = 0 if task.pairs.frame[pair] == BASE else 1
        if results.candidates[k, KEY] < results.limit[group] - results.gap:
            results.candidates[kept] = results.candidates[k]
            kept += 1
    results.tally[0] = kept


@compiled
def _nominate(
    task: Task, results: Results, k: int, pair: int, group: int, lower: float
) -> None:
    """Remember an interval whose lower bound is below the least instant bound."""
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
def note(
    task: Task,
    results: Results,
    ends: Ends,
    k: int,
    local: int,
    pair: int,
    lower: float,
    upper: float,
    time: float,
    verdict: int,
    core: FloatArray,
) -> None:
    """Record the bracket of one pair over one interval.

    Args:
        task: The scene, pairs and rules.
        results: Where to.
        ends: The interval's configurations; witnesses are placed at the nearer end.
        k: The interval.
        local: Its row in the dense results.
        pair: The pair.
        lower: Proved over the interval; [m].
        upper: Proved at `time`; [m].
        time: In the interval.
        verdict: Its number.
        core: Core points of the witnesses in the partner's frame, shape (2, 3); [m].
    """
    best = results.best[pair]
    link, frame = task.pairs.link[pair], task.pairs.frame[pair]
    end = int(time > 0.5)
    results.counts[pair, verdict] += 1
    if lower < best[KEY]:
        best[KEY], best[AT_LOWER] = lower, k
    if upper < best[UP]:
        best[UP], best[AT_UPPER], best[TIME] = upper, k, time
        _surface_points(task, ends, end, frame, link, core, best[OWN : OWN + 6])
    group = 0 if frame == BASE else 1
    if lower < results.limit[group] - results.gap:
        _nominate(task, results, k, pair, group, lower)
    if frame == BASE:
        span = results.profile[k // results.stride]
        column = task.rules.lengths.size + task.pairs.obstacle[pair]
        span[0, link] = min(span[0, link], lower)
        span[1, link] = min(span[1, link], upper)
        span[0, column] = min(span[0, column], lower)
        span[1, column] = min(span[1, column], upper)
    if results.verdicts.shape[0] > 0:
        results.verdicts[local, pair] = verdict
        row = results.numbers[local, pair]
        row[0], row[1], row[2] = lower, upper, time
        _surface_points(task, ends, end, frame, link, core, row[3:9])


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
    row = np.zeros(SLICE)
    row[INTERVAL], row[PAIR], row[START], row[END] = found[1], pair, found[2], found[2]
    bound_between(task, motion, desk.ends, desk.space, row)
    best = results.best[pair]
    best[UP], best[AT_UPPER], best[TIME] = found[0], found[1], found[2]
    core = found[3:9].copy().reshape(2, 3)
    link, frame = task.pairs.link[pair], task.pairs.frame[pair]
    _surface_points(task, desk.ends, 0, frame, link, core, best[OWN : OWN + 6])
