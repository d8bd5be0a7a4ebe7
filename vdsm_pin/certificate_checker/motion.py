"""How a tree moves, and how far its bodies reach meanwhile (docs/certificate.md)."""

from collections import defaultdict
from collections.abc import Sequence
from functools import reduce, wraps
from itertools import pairwise
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import ROUNDING, Ball, Matrix, cross, dot, norm
from vdsm_pin.certificate_checker.tree import SLIDES, TURNS, Joint, Pose, Tree, pose

SCREEN: Final = 1e-9
"""Corners are looked at that doubles find as near to the farthest; [m].

Doubles are off by some 1e-13 m within the extent that files may have.
"""

Points: TypeAlias = Sequence[Ball]  # the control points of a column of q
WHOLE: Final = 0.0, 1.0


def blossom(points: Points, shares: Sequence[Ball]) -> Ball:
    """De Casteljau's value of control points, each step at a share of its own."""
    for share in shares:
        points = [a + (b - a) * share for a, b in pairwise(points)]
    return points[0]


def part(points: Points, low: Ball, high: Ball) -> Points:
    """Control points of a part [low, high] of [0, 1]."""
    n = len(points) - 1
    return [blossom(points, [low] * (n - i) + [high] * i) for i in range(n + 1)]


def raised(points: Points, degree: int) -> Points:
    """The same by control points of a higher degree."""
    while (n := len(points)) <= degree:
        steps = enumerate(pairwise(points), 1)
        inner = [(a * k + b * (n - k)) / n for k, (a, b) in steps]
        points = [points[0], *inner, points[-1]]
    return points


def largest(values: Points) -> Ball:
    """The largest size of some balls."""
    return reduce(arb.max, map(abs, values))


class Branch:
    """Rows of some columns of q, joined by straight lines or smooth pieces.

    Args:
        knots: Shape (n, n_columns).
        times: Of the knots; [s]. None where it moves alone: their numbers then.
        inner: Control points between knots, (n - 1, degree - 1, n_columns), or None.
        rates: Velocities (and accelerations) of cubic (quintic) pieces; else empty.
    """

    def __init__(
        self, knots: Any, times: Any, inner: Any, rates: Sequence[Any]
    ) -> None:
        self.knots, self.inner, self.rates = knots, inner, rates
        self.times = np.arange(float(len(knots))) if times is None else times
        self.degree = 1 if inner is None else 1 + inner.shape[1]
        if rates and len(knots) > 1:
            self.degree = 1 + 2 * len(rates)

    def controls(self, k: int) -> list[Points]:
        """Control points of every column over interval k."""
        first, last = self._rows(self.knots, k)
        rows = [first, last]
        if self.inner is not None:
            rows[1:1] = [arb_mat([row]) for row in self.inner[k].tolist()]
        elif self.degree > 1:
            step = arb(self.times[k + 1]) - arb(self.times[k])
            v = [rate * (step / self.degree) for rate in self._rows(self.rates[0], k)]
            rows[1:1] = [first + v[0], last - v[1]]
            if self.degree == 5:
                a = [c * (step * step / 20) for c in self._rows(self.rates[1], k)]
                rows[2:2] = [first + 2 * v[0] + a[0], last - 2 * v[1] + a[1]]
        return [*map(list, zip(*(row.entries() for row in rows), strict=True))]

    def _rows(self, values: Any, k: int) -> list[Matrix]:
        ends = k, min(k + 1, len(values) - 1)  # a single row stands still
        return [arb_mat([values[row].tolist()]) for row in ends]

    def between(self, start: float, end: float) -> list[Points]:
        """Control points between two times; it rests before its first and last."""
        k, last = (
            int(np.searchsorted(self.times, start, "right")) - 1,
            len(self.knots) - 1,
        )
        if not 0 <= k < last:
            return [[arb(q)] * 2 for q in self.knots[min(max(k, 0), last)].tolist()]
        if (start, end) == (self.times[k], self.times[k + 1]):
            return self.controls(k)
        own, step = arb(self.times[k]), arb(self.times[k + 1]) - arb(self.times[k])
        low, high = (start - own) / step, (end - own) / step
        return [part(points, low, high) for points in self.controls(k)]


class Path:
    """Branches that move at once; it runs over the rows of the first one.

    What the others do meanwhile adds knots.
    """

    def __init__(self, first: Branch, others: Sequence[Branch]) -> None:
        self.branches = [first, *others]
        self.degree = max(branch.degree for branch in self.branches)
        times = np.unique(np.concatenate([branch.times for branch in self.branches]))
        inside = (times >= first.times[0]) & (times <= first.times[-1])
        self.times, self.size = times[inside], max(1, int(inside.sum()) - 1)

    def ends(self, k: int) -> tuple[float, float]:
        """When an interval begins and ends."""
        return self.times[k], self.times[min(k + 1, len(self.times) - 1)]

    def controls(self, k: int) -> list[Points]:
        """Control points of every column of q over interval k."""
        found = [p for b in self.branches for p in b.between(*self.ends(k))]
        return [raised(points, self.degree) for points in found]

    def reach(self) -> list[Ball]:
        """How large each column of q gets at most."""
        if self.degree == 1 and len(self.branches) == 1:
            knots = self.branches[0].knots
            return [arb(x) for x in abs(knots).max(axis=0).tolist()]
        every = (self.controls(k) for k in range(self.size))
        sizes = ([largest(points) for points in columns] for columns in every)
        return reduce(lambda a, b: [*map(arb.max, a, b)], sizes)


class Sweep(NamedTuple):
    """Bounds of how a frame moves as seen from another, and of what errors add.

    Args:
        turn: W, how fast it turns.
        swing: A, how fast that changes.
        erring: E, the sum of the errors of angles.
        turned: C, that and the turns of placements.
        origin: Of its origin: speed, M, D, first and second order of the errors.
    """

    turn: Ball
    swing: Ball
    erring: Ball
    turned: Ball
    origin: Points

    def at(self, lever: Ball) -> Points:
        """As `origin`, of a point so far from it."""
        w, a, e, c, (speed, bend, drift, one, two) = self
        speed, bend = speed + lever * w, bend + lever * (w * w + a)
        if c == 0:
            return speed, bend, drift, one, two
        drift, one = drift + lever * e * w, one + lever * c
        return speed, bend, drift, one, two + lever * c * c / 2

    def past(self, joint: Joint, up: bool, value: Sequence[Ball]) -> "Sweep":
        """The same of the frame behind one more joint, passed upwards or not.

        Args:
            joint: The joint.
            up: Whether the frame is the one that it hangs on.
            value: Bounds of its value, of its rate and of how fast that changes.
        """
        far, rate, change = value
        w, a, e, c, origin = self
        if joint.kind == TURNS:
            w, a, e = w + rate, a + change, e + joint.turn_error
        c = c + joint.turn_error + joint.tilt
        now = Sweep(w, a, e, c, origin)
        if not joint.lever == 0:
            origin = (now if up else self).at(joint.lever)
            now = Sweep(w, a, e, c, origin)
        if joint.kind == SLIDES:
            (speed, bend, drift, _, _), (*_, one, two) = map(
                now.at, (far, joint.stroke)
            )
            bend, drift = bend + 2 * w * rate + change, drift + e * rate
            now = Sweep(w, a, e, c, (speed + rate, bend, drift, one, two))
        return now


STILL: Final = Sweep(arb(0), arb(0), arb(0), arb(0), [arb(0)] * 5)


def kept(method: Any) -> Any:
    """Keep what a method of an interval finds, some thousands at a time."""

    @wraps(method)
    def found(self: "Interval", *key: Any) -> Any:
        memo = self.memo[method]
        if key not in memo:
            if len(memo) > 1_000:
                memo.clear()
            memo[key] = method(self, *key)
        return memo[key]

    return found


class Interval:
    """The motion between two knots, under errors.

    Args:
        tree: The joints, with their errors.
        controls: Control points of every column of q.
        before: How it begins, where that is known.
    """

    def __init__(
        self, tree: Tree, controls: Sequence[Points], before: Pose | None = None
    ) -> None:
        self.tree, self.controls, self.before = tree, controls, before
        self.degree = max(map(len, controls), default=2) - 1
        self.straight = self.degree == 1
        self.err = any(joint.turn_error + joint.tilt > 0 for joint in tree.joints)
        self.memo: dict[Any, Any] = defaultdict(dict)

    @kept
    def pose(self, time: float) -> Pose:
        """All frames at a time in [0, 1]; pairs share most of their times."""
        if time == 0.0 and self.before is not None:
            return self.before
        shares = [arb(time)] * self.degree
        return pose(self.tree.joints, [blossom(p, shares) for p in self.controls])

    @kept
    def value(self, number: int, times: Any) -> Sequence[Ball]:
        """Bounds of a joint's value, of its rate and of how fast that changes."""
        joint, bounds = self.tree.joints[number], [arb(0)] * 3
        if joint.column is not None:
            points = self.controls[joint.column]
            for order in range(min(3, len(points))):
                here = points if times == WHOLE else part(points, *map(arb, times))
                bounds[order] = largest(here) * abs(joint.ratio)
                n = len(points) - 1
                points = [(b - a) * n for a, b in pairwise(points)]
        return [bounds[0] + abs(joint.offset), *bounds[1:]]

    @kept
    def sweep(self, rest: int, frame: int, times: Any) -> Sweep:
        """How a frame moves over a slice [a, b] as seen from another."""
        steps = self.tree.way(rest, frame)
        if not steps:
            return STILL
        number, up = steps[-1]
        joint = self.tree.joints[number]
        before: Sweep = self.sweep(rest, number + 1 if up else joint.parent, times)
        return before.past(joint, up, self.value(number, times))

    @kept
    def corner(self, body: Any, i: int, rest: int, times: Any) -> tuple[Sweep, Any]:
        """How a corner's frame moves, and the corner with a disc about it.

        The origin of a joint that turns also rides on the frame that it hangs on.
        """
        frame, lever = body.frame, body.solid.corner(i)[1]
        while lever == 0 and (steps := self.tree.way(rest, frame)):
            joint = self.tree.joints[frame - 1]
            if steps[-1][1] or joint.kind == SLIDES:
                break
            frame, lever = joint.parent, joint.lever
        sweep = self.sweep(rest, frame, times)
        return sweep, sweep.at(lever)

    def reach(self, body: Any, rest: int, times: Any, n: Matrix) -> Ball:
        """Largest n.x over a body without its ball, a slice [a, b] and all errors.

        Args:
            body: Its frame and its solid of one piece.
            rest: The frame that n and x are in.
            times: a and b.
            n: A unit vector.
        """
        solid, h, top = body.solid, arb(times[1]) - times[0], arb(-np.inf)
        poses, slice_ = [*map(self.pose, times)], WHOLE if self.straight else times
        toward = [frames[rest][1] * n for frames in poses]
        views = []  # how high the body's frame is, and n in it
        for frames, turned in zip(poses, toward, strict=True):
            origin, rotation = frames[body.frame]
            away = dot(turned, origin - frames[rest][0])
            views.append((away, rotation.transpose() * turned))
        doubt = arb(0, solid.extent * ROUNDING)  # in which doubles the corners are
        discs = [z + solid.across(m) + doubt for z, m in views]
        for i in self._extreme(body, rest, slice_, h, views):
            corner = solid.corner(i)[0]
            sweep, (_, bend, drift, _, second) = self.corner(body, i, rest, slice_)
            ends = [z + dot(corner, m) for z, (_, m) in zip(discs, views, strict=True)]
            sag = bend * h * h / 8
            height = ends[0].max(ends[1]) + sag
            if self.err:
                at = [p[body.frame][0] + p[body.frame][1] * corner for p in poses]
                height += self._strayed(
                    self.tree.way(rest, body.frame), poses, toward, at
                )
                height += sag * (sweep.turned - sweep.erring) + h * drift / 2 + second
                height += solid.disc_radius * sweep.turned
            top = top.max(height)
        return top

    def _extreme(
        self, body: Any, rest: int, times: Any, h: Ball, views: Any
    ) -> Sequence[int]:
        """The corners of a body that may be the farthest, as doubles tell."""
        points = body.solid.points[0]
        if len(points) <= 2:
            return range(len(points))
        far = self.sweep(rest, body.frame, times)
        lever = body.solid.extent * 2 + body.solid.disc_radius
        _, bend, drift, first, second = far.at(lever)
        spare = (1 + far.turned) * bend * h * h / 8 + h * drift + first + second
        normals = [[float(x) for x in m.entries()] for _, m in views]
        heights = [float(z) for z, _ in views]
        rough = (points @ np.array(normals).T + heights).max(axis=1)
        near = rough >= rough.max() - (float(spare) + SCREEN)
        return [int(i) for i in np.flatnonzero(near)]

    def _strayed(self, steps: Any, poses: Any, toward: Any, at: Any) -> Ball:
        """First order of how far errors carry a point along n, at both ends."""
        along = far = arb(0)
        for frames, turned, point in zip(poses, toward, at, strict=True):
            tilted = arb(0)
            for number, _ in steps:
                joint = self.tree.joints[number]
                if not joint.turn_error + joint.tilt > 0:
                    continue
                origin, rotation = frames[number + 1]
                if joint.kind == SLIDES:
                    place, axes = frames[joint.parent]
                    origin = place + axes * joint.shift
                axis, arm = rotation * joint.axis, point - origin
                along += joint.turn_error * abs(dot(turned, cross(axis, arm))) / 2
                tilted += joint.tilt * norm(arm)
            far = far.max(tilted)
        return along + far
