"""How a tree moves between two knots, and how far bodies reach meanwhile.

The bound is that of docs/certificate.md. Joints and frames are balls. What is worked
out of them for planes are doubles, many slices at once: bounds are lifted by `UP`
before, heights come with what they may be off.
"""

from collections.abc import Sequence
from functools import cached_property, reduce
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import UP, claim
from vdsm_pin.certificate_checker.tree import SLIDES, TURNS, Joint, Pose, Tree, hung
from vdsm_pin.problem.scene import Moving

Points: TypeAlias = Sequence[Any]  # control points: rows of q, or of one column


def row(values: Any) -> arb_mat:
    """A row of doubles in balls."""
    return arb_mat([values.tolist()])


def columns_of(points: Points) -> list[Points]:
    """The control points of every column of q."""
    return [*zip(*(point.entries() for point in points), strict=True)]


def blossom(points: Points, shares: Sequence[arb]) -> Any:
    """De Casteljau's value of control points, each step at a share of its own."""
    for share in shares:
        points = [a + (b - a) * share for a, b in pairwise(points)]
    return points[0]


def part(points: Points, low: arb, high: arb) -> Points:
    """Control points of a part [low, high] of [0, 1]."""
    n = len(points) - 1
    return [blossom(points, [low] * (n - i) + [high] * i) for i in range(n + 1)]


def always(columns: Sequence[Points], good: Any, halvings: int = 20) -> bool:
    """Whether columns of q stay in a convex set all along; `good` says what is in it.

    They lie in the hull of their control points: if those are in the set, so are they.
    Where one is not, both halves have control points of their own, which lie nearer.
    """
    found = [good(*values) for values in zip(*columns, strict=True)]
    if all(found) or not (halvings and found[0] and found[-1]) or len(found) < 3:
        return all(found)
    parts = ([part(p, a, a + arb(0.5)) for p in columns] for a in (arb(0), arb(0.5)))
    return all(always(each, good, halvings - 1) for each in parts)


def raised(points: Points, degree: int) -> Points:
    """Control points of a higher degree, of the same polynomial."""
    while (n := len(points)) <= degree:
        steps = enumerate(pairwise(points), 1)
        inner = [(a * k + b * (n - k)) / n for k, (a, b) in steps]
        points = [points[0], *inner, points[-1]]
    return points


def derivative(points: Points) -> Points:
    """Control points of how fast columns change."""
    degree = len(points) - 1
    return [(b - a) * degree for a, b in pairwise(points)] or [points[0] * 0]


class Branch:
    """Rows of some columns of q, joined by straight lines or smooth pieces.

    Args:
        knots: Shape (n, n_columns).
        times: Of the knots; [s]. None where it moves alone: their numbers then.
        inner: Control points between knots, (n - 1, degree - 1, n_columns), or None.
        rates: Velocities (and accelerations) of cubic (quintic) pieces; else empty.
    """

    def __init__(
        self, knots: Any, times: Any, inner: Any = None, rates: Sequence[Any] = ()
    ) -> None:
        self.knots, self.rates = knots, rates
        self.inner = inner if inner is not None and inner.size else None
        self.timed = times is not None
        self.times = np.arange(float(len(knots))) if times is None else times
        self.degree = 1 if self.inner is None else 1 + inner.shape[1]
        if rates and len(knots) > 1:
            self.degree = 1 + 2 * len(rates)

    def controls(self, k: int) -> Points:
        """Control points over interval k; a single row stands still."""
        ends = k, min(k + 1, len(self.knots) - 1)
        first, last = (row(self.knots[i]) for i in ends)
        if self.inner is not None:
            return [first, *map(row, self.inner[k]), last]
        if self.degree == 1:
            return [first, last]
        step = arb(self.times[k + 1]) - arb(self.times[k])
        v, w = (row(self.rates[0][i]) * (step / self.degree) for i in ends)
        if self.degree == 3:
            return [first, first + v, last - w, last]
        a, b = (row(self.rates[1][i]) * (step * step / 20) for i in ends)
        middle = [first + v, first + 2 * v + a, last - 2 * w + b, last - w]
        return [first, *middle, last]

    def between(self, start: float, end: float) -> Points:
        """Control points between two times; it rests before its first and last."""
        k, last = int(np.searchsorted(self.times, start, "right")) - 1, len(self.knots)
        if not 0 <= k < last - 1:
            return [row(self.knots[min(max(k, 0), last - 1)])] * 2
        own, step = arb(self.times[k]), arb(self.times[k + 1]) - arb(self.times[k])
        return part(self.controls(k), (start - own) / step, (end - own) / step)


class Path:
    """Branches that move at once; it runs over the rows of the first one.

    What the others do meanwhile adds knots.
    """

    def __init__(self, *branches: Branch) -> None:
        self.branches = branches
        self.degree = max(branch.degree for branch in branches)
        times = np.unique(np.concatenate([branch.times for branch in branches]))
        first, last = branches[0].times[[0, -1]]
        self.times = times[(times >= first) & (times <= last)]
        self.size = max(1, len(self.times) - 1)

    def controls(self, k: int) -> Points:
        """Control points of all of q over interval k."""
        ends = self.times[k], self.times[min(k + 1, len(self.times) - 1)]
        every = [raised(one.between(*ends), self.degree) for one in self.branches]
        rows = zip(*every, strict=True)
        return [arb_mat([[q for one in row for q in one.entries()]]) for row in rows]


def beside(own: Branch, joints: Sequence[Joint], obstacles: Sequence[Any]) -> Any:
    """The tree of joints and of what carries obstacles, its path, obstacles' frames.

    Args:
        own: How the joints move.
        joints: They come first, and so do their columns of q.
        obstacles: As they were read, or on carriers of joints and a branch.
    """
    moving = [one for one in obstacles if isinstance(one, Moving)]
    branches, first, joints = [own], dict[Any, int](), [*joints]
    for one in dict.fromkeys(one.carrier for one in moving):
        path: Any = one.path
        columns, first[one] = sum(b.knots.shape[1] for b in branches), len(joints)
        joints += [hung(each, first[one], columns) for each in one.tree.joints]
        if not isinstance(path, Branch):
            path = Branch(path.knots, path.times, path.inner)
        branches.append(path)
    timed = all(one.timed for one in (branches if moving else []))
    claim(timed, "rows beside what moves have no times")
    at = [first[x.carrier] + x.frame if isinstance(x, Moving) else 0 for x in obstacles]
    return Tree(joints), Path(*branches), at


def terms(segment: Sequence[Any], turning: Any) -> Any:
    """What a segment adds to the bounds of a point, shape (6, ..).

    To its speed, M, S, D, how far errors carry it in the first order, and Q.

    Args:
        segment: Its length at most, how fast that changes, how fast the rate does.
        turning: Of its frame W, A, E and C, arrays.
    """
    (far, rate, change), (w, a, e, c) = segment, turning
    speed, bend = far * w + rate, far * (w * w + a) + 2.0 * w * rate + change
    first = far * c
    return np.array([speed, bend, bend * (c - e), e * speed, first, first * c / 2.0])


class Interval:
    """The motion between two knots, under errors.

    Args:
        tree: The joints, with their errors.
        controls: Control points of q.
        before: How it begins, where that is known.
    """

    def __init__(
        self, tree: Tree, controls: Points, before: Pose | None = None
    ) -> None:
        self.tree, self.controls = tree, controls
        self.degree = len(controls) - 1
        self.poses = {} if before is None else {0.0: before}

    def pose(self, time: float) -> Pose:
        """All frames at a time in [0, 1]."""
        if time not in self.poses:
            shares = [arb(time)] * self.degree
            q = blossom(self.controls, shares)
            self.poses[time] = self.tree.pose(q.entries())
        return self.poses[time]

    def frames(self, time: float) -> list[list[float]]:
        """The first three rows of all frames, in doubles, shape (n_frames, 12)."""
        return [[*map(float, frame.entries()[:12])] for frame in self.pose(time)]

    def bounds(self, low: float, high: float) -> list[list[float]]:
        """Of a slice bounds of q, of its rates and of how fast those change."""
        points, bounds = self.controls, []
        for _ in range(3):
            here = part(points, arb(low), arb(high))
            columns = (map(abs, column) for column in columns_of(here))
            bounds.append([UP * float(reduce(arb.max, column)) for column in columns])
            points = derivative(points)
        return bounds


Slice: TypeAlias = tuple[Interval, float, float]  # times a and b in it


class Slices:
    """Slices of intervals, as arrays with one entry for each.

    Args:
        tree: The joints, with their errors.
        slices: Each an interval, and times a and b in it.
    """

    def __init__(self, tree: Tree, slices: Sequence[Slice]) -> None:
        self.tree, self.slices = tree, slices
        self.numbers = {one: i for i, one in enumerate(slices)}
        self.widths = np.array([b - a for _, a, b in slices])
        self.sweeps = dict[tuple[int, int], tuple[Any, Any]]()

    @cached_property
    def frames(self) -> tuple[Any, Any]:
        """Origins and rotations of all frames at both ends, in doubles."""
        ends = [[one.frames(t) for t in times] for one, *times in self.slices]
        frames = np.array(ends).reshape(*np.shape(ends)[:3], 3, 4)
        return frames[..., 3], frames[..., :3]

    @cached_property
    def bounds(self) -> list[Any]:
        """Of each joint bounds of its value, rate and change, shape (3, n_slices)."""
        columns = np.array([one.bounds(*times) for one, *times in self.slices]).T
        return [joint.bounds(columns) for joint in self.tree.joints]

    def sweep(self, rest: int, frame: int) -> tuple[Any, Any]:
        """W, A, E and C of a frame seen from another one; the sum of terms up to it."""
        if (rest, frame) not in self.sweeps:
            turning, total = (np.zeros((n, len(self.slices))) for n in (4, 6))
            if steps := self.tree.way(rest, frame):
                number, up = steps[-1]
                joint, value = self.tree.joints[number], self.bounds[number]
                before, total = self.sweep(rest, number + 1 if up else joint.parent)
                turning = before + joint.erring
                if joint.kind == TURNS:
                    turning[:2] += value[1:]
                if joint.lever > 0.0:
                    shift = (joint.lever, 0.0, 0.0)
                    total = total + terms(shift, turning if up else before)
                if joint.kind == SLIDES:
                    total = total + terms(value, turning)
            self.sweeps[rest, frame] = turning, total
        return self.sweeps[rest, frame]

    def moves(self, rest: int, frame: int, far: Any, at: Any = ...) -> tuple[Any, Any]:
        """W, A, E and C of a frame, and the sum of terms of points that it carries.

        Args:
            rest: The frame that it is seen from.
            frame: The frame.
            far: How far the points lie from its origin, shape (k,) or one for all; [m].
            at: Numbers of slices, shape (m,); all if none are given.

        Returns:
            Shapes (4, m, 1) and (6, m, k).
        """
        turning, total = (x[:, at, None] for x in self.sweep(rest, frame))
        return turning, total + terms((far, 0.0, 0.0), turning)

    def reach(self, body: Any, rest: int, at: Any, n: Any) -> tuple[Any, Any]:
        """Largest n.x over a body, slices and all errors, as seen from a frame.

        Args:
            body: Its frame and its solid of one piece.
            rest: The frame that n and x are in.
            at: Numbers of slices, shape (m,).
            n: Of unit length for each, shape (m, 3).

        Returns:
            Heights, and bounds of all that they are made of; shape (m,); [m].
        """
        solid, (origins, turns) = body.solid, (both[at] for both in self.frames)
        points, mine = solid.points[0].T, turns[:, :, body.frame]
        n = np.einsum("stij,sj->sti", turns[:, :, rest], n)
        offset = origins[:, :, body.frame] - origins[:, :, rest]
        seen = np.einsum("stij,sti->stj", mine, n)
        heights = seen @ points + (n * offset).sum(axis=2)[:, :, None]
        heights += np.linalg.norm(seen @ solid.across, axis=2)[:, :, None]
        turning, total = self.moves(rest, body.frame, solid.levers, at)
        (_, bend, tilting, drift, first, second), h = total, self.widths[at, None]
        more = (bend + tilting) * h * h / 8.0 + h * drift / 2.0
        more += second + solid.disc[1] * turning[3]
        more += self._strayed(body, rest, at, n)
        size = np.abs(origins).max() + solid.extent + (more + first).max(axis=1)
        return (heights.max(axis=1) + more).max(axis=1), size

    def _strayed(self, body: Any, rest: int, at: Any, n: Any) -> Any:
        """First order of how far errors carry corners along n, shape (m, n_corners).

        Args:
            body: Its frame and its solid of one piece.
            rest: The frame that it is seen from.
            at: Numbers of slices, shape (m,).
            n: In the world's frame at both ends, shape (m, 2, 3).
        """
        origins, turns = (both[at] for both in self.frames)
        points, mine = body.solid.points[0].T, turns[:, :, body.frame]
        along, tilted = np.zeros((2, *n.shape[:2], points.shape[1]))
        for number, _ in self.tree.way(rest, body.frame):
            joint = self.tree.joints[number]
            if joint.turn_error + joint.tilt > 0.0:
                place = turns[:, :, joint.parent] @ joint.line
                lever = origins[:, :, body.frame] - origins[:, :, joint.parent]
                lever, g = lever - place[..., 0], np.cross(n, place[..., 1])
                seen, gone = np.einsum("stij,ksti->kstj", mine, [g, lever])
                swing = seen @ points + (g * lever).sum(axis=2)[:, :, None]
                along += joint.turn_error / 2.0 * np.abs(swing)
                away = np.linalg.norm(points + gone[..., None], axis=2)
                tilted += joint.tilt * away
        return along.sum(axis=1) + tilted.max(axis=1)
