"""The rows of a trajectory against what the problem asks of the whole motion."""

from collections.abc import Sequence, Set
from functools import reduce
from math import degrees, inf
from typing import Any, Final

from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import MM, SLACK, angle, claim, column, norm
from vdsm_pin.certificate_checker.motion import (
    Branch,
    Interval,
    Path,
    Slices,
    always,
    columns_of,
    derivative,
    part,
)
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.certificate_checker.solids import Pair
from vdsm_pin.certificate_checker.tree import Pose, frame_of, point_of
from vdsm_pin.problem.planning_problem import Posture
from vdsm_pin.problem.trajectory import Trajectory

PARTS: Final = 32  # of a smooth piece, with a chord each
HALVINGS: Final = 24


class Rows:
    """What the rows of the trajectory do, in their order.

    Args:
        arm: What the files ask about.
        rows: The trajectory.
    """

    def __init__(self, arm: Any, rows: Trajectory) -> None:
        self.arm, self.rows, self.problem = arm, rows, arm.problem
        self.place, path = "header", self.problem.tip_path
        self.drawing: Any = None if path is None else Drawing(path)
        self.ordered = path is not None and path.order == "as_given"
        self.link, self.last = frame_of(len(arm.lengths)), arm.lengths[-1]

    def check(self, first: Pose, by_pieces: Set[Pair]) -> None:
        """Check them all.

        Args:
            first: The pose as the motion begins.
            by_pieces: The pairs that planes for single pieces hold apart.

        Raises:
            Rejected: At the first thing that is not as asked; `place` says where.
        """
        (tree, path), before = self.arm.own, None
        self.arm.check_outside(first, by_pieces)
        for k in range(path.size):
            self.place = f"interval {k}"
            motion = Interval(tree, path.controls(k), before)
            self._limits(motion)
            self._tips((k, min(k + 1, self.rows.n_samples - 1)), motion)
            before = motion.pose(1.0)
        self.place = "header"
        if self.drawing is not None:
            self._drawn()

    def _limits(self, motion: Interval) -> None:
        """Check the control points, and the change from row to row."""
        arm, points = self.problem.manipulator, motion.controls
        if (limit := self.problem.max_row_change) is not None:
            n = PARTS if motion.degree > 1 else 1
            parts = [part(points, arb(k) / n, arb(k + 1) / n) for k in range(n)]
            for fine in columns_of([row for rows in parts for row in rows])[1:]:
                turn = reduce(arb.max, fine) - reduce(arb.min, fine)
                claim(turn <= limit + SLACK, "a joint turns by {}°", degrees(turn))
        (low, high), (x0, *angles) = arm.base_range, columns_of(points)
        good = keeps(x0, low - SLACK, high + SLACK)
        claim(good, "x0 is {} mm", MM * max(x0, key=abs))
        most, link = arm.max_joint_angle + SLACK, arb(arm.max_link_angle + SLACK).cos()

        def in_cone(a: arb, b: arb) -> bool:  # convex within the box alone
            return abs(a).max(abs(b)) <= most and a.cos() * b.cos() >= link

        for i in range(0, len(angles), 2):
            both = angles[i : i + 2]
            for name, q in zip(("alpha", "theta"), both, strict=True):
                told, largest = f"{name}{i // 2 + 1} is {{}}°", max(q, key=abs)
                claim(keeps(q, -most, most), told, degrees(largest))
            psi = [(a.cos() * b.cos()).acos() for a, b in zip(*both, strict=True)]
            told = f"psi{i // 2 + 1} is {{}}°"
            claim(always(both, in_cone), told, degrees(max(psi, key=float)))

    def _tips(self, rows: tuple[int, int], motion: Interval) -> None:
        """Check the tip between two rows."""
        on = self.rows.on_path[[*rows]]
        parts = PARTS if on.all() and motion.degree > 1 else 1
        tips = [self._tip(motion, i / parts) for i in range(parts + 1)]
        if rows[0] == 0:
            self._end("start", self.problem.begin, 0, tips[0])
        if rows[1] == self.rows.n_samples - 1:
            self._end("goal", self.problem.goal, rows[1], tips[-1])
        if self.drawing is not None:
            self._draw(rows, motion, tips)

    def _tip(self, motion: Interval, time: float) -> arb_mat:
        return point_of(motion.pose(time)[self.link], self.last, 0, 0)

    def _end(self, name: str, end: Posture | None, row: int, tip: arb_mat) -> None:
        """Check a row at the start or goal: its tip, and joints that are stated."""
        if end is None:
            return
        away, most = norm(tip - column(*end.tip.tolist())), self.problem.tip_tolerance
        claim(away <= most, f"the tip is {{}} mm off its {name}", MM * away)
        if end.joints is not None:
            found, stated = (x.tolist() for x in (self.rows.joints[row], end.joints))
            off = [abs(arb(a) - b) for a, b in zip(found, stated, strict=True)]
            lever = sum(map(arb, self.arm.lengths), arb(0))  # moves the tip at most so
            for way in (off[0], *(lever * angle for angle in off[1:])):
                claim(way <= most, f"the joints are {{}} mm off their {name}", MM * way)

    def _draw(self, rows: tuple[int, int], motion: Interval, tips: Any) -> None:
        """Take what the tip does at both rows and in between into the drawing."""
        drawing = self.drawing
        stations = [arb(float(self.rows.path_m[row])) for row in rows]
        on, same = self.rows.on_path[[*rows]], arb(self.problem.tip_tolerance)
        # The first row was taken in with the interval before, where there is one.
        for i in (i for i in range(rows[0] > 0, 2) if on[i]):
            away = norm(tips[-i] - drawing.point(stations[i]))
            claim(away <= same, "the tip is {} mm off the path", MM * away)
            ahead = drawing.visit(stations[i], bool(on[0]), same)
            forwards = ahead >= -same - SLACK or not self.ordered
            claim(forwards, "the path is drawn {} mm backwards", -MM * ahead)
            self._look(motion, (stations[i], arb(0)), (float(i), float(i)))
        if not on.all():
            drawing.last = None
            return
        begin, run = drawing.local(stations[0]), drawing.step(*stations)
        self._look(motion, (begin, run), (0.0, 1.0))
        parts = len(tips) - 1
        times = [(k / parts, (k + 1) / parts) for k in range(parts)]
        slices = Slices(motion.tree, [(motion, *both) for both in times])
        bends = slices.moves(0, self.link, self.last)[1][1].ravel().tolist()
        for k, bend in enumerate(bends):
            drawing.draw(begin, run / parts, tips[k : k + 2], bend / (8 * parts**2))

    def _look(self, motion: Interval, way: tuple[arb, arb], times: Any) -> None:
        """Check that the last link looks into its cone all through a slice.

        The angle is the mean of those at both ends at most, half of what the axis and
        the aim turn in between, and what errors turn both; slices are halved until
        that is enough.
        """
        drawing, looks = self.drawing, self.drawing.looks
        if looks is None:
            return
        (begin, run), (start, end), h = way, times, times[1] - times[0]
        slices = Slices(motion.tree, [(motion, start, end)])
        turning, total = slices.moves(0, self.link, self.last)
        speed, off, limit = drawing.steepest * abs(run), arb(0), looks.cone + SLACK
        astray, moved = self._astray(motion)
        if drawing.target is not None:
            speed, off = arb(total[0].item()), moved
        ends = [self._seen(motion, t, begin + run * t) for t in times]
        aside, away = (sum(both) / 2 for both in zip(*ends, strict=True))
        nearest = away - speed * h / 2
        worst = aside + turning[0].item() * h / 2 + astray
        if nearest > off:
            worst += speed * h / nearest / 2 + off / (nearest - off)
            if worst <= limit:
                return
        for one, _ in ends:
            claim(one <= limit, "the last link looks {}° aside", degrees(one))
        claim(h > 2.0**-HALVINGS, "the last link may look aside within the errors")
        middle = (start + end) / 2
        for half in ((start, middle), (middle, end)):
            self._look(motion, way, half)

    def _astray(self, motion: Interval) -> tuple[arb, arb]:
        """What errors turn the last link by, and move the tip.

        Errors a and b of a joint's two axes, at right angles, turn what follows by t
        with cos(t / 2) = cos(a / 2) cos(b / 2).
        """
        rail, *joints = motion.tree.joints
        lever = sum(map(arb, self.arm.lengths), arb(0))
        x0 = max(columns_of(motion.controls)[0], key=lambda q: float(abs(q)))
        turned, moved = arb(rail.tilt), rail.slip + rail.tilt * (abs(x0) + lever)
        sines = [(arb(one.turn_error) / 2).sin() ** 2 for one in joints]
        both = zip(sines[::2], sines[1::2], self.arm.lengths, strict=True)
        for a, b, length in both:
            turn = 2 * (a + b - a * b).sqrt().asin()
            turned, moved, lever = turned + turn, moved + turn * lever, lever - length
        return turned, moved

    def _seen(self, motion: Interval, time: float, station: arb) -> tuple[arb, arb]:
        """Angle of the last link to where it shall look, and how far away that is."""
        axis = column(*motion.pose(time)[self.link].entries()[::4][:3])
        aim = self.drawing.aim(station, self._tip(motion, time))
        return angle(axis, aim), norm(aim)

    def _drawn(self) -> None:
        """Check how much of the path is drawn, how well, and that it is drawn once."""
        drawing = self.drawing
        path, drawn = self.problem.path, drawing.coverage()
        past = drawing.farthest - drawing.length - self.problem.tip_tolerance
        once = past <= SLACK or not (self.ordered and drawing.left and drawing.closed)
        claim(once, "the path is begun again, {} mm past its end", MM * past)
        strays, most = drawing.deviation, path.spacing
        told = "the tip strays {} mm from the path, {} are allowed"
        claim(strays <= most + SLACK, told, MM * strays, MM * most)
        enough = drawn >= path.required_coverage - SLACK
        claim(enough, "coverage is {}, required is {}", drawn, path.required_coverage)


class RobotRows:
    """What the rows of a robot's trajectory do, in their order.

    Args:
        robot: What the files ask about.
        own: The trajectory.
    """

    def __init__(self, robot: Any, own: Branch) -> None:
        self.pairs, self.moved, self.path = robot.pairs, robot.model.moved, Path(own)
        self.place, self.timed = "header", own.timed and len(own.knots) > 1

    def check(self, first: Pose, by_pieces: Set[Pair]) -> None:
        """Check that links begin outside of meshes, and that joints keep their limits.

        Args:
            first: The pose as the motion begins.
            by_pieces: The pairs that planes for single pieces hold apart.

        Raises:
            Rejected: If one does not; `place` says where.
        """
        for pair in (x for x in self.pairs if x in by_pieces):
            rest, thing, _ = pair.partner
            thing.check_outside(first[rest], [pair.inner(first)])
        for k in range(self.path.size):
            self.place, ends = f"interval {k}", self.path.times[k : k + 2].tolist()
            step = arb(ends[-1]) - arb(ends[0])
            controls = self.path.controls(k)
            for joint, points in zip(self.moved, columns_of(controls), strict=True):
                told = f"joint {joint.name!r} leaves its limits"
                claim(within(points, joint.lower, joint.upper), told)
                limits = joint.velocity, joint.acceleration
                for order, most in enumerate(limits if self.timed else (), start=1):
                    told = f"joint {joint.name!r} leaves the limit of its rates"
                    points = [q / step for q in derivative(points)]  # noqa: PLW2901
                    # Rates of straight lines change at once.
                    kept = order < len(controls) and within(points, -most, most)
                    claim(kept or most == inf, told)


def keeps(points: Sequence[arb], low: Any, high: Any) -> bool:
    """Whether a column of q stays within limits all along."""
    return always([points], lambda q: low <= q <= high)


def within(points: Sequence[arb], low: float, high: float) -> bool:
    """The same of limits that may be passed by a billionth of their size."""
    slack = SLACK * max(1.0, min(abs(low), abs(high)))
    return keeps(points, low - slack, high + slack)
