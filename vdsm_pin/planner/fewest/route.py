"""Where the tip is tried: on the way to the desired path, on it, behind and beside."""

import itertools
from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.path_rows import PathRows
from vdsm_pin.planner.spacing import count_of
from vdsm_pin.problem.desired_path import Order
from vdsm_pin.problem.planning_problem import PlanningProblem


@dataclass(frozen=True)
class TipRoute:
    """Tip positions where shapes are tried, and how the tip moves among them.

    Args:
        tips: Positions, shape (k, 3); [m].
        layers: Tip numbers along the desired path in drawing order, shape (l,).
        stations: Arc length along the desired path at each layer, shape (l,); [m].
        undrawable: Whether it is proved that nobody can draw the stretch from the layer
            before, shape (l,).
        first: Where each tip's neighbours begin, shape (k + 1,).
        links: Neighbouring tips, shape (m,).
        gaps: Distances to them, shape (m,); [m].
    """

    tips: FloatArray
    layers: IntArray
    stations: FloatArray
    undrawable: BoolArray
    first: IntArray
    links: IntArray
    gaps: FloatArray


def _layer_rows(rows: PathRows, undrawable: BoolArray, coarse: float) -> IntArray:
    """Rows that become layers: corners, ends of undrawable stretches, some between."""
    change = undrawable[1:] != undrawable[:-1]
    kept = rows.corner.copy()
    kept[1:] |= change
    kept[:-1] |= change
    marks = np.flatnonzero(kept)
    layers = [marks[:1]]
    for a, b in itertools.pairwise(marks):
        length = rows.stations[b] - rows.stations[a]
        count = max(1, min(int(b - a), int(count_of(length / coarse))))
        inner = np.round(a + (b - a) * np.arange(1, count + 1) / count)
        layers.append(inner.astype(np.int64))
    return np.concatenate(layers)


def _chain(begin: FloatArray, end: FloatArray, coarse: float) -> FloatArray:
    """Points from begin (included) to end (left out), at most `coarse` apart."""
    count = max(1, int(np.ceil(float(np.linalg.norm(end - begin)) / coarse)))
    return np.asarray(begin + np.outer(np.arange(count) / count, end - begin))


def tip_route(
    problem: PlanningProblem,
    rows: PathRows,
    undrawable: BoolArray,
    coarse: float,
    back: float,
) -> TipRoute:
    """Approach and path as one chain of tips, closed where the path is.

    Args:
        problem: What was asked.
        rows: The desired path row by row.
        undrawable: Rows that nobody can reach, shape (r,).
        coarse: Largest distance between neighbouring tips; [m].
        back: How far behind the chain there shall be tips too, along -X; [m].
    """
    path = problem.path
    chosen = _layer_rows(rows, undrawable, coarse)
    drawn = rows.tips[chosen]
    approach = _chain(path.start, drawn[0], coarse)
    tips = np.vstack([approach, drawn])
    k, last = len(approach), len(approach) + len(drawn) - 1
    ring = path.closed and last - k > 1
    either = path.order is Order.FREE and not path.closed
    if either:
        # The other end may be the one to begin with.
        tips = np.vstack([tips, _chain(path.start, drawn[-1], coarse)[:0:-1]])
    n = len(tips)
    pairs = [(i, i + 1) for i in range(n - 1)]
    if ring:
        pairs.append((k, last))
    elif either:
        pairs.append((n - 1, 0))
    if back > 0.0:
        chain = tips
        tips, more = _behind(chain, ring, k, coarse, back)
        pairs += more
        lattice, more = _beside(chain, coarse)
        m = len(tips)
        pairs += [(a if a < n else a - n + m, b + m) for a, b in more]
        tips = np.vstack([tips, lattice])
    blocked = np.zeros(len(chosen), dtype=np.bool_)
    for i, (a, b) in enumerate(itertools.pairwise(chosen)):
        blocked[i + 1] = undrawable[a : b + 1].any()
    links = np.array(pairs).reshape(-1, 2)
    return _linked(tips, np.arange(k, last + 1), rows.stations[chosen], blocked, links)


MOST_BESIDE = 16
"""Largest number of tips along a side of the lattice beside the chain."""
SHEET_STRIDE = 4
"""Only every fourth tip of the chain has tips behind it; the search is for ways."""


def _behind(
    tips: FloatArray, closed: bool, entry: int, coarse: float, back: float
) -> tuple[FloatArray, list[tuple[int, int]]]:
    """The chain's tips and, in a sheet behind them, tips drawn back along -X."""
    n = len(tips)
    feet = [*range(0, n - 1, SHEET_STRIDE), n - 1]
    step = SHEET_STRIDE * coarse
    depth = max(1, int(np.ceil(back / step)))
    sheet, pairs = [tips], []
    for level in range(1, depth + 1):
        first = n + (level - 1) * len(feet)
        sheet.append(tips[feet] - np.array([level * step, 0.0, 0.0]))
        for i, foot in enumerate(feet):
            under = foot if level == 1 else first - len(feet) + i
            pairs.append((under, first + i))
            if i + 1 < len(feet):
                pairs.append((first + i, first + i + 1))
        if closed:
            nearest = int(np.argmin(np.abs(np.array(feet) - entry)))
            pairs.append((first + nearest, first + len(feet) - 1))
    return np.vstack(sheet), pairs


def _beside(
    tips: FloatArray, coarse: float
) -> tuple[FloatArray, list[tuple[int, int]]]:
    """A lattice of tips across the rail about the chain, and what joins them.

    Args:
        tips: The chain, shape (n, 3); [m].
        coarse: Distance of its tips; [m].

    Returns:
        The lattice, shape (m, 3), and pairs (a, b): b counts in the lattice, and a in
        the chain, or in the lattice from n on.
    """
    step, n = SHEET_STRIDE * coarse, len(tips)
    low = np.minimum(tips[:, 1:].min(axis=0), 0.0) - step
    high = np.maximum(tips[:, 1:].max(axis=0), 0.0) + step
    counts = np.minimum(np.ceil((high - low) / step).astype(np.int64) + 1, MOST_BESIDE)
    sides = [np.linspace(low[c], high[c], counts[c]) for c in range(2)]
    flat = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    lattice = np.column_stack([np.full(len(flat), tips[:, 0].min()), flat])
    number = np.arange(len(flat)).reshape(*counts)
    pairs = [
        (n + int(a), int(b))
        for one, other in ((number[:-1], number[1:]), (number[:, :-1], number[:, 1:]))
        for a, b in zip(one.ravel(), other.ravel(), strict=True)
    ]
    for foot in (*range(0, n - 1, SHEET_STRIDE), n - 1):
        gap = np.linalg.norm(flat - tips[foot, 1:], axis=1)
        pairs += [(foot, int(i)) for i in np.argsort(gap, kind="stable")[:2]]
    return lattice, pairs


def _linked(
    tips: FloatArray,
    layers: IntArray,
    stations: FloatArray,
    undrawable: BoolArray,
    pairs: IntArray,
) -> TipRoute:
    both = np.vstack([pairs.reshape(-1, 2), pairs.reshape(-1, 2)[:, ::-1]])
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    first = np.searchsorted(both[:, 0], np.arange(len(tips) + 1))
    gaps = np.linalg.norm(tips[both[:, 0]] - tips[both[:, 1]], axis=1)
    return TipRoute(
        tips,
        layers,
        stations,
        undrawable,
        first.astype(np.int64),
        both[:, 1].copy(),
        gaps,
    )
