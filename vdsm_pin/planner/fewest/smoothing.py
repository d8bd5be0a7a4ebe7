"""Smoother motions: pulled straight in the chart, and with knees taken away.

Stretches of corners are replaced by straight lines. A joint is put in line with the
bent joints before and after it, or with one of its neighbours, whose other end moves
for it, along as much of the path as keeps clearance and limits. Its neighbours bend
more for it, so a gentle curve of many knees becomes a polygon of few.
"""

import itertools
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, distinct
from vdsm_pin.planner.fewest.charts import OFFSETS, chart_of, standing
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.roadmap import CostWeights
from vdsm_pin.tolerances import TOLERANCES

RESTING: Final = 3e-4
"""Length over the arm's that a change of shape counts for while the tip rests; [-]."""


def _runs(corners: Corners) -> list[tuple[int, int]]:
    """Maximal runs of intervals of one kind, as first and last corner."""
    change = np.flatnonzero(np.diff(corners.drawn.astype(int))) + 1
    marks = [0, *change.tolist(), len(corners.drawn)]
    return list(itertools.pairwise(marks))


def _flattened(judge: Judge, corners: Corners, spans: list[tuple[int, int]]) -> Corners:
    """Corners with every span's inner corners on the line between its ends."""
    tips, offsets = corners.tips.copy(), corners.offsets.copy()
    ways = _ways(judge, corners)
    for span in spans:
        _on_line(span, ways, corners.drawn, tips, offsets)
    return replace(corners, tips=tips, offsets=offsets)


def _ways(judge: Judge, corners: Corners) -> FloatArray:
    """How far apart corners are: along the path, or as tip and shape move, (n - 1,)."""
    unit = chart_of(corners.offsets).unit(judge.problem.manipulator)
    turns = np.abs(np.diff(corners.offsets, axis=0)).max(axis=(1, 2))
    moved = np.linalg.norm(np.diff(corners.tips, axis=0), axis=1) + unit * turns
    return np.where(corners.drawn, np.abs(np.diff(corners.stations)), moved)


@compiled
def _on_line(
    span: tuple[int, int],
    ways: FloatArray,
    drawn: BoolArray,
    tips: FloatArray,
    offsets: FloatArray,
) -> None:
    """Move corners between two corners onto the straight line between them, in place.

    Where the tip draws, each keeps its station and its tip; elsewhere they are spread
    as far apart as they are now.

    Args:
        span: The first corner and the last one.
        ways: How far apart corners are, shape (n - 1,).
        drawn: Whether the tip draws in between, shape (n - 1,).
        tips: Shape (n, 3); [m].
        offsets: Shape (n, N + 1, 2) [m], or directions, shape (n, N, 3) [-].
    """
    a, b = span
    share = np.zeros(b - a + 1)
    for k in range(a, b):
        share[k + 1 - a] = share[k - a] + ways[k]
    if share[-1] > 0.0:
        share /= share[-1]
    else:
        share[:] = np.arange(b - a + 1) / (b - a)
    for k in range(a + 1, b):
        t = share[k - a]
        offsets[k] = (1.0 - t) * offsets[a] + t * offsets[b]
        if not drawn[a]:
            tips[k] = (1.0 - t) * tips[a] + t * tips[b]


def _spans(corners: Corners, stride: int, phase: int) -> list[tuple[int, int]]:
    spans = []
    for begin, end in _runs(corners):
        marks = list(range(begin + phase, end, stride))
        marks = [m for m in (begin, *marks, end) if begin <= m <= end]
        marks = sorted(set(marks))
        spans += [(a, b) for a, b in itertools.pairwise(marks) if b - a > 1]
    return spans


class _State(NamedTuple):
    """What corners come to."""

    clearances: FloatArray
    """As of `Looks`, shape (n,); [m]."""

    bent: BoolArray
    """Whether joints are changed, shape (n, N)."""

    largest: FloatArray
    """Largest link angle, shape (n,); [rad]."""

    @classmethod
    def of(cls, judge: Judge, corners: Corners) -> "_State":
        bends = judge.bends(corners.tips, corners.offsets)
        clearances = judge.look(corners.tips, corners.offsets).clearances
        return cls(clearances, bends > TOLERANCES.changed_angle, bends.max(axis=1))


def shortcut(judge: Judge, corners: Corners, weights: CostWeights) -> Corners:
    """Corners pulled straight wherever that keeps clearance, limits and sparsity.

    Long stretches are tried first, then ever shorter ones, all of one length at once.
    """
    longest = max(b - a for a, b in _runs(corners))
    stride = 1 << max(1, int(np.ceil(np.log2(max(longest, 2)))))
    state = _State.of(judge, corners)
    strides = [stride >> k for k in range(stride.bit_length() - 1)]
    for stride in (*strides, *strides[-3:]):
        for phase in (0, stride // 2):
            spans = _spans(corners, stride, phase)
            if spans:
                try:
                    corners, state = _round(judge, corners, state, weights, spans)
                except OutOfTime:
                    return corners
    return corners


def _round(
    judge: Judge,
    corners: Corners,
    state: _State,
    weights: CostWeights,
    spans: list[tuple[int, int]],
) -> tuple[Corners, _State]:
    trial = _flattened(judge, corners, spans)
    gap = np.abs(trial.offsets - corners.offsets).max(axis=(1, 2))
    gap = np.maximum(gap, np.abs(trial.tips - corners.tips).max(axis=1))
    moved = gap > TOLERANCES.joint_centre
    spans = [(a, b) for a, b in spans if moved[a : b + 1].any()]
    if not spans:
        return corners, state
    picked = np.concatenate([np.arange(a, b) for a, b in spans])
    new = _State._make(values.copy() for values in state)
    bends = judge.bends(trial.tips[picked], trial.offsets[picked])
    new.bent[picked] = bends > TOLERANCES.changed_angle
    new.largest[picked] = bends.max(axis=1)
    lengths = np.abs(np.diff(corners.stations))
    lengths += RESTING * judge.problem.manipulator.total_length
    need, bend = _guards(judge, corners, state, weights, spans)
    good, new.clearances[picked] = judge.measured(
        judge.lines(trial, picked), need, bend
    )
    kept = []
    place = 0
    taken = np.zeros(len(corners.tips), dtype=np.bool_)
    for a, b in spans:
        inner, clear = slice(a + 1, b), good[place : place + b - a].all()
        # Where the tip draws, no more joints may bend over a span than before.
        span, own = slice(a, b + 1), lengths[a:b]
        before, after = _knees(state.bent[span], own), _knees(new.bent[span], own)
        fewer = after <= before + TOLERANCES.joint_centre
        if clear and (fewer or not corners.drawn[a]):
            kept.append((a, b))
            taken[inner] = True
        place += b - a
    for old, values in zip(state, new, strict=True):
        old[taken] = values[taken]
    return _flattened(judge, corners, kept), state


def _knees(bent: BoolArray, lengths: FloatArray) -> float:
    """Changed angles times lengths: between corners all bend that do at either.

    Args:
        bent: Whether joints are changed at corners, shape (n, N).
        lengths: From corner to corner, shape (n - 1,).
    """
    return float(((bent[:-1] | bent[1:]).sum(axis=1) * lengths).sum())


def _guards(
    judge: Judge,
    corners: Corners,
    state: _State,
    weights: CostWeights,
    spans: list[tuple[int, int]],
) -> tuple[FloatArray, FloatArray]:
    """Clearance to keep and angle not to exceed, interval by interval of the spans."""
    need, bend = [], []
    wanted = weights.clearance * judge.problem.manipulator.total_length
    for a, b in spans:
        clearances = float(state.clearances[a : b + 1].min())
        clearances = max(min(clearances, judge.required + wanted / 2.0), judge.required)
        most = max(float(state.largest[a : b + 1].max()), weights.easy_bend)
        need += [clearances] * (b - a)
        bend += [most] * (b - a)
    return np.array(need), np.array(bend)


def straightened(judge: Judge, corners: Corners) -> Corners:
    """Ways without the corners that lie on the line between their neighbours."""
    kept = np.ones(len(corners.tips), dtype=np.bool_)
    a, ways = 0, _ways(judge, corners)
    for k in range(1, len(corners.tips) - 1):
        if not (corners.drawn[k - 1] or corners.drawn[k]):
            own, span = slice(a, k + 1), slice(a, k + 2)
            tips, offsets = corners.tips[span].copy(), corners.offsets[span].copy()
            _on_line((0, k + 1 - a), ways[own], corners.drawn[own], tips, offsets)
            gap = max(
                np.abs(tips - corners.tips[span]).max(),
                np.abs(offsets - corners.offsets[span]).max(),
            )
            kept[k] = gap > TOLERANCES.joint_centre
        a = k if kept[k] else a
    return corners.take(np.flatnonzero(kept))


def lifted(judge: Judge, corners: Corners) -> Corners:
    """Ways with the tip stepping back along -X, where there is room for it.

    The step grows with the distance from the ends of the way, up to the problem's
    retreat; half and a quarter of it are tried too.
    """
    retreat = judge.problem.path.retreat
    for begin, end in reversed(_runs(corners)):
        if corners.drawn[begin] or not retreat > 0.0:
            continue
        tips = corners.tips[begin : end + 1]
        if tips[:, 0].min() < min(tips[0, 0], tips[-1, 0]) - TOLERANCES.joint_centre:
            continue
        for part in (1.0, 0.5, 0.25):
            trial = _stepped_back(corners, begin, end, part * retreat)
            count = end - begin + len(trial.tips) - len(corners.tips)
            if judge.clear(judge.lines(trial, np.arange(begin, begin + count))).all():
                corners = trial
                break
    return corners


def _stepped_back(corners: Corners, begin: int, end: int, depth: float) -> Corners:
    """One way stepped back by at most `depth`, with corners where the slope changes."""
    tips = corners.tips[begin : end + 1]
    along = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(along)])
    total = float(length[-1])
    if not total > 0.0:
        return corners
    ramp = min(depth, total / 2.0)
    marks = distinct(np.array([ramp, total - ramp]))
    new = (marks[:, None] != length).all(axis=1)
    # Corners where only the shape changes share a length: keep every one of them.
    values = np.concatenate([length, marks[new]])
    order = np.argsort(values)
    values = values[order]
    own = order < len(length)
    upper = np.clip(np.searchsorted(length, values, side="right"), 1, len(length) - 1)
    low = upper - 1
    span = length[upper] - length[low]
    share = np.where(
        span > 0.0, (values - length[low]) / np.where(span > 0, span, 1), 0
    )
    low, share = np.where(own, order, low), np.where(own, 0.0, share)
    high = np.minimum(low + 1, len(length) - 1)
    t = share[:, None]
    new_tips = (1 - t) * tips[low] + t * tips[high]
    new_tips[:, 0] -= np.minimum(np.minimum(values, total - values), ramp)
    shapes = corners.offsets[begin : end + 1]
    t = t[..., None]
    new_shapes = (1 - t) * shapes[low] + t * shapes[high]
    return corners.rerouted(begin, end, new_tips, new_shapes)


JOINT_ROUNDS: Final = 4
"""Rounds over all joints."""
WAYS: Final = (-1, 1, 0)
"""How a joint is made straight, in this order, see `Offsets.in_line`."""


def sparser(judge: Judge, corners: Corners) -> Corners:
    """The motion with fewer changed angles where the tip draws, every interval clear.

    A motion to a goal draws nothing: it has fewer all the way.

    Args:
        judge: Says what is clear.
        corners: The motion; given by directions, it comes back by projections where all
            of it can be.
    """
    begin = _Bent.of(judge, projected(judge, corners))
    joints = range(1, judge.problem.manipulator.n_links)
    both = [_in_order(judge, begin, order) for order in (joints, joints[::-1])]
    return min(both, key=lambda one: one.knees).corners


class _Bent(NamedTuple):
    """A motion and where it bends."""

    corners: Corners
    bent: BoolArray
    """Whether joints are changed at corners, shape (n, N)."""

    @classmethod
    def of(cls, judge: Judge, corners: Corners) -> "_Bent":
        bends = judge.bends(corners.tips, corners.offsets)
        return cls(corners, bends > TOLERANCES.changed_angle)

    @property
    def knees(self) -> float:
        """See `mean_knees`."""
        knees = (self.bent[:-1] | self.bent[1:]).sum(axis=1)
        length = np.abs(np.diff(self.corners.stations)) * self.corners.drawn
        if not length.any():
            length = np.full(len(knees), 1.0)
        return float(np.average(knees, weights=length))


def mean_knees(judge: Judge, corners: Corners) -> float:
    """Mean number of changed angles where the tip draws, by the length drawn.

    From a corner to the next every joint is bent that is bent at either. Where the tip
    draws nothing, all intervals count alike.
    """
    return _Bent.of(judge, corners).knees


def _in_order(judge: Judge, motion: _Bent, joints: range) -> _Bent:
    """The motion with joints made straight in an order, until none can be."""
    steps, vain, fewest = [*itertools.product(joints, WAYS)], 0, motion.knees
    for joint, way in JOINT_ROUNDS * steps:
        try:
            corners = _without(judge, motion, joint, way)
        except OutOfTime:
            break
        vain += 1
        if corners is not motion.corners:
            trial = _Bent.of(judge, corners)
            if (knees := trial.knees) < fewest:
                motion, fewest, vain = trial, knees, 0
        if vain == len(steps):
            break
    return motion


def projected(judge: Judge, corners: Corners) -> Corners:
    """Corners given by projections if all links lean ahead and all ways stay clear."""
    if chart_of(corners.offsets) is OFFSETS:
        return corners
    arm = judge.problem.manipulator
    centres = standing(arm, corners.tips, corners.offsets)
    if not (np.diff(centres[:, :, 0], axis=1) > 0.0).all():
        return corners
    offsets = OFFSETS.coordinates(arm, centres)
    trial = replace(corners, offsets=offsets)
    clear = judge.clear(judge.lines(trial, np.arange(len(corners.drawn))))
    return trial if clear.all() else corners


def _without(judge: Judge, motion: _Bent, joint: int, way: int) -> Corners:
    """Corners with a joint straight where that can be; the same object if nowhere.

    Args:
        judge: Says what is clear.
        motion: Its corners, and where they bend.
        joint: The joint, counted from 0.
        way: How it is made straight, see `Offsets.in_line`.
    """
    arm, corners = judge.problem.manipulator, motion.corners
    tips, bent = corners.tips, motion.bent
    on = np.append(corners.drawn, False) | np.append(False, corners.drawn)
    # Where nothing is drawn, the way to a goal counts. The start is where it is.
    on |= not on.any()
    rows = 1 + np.flatnonzero((on & bent[:, joint])[1:])
    if not len(rows):
        return corners
    before, trial = bent[rows].sum(axis=1), corners.offsets.copy()
    chart = chart_of(trial)
    trial[rows] = chart.in_line(arm, tips[rows], trial[rows], joint, way)
    after = judge.bends(tips[rows], trial[rows]) > TOLERANCES.changed_angle
    fewer = after.sum(axis=1) < before
    rows, wanted = rows[fewer], bent.copy()
    wanted[rows] = after[fewer]
    # Who bends others instead from one corner to the next gains nothing.
    if not motion._replace(bent=wanted).knees < motion.knees:
        return corners
    better = np.zeros(len(on), dtype=np.bool_)
    better[rows] = judge.look(tips[rows], trial[rows]).clearances >= judge.required
    asked = better
    while better.any():
        offsets = np.where(better[:, None, None], trial, corners.offsets)
        changed = replace(corners, offsets=offsets)
        touched = (better[:-1] | better[1:]) & (asked[:-1] | asked[1:])
        intervals = np.flatnonzero(touched)
        bad = intervals[~judge.clear(judge.lines(changed, intervals))]
        if not len(bad):
            return changed
        kept = better.copy()
        kept[bad] = kept[bad + 1] = False
        better, asked = kept, better & ~kept
    return corners
