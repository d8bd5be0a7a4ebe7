"""How a tree moves between two knots, and how far bodies reach meanwhile.

The bound is that of docs/certificate.md. Joints and frames are balls. What is worked
out of them for planes are doubles, many slices at once: bounds are lifted by `UP`
before, heights come with what they may be off.
"""

from collections.abc import Sequence
from functools import cached_property, reduce
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import UP, Ball, claim
from vdsm_pin.certificate_checker.tree import SLIDES, TURNS, Joint, Pose, Tree, hung
from vdsm_pin.problem.scene import Moving

Points: TypeAlias = Sequence[Ball]  # the control points of a column of q


def blossom(points: Points, shares: Sequence[Ball]) -> Ball:
    """De Casteljau's value of control points, each step at a share of its own."""
    for share in shares:
        points = [a + (b - a) * share for a, b in pairwise(points)]
    return points[0]


def part(points: Points, low: Ball, high: Ball) -> Points:
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
    """Control points of how fast a column changes."""
    return [(b - a) * (len(points) - 1) for a, b in pairwise(points)]


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

    def controls(self, k: int) -> list[Points]:
        """Control points of every column over interval k; a single row stands still."""

        def ends(values: Any) -> Any:
            last = min(k + 1, len(values) - 1)
            return (arb_mat([values[row].tolist()]) for row in (k, last))

        rows = [*ends(self.knots)]
        if self.inner is not None:
            rows[1:1] = [arb_mat([row]) for row in self.inner[k].tolist()]
        elif self.degree > 1:
            step = arb(self.times[k + 1]) - arb(self.times[k])
            first, last = rows
            v, w = (rate * (step / self.degree) for rate in ends(self.rates[0]))
            rows[1:1] = [first + v, last - w]
            if self.degree == 5:
                a, b = (c * (step * step / 20) for c in ends(self.rates[1]))
                rows[2:2] = [first + 2 * v + a, last - 2 * w + b]
        return [*map(list, zip(*(row.entries() for row in rows), strict=True))]

    def between(self, start: float, end: float) -> list[Points]:
        """Control points between two times; it rests before its first and last."""
        k, last = int(np.searchsorted(self.times, start, "right")) - 1, len(self.knots)
        if not 0 <= k < last - 1:
            row = self.knots[min(max(k, 0), last - 1)]
            return [[arb(q)] * 2 for q in row.tolist()]
        if (start, end) == (self.times[k], self.times[k + 1]):
            return self.controls(k)
        own, step = arb(self.times[k]), arb(self.times[k + 1]) - arb(self.times[k])
        low, high = (start - own) / step, (end - own) / step
        return [part(points, low, high) for points in self.controls(k)]


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

    def controls(self, k: int) -> list[Points]:
        """Control points of every column of q over interval k."""
        ends = self.times[k], self.times[min(k + 1, len(self.times) - 1)]
        found = [points for one in self.branches for points in one.between(*ends)]
        return [raised(points, self.degree) for points in found]


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


class Sweep(NamedTuple):
    """Bounds of how a point moves as seen from a frame, and of what errors add.

    Numbers, or arrays of one for each slice.

    Args:
        turn: W, how fast the point's frame turns.
        swing: A, how fast that changes.
        erring: E, the sum of the errors of angles.
        turned: C, that and the turns of placements.
        speed: Of the point.
        bend: M, of its acceleration.
        tilting: What turns of placements add to that.
        drift: D, how fast the first order of errors of angles changes.
        first: How far errors carry it in the first order.
        second: Q, and beyond it.
    """

    turn: Any = 0.0
    swing: Any = 0.0
    erring: Any = 0.0
    turned: Any = 0.0
    speed: Any = 0.0
    bend: Any = 0.0
    tilting: Any = 0.0
    drift: Any = 0.0
    first: Any = 0.0
    second: Any = 0.0

    def at(self, far: Any, rate: Any = 0.0, change: Any = 0.0) -> "Sweep":
        """Of a point so far from it in its frame, or as far at most as it slides.

        Args:
            far: A distance, or an array of some.
            rate: How fast that changes at most.
            change: How fast the rate does.
        """
        w, a, e, c, speed, bend, tilting, drift, first, second = self
        bent = far * (w * w + a) + 2.0 * w * rate + change
        return Sweep(
            *(w, a, e, c),
            speed=speed + far * w + rate,
            bend=bend + bent,
            tilting=tilting + bent * (c - e),
            drift=drift + far * e * w + e * rate,
            first=first + far * c,
            second=second + far * c * c / 2.0,
        )

    def past(self, joint: Joint, up: bool, value: Sequence[Any]) -> "Sweep":
        """Of the frame behind one more joint, passed upwards or not.

        Args:
            joint: The joint.
            up: Whether the frame is the one that it hangs on.
            value: Bounds of its value, of its rate and of how fast that changes.
        """
        now = self if up or joint.lever == 0.0 else self.at(joint.lever)
        rate, change = value[1:] if joint.kind == TURNS else (0.0, 0.0)
        now = now._replace(
            turn=now.turn + rate,
            swing=now.swing + change,
            erring=now.erring + joint.turn_error,
            turned=now.turned + joint.turn_error + joint.tilt,
        )
        now = now.at(joint.lever) if up and joint.lever > 0.0 else now
        return now.at(*value) if joint.kind == SLIDES else now


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
        self.tree, self.controls = tree, controls
        self.degree = max(map(len, controls), default=2) - 1
        self.poses = {} if before is None else {0.0: before}

    def pose(self, time: float) -> Pose:
        """All frames at a time in [0, 1]."""
        if time not in self.poses:
            shares = [arb(time)] * self.degree
            q = [blossom(points, shares) for points in self.controls]
            self.poses[time] = self.tree.pose(q)
        return self.poses[time]

    def frames(self, time: float) -> list[list[float]]:
        """Of all frames origin and rotation, in doubles, shape (n_frames, 12)."""
        pose = self.pose(time)
        return [[*map(float, o.entries() + turn.entries())] for o, turn in pose]

    def rates(self, low: float, high: float) -> list[list[float]]:
        """Of a slice bounds of joints' values, rates and how fast those change."""
        bounds = []
        for points in self.controls:
            sizes, cut = [0.0] * 3, (low, high) != (0.0, 1.0)
            values = points
            for order in range(min(3, len(points))):
                values = derivative(values) if order else points
                here = part(values, arb(low), arb(high)) if cut else values
                sizes[order] = UP * float(reduce(arb.max, map(abs, here)))
            bounds.append(sizes)
        found = []
        for joint in self.tree.joints:
            sizes = [0.0] * 3 if joint.column is None else bounds[joint.column]
            far, rate, change = (joint.gain * size for size in sizes)
            found.append([far + joint.past, rate, change])
        return found


class Slices:
    """Slices of intervals, as arrays with one entry for each.

    Args:
        tree: The joints, with their errors.
        slices: Each an interval, and times a and b in it.
    """

    def __init__(
        self, tree: Tree, slices: Sequence[tuple[Interval, float, float]]
    ) -> None:
        self.tree, self.slices = tree, slices
        self.numbers = {one: i for i, one in enumerate(slices)}
        self.widths = np.array([b - a for _, a, b in slices])
        rates = np.array([one.rates(*times) for one, *times in slices])
        self.rates = rates.reshape(-1, len(tree.joints), 3).transpose(1, 2, 0)
        self.sweeps = dict[tuple[int, int], Sweep]()

    @cached_property
    def frames(self) -> tuple[Any, Any]:
        """Origins and rotations of all frames at both ends, in doubles."""
        ends = [[one.frames(t) for t in times] for one, *times in self.slices]
        shape = len(ends), 2, len(self.tree.joints) + 1
        flat = np.array(ends).reshape(*shape, 12)
        return flat[..., :3], flat[..., 3:].reshape(*shape, 3, 3)

    def sweep(self, rest: int, frame: int) -> Sweep:
        """How the origin of a frame moves as seen from another one."""
        if (rest, frame) not in self.sweeps:
            sweep, steps = Sweep(), self.tree.way(rest, frame)
            if steps:
                number, up = steps[-1]
                joint = self.tree.joints[number]
                sweep = self.sweep(rest, number + 1 if up else joint.parent)
                sweep = sweep.past(joint, up, self.rates[number])
            self.sweeps[rest, frame] = sweep
        return self.sweeps[rest, frame]

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
        if solid.disc_radius > 0.0:
            away = np.linalg.norm(np.cross(seen, solid.disc_axis), axis=2)
            heights += solid.disc_radius * away[:, :, None]
        every, sweep = self.widths.shape, self.sweep(rest, body.frame)
        sweep = Sweep(*(np.broadcast_to(x, every)[at, None] for x in sweep))
        sweep, h = sweep.at(solid.levers), self.widths[at, None]
        more = (sweep.bend + sweep.tilting) * h * h / 8.0 + h * sweep.drift / 2.0
        more = more + sweep.second + solid.disc_radius * sweep.turned
        more = more + self._strayed(body, rest, at, n)
        size = np.abs(origins).max() + solid.extent + (more + sweep.first).max(axis=1)
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
