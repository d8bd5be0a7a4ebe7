"""The rows of an arm's trajectory and what is said of the whole motion."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from flint import arb

from vdsm_pin.certificate_checker.arm import Arm, frame_of
from vdsm_pin.certificate_checker.balls import (
    MM,
    SLACK,
    Ball,
    Matrix,
    claim,
    column,
    cross,
    dot,
    norm,
    number,
)
from vdsm_pin.certificate_checker.motion import Interval, part
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.problem.planning_problem import Order, Posture
from vdsm_pin.problem.trajectory import Trajectory

PARTS: Final = 32  # of a smooth piece, whose control points hold what lies between
HALVINGS: Final = 24
LIMITS: Final = "alpha_rad", "theta_rad", "psi_rad", "x0_min_m", "x0_max_m"


class Rows:
    """What the rows of the trajectory do, in their order.

    Args:
        arm: What the files ask about.
        rows: The trajectory.
    """

    def __init__(self, arm: Arm, rows: Trajectory) -> None:
        self.arm, self.rows, self.problem = arm, rows, arm.problem
        path = self.problem.tip_path
        self.drawing = None if path is None else Drawing(path)
        self.looks = None if path is None else path.pointing
        self.ordered = path is not None and path.order is Order.AS_GIVEN
        self.link, self.last = frame_of(len(arm.lengths)), arb(arm.lengths[-1])
        self.smooth, self.parts = arm.path.branches[0].degree > 1, 1
        # Largest |alpha| and |theta|, least cos(psi), largest -x0 and x0.
        self.most = [arb(-np.inf)] * 2 + [arb(1)] + [arb(-np.inf)] * 2

    def take(self, rows: tuple[int, int], motion: Interval) -> None:
        """Take the interval between two rows into what is said of the motion."""
        self._stretch(motion)
        drawn = self.drawing is not None and self.rows.on_path[[*rows]].all()
        self.parts = PARTS if drawn and not motion.straight else 1
        tips = [self._tip(motion, i / self.parts) for i in range(self.parts + 1)]
        if rows[0] == 0:
            self._end("start", self.problem.begin, 0, tips[0])
        if rows[1] == self.rows.n_samples - 1:
            self._end("goal", self.problem.goal, rows[1], tips[-1])
        if self.drawing is not None:
            self._draw(self.drawing, rows, motion, tips)

    def _tip(self, motion: Interval, time: float) -> Matrix:
        origin, turned = motion.pose(time)[self.link]
        return origin + turned * column(self.last, 0, 0)

    def _stretch(self, motion: Interval) -> None:
        """The extremes over the control points, and the change from row to row."""
        columns = [[*points] for points in motion.controls[: self.arm.n_own]]
        if self.smooth:
            edges = [(arb(i) / PARTS, arb(i + 1) / PARTS) for i in range(PARTS)]
            columns = [[q for e in edges for q in part(p, *e)] for p in columns]
        alphas, thetas = columns[1::2], columns[2::2]
        alpha, theta, cosine, low, high = self.most
        for yaws, pitches in zip(alphas, thetas, strict=True):
            for yaw, pitch in zip(yaws, pitches, strict=True):
                alpha, theta = alpha.max(abs(yaw)), theta.max(abs(pitch))
                cosine = cosine.min(yaw.cos() * pitch.cos())
        for x0 in columns[0]:
            low, high = low.max(-x0), high.max(x0)
        self.most = [alpha, theta, cosine, low, high]
        if self.problem.max_row_change is not None:
            limit = self.problem.max_row_change + SLACK
            for points in columns[1:]:
                turn = max(points, key=float) - min(points, key=float)
                claim(turn <= limit, "a joint turns by {} deg", np.rad2deg(float(turn)))

    def _end(self, name: str, end: Posture | None, row: int, tip: Matrix) -> None:
        """Check a row at the start or goal: its tip, and joints that are stated."""
        if end is None:
            return
        away, most = norm(tip - column(*end.tip.tolist())), self.problem.tip_tolerance
        claim(away <= most, f"the tip is {{}} mm off its {name}", MM * away)
        if end.joints is not None:
            pairs = zip(
                self.rows.joints[row].tolist(), end.joints.tolist(), strict=True
            )
            off = [abs(arb(found) - stated) for found, stated in pairs]
            lever = sum(map(arb, self.arm.lengths), arb(0))  # moves the tip at most so
            for way in (off[0], *(lever * angle for angle in off[1:])):
                claim(way <= most, f"the joints are {{}} mm off their {name}", MM * way)

    def _draw(
        self, drawing: Drawing, rows: tuple[int, int], motion: Interval, tips: Any
    ) -> None:
        """Take what the tip does at both rows and in between into the drawing."""
        stations = [arb(float(self.rows.path_m[row])) for row in rows]
        on, same = self.rows.on_path[list(rows)], arb(self.problem.tip_tolerance)
        for i in (0, 1):
            if not on[i]:
                continue
            away = norm(tips[-i] - drawing.point(stations[i]))
            claim(away <= same, "the tip is {} mm off the path", MM * away)
            self._angle(motion, float(i), stations[i])
            if i == 1 or rows[0] == 0:  # else it was taken in with the interval before
                ahead = drawing.visit(stations[i], bool(on[0]), same)
                forwards = ahead >= -same - SLACK or not self.ordered
                claim(forwards, "the path is drawn {} mm backwards", -MM * ahead)
        if not on.all():
            drawing.last = None
            return
        begin, run = drawing.begin(stations[0]), drawing.step(*stations)
        self._look(motion, begin, run)
        for k in range(self.parts):
            times = k / self.parts, (k + 1) / self.parts
            bend = motion.sweep(0, self.link, times).at(self.last)[1]
            bend /= 8 * self.parts**2
            start, step = begin + run * times[0], run / self.parts
            drawing.draw(start, step, tips[k : k + 2], bend)

    def _angle(self, motion: Interval, time: float, station: Ball) -> tuple[Ball, Ball]:
        """Angle of the last link to where it shall look, and how far away that is."""
        if self.looks is None or self.drawing is None:
            return arb(0), arb(1)
        axis = motion.pose(time)[self.link][1] * column(1, 0, 0)
        if self.looks.target is None:
            aim = self.drawing.aim(station)
        else:
            aim = column(*self.looks.target.tolist()) - self._tip(motion, time)
        angle = arb.atan2(norm(cross(axis, aim)), dot(axis, aim))
        limit = self.looks.cone + SLACK
        claim(
            angle <= limit, "the last link looks {} deg aside", np.rad2deg(float(angle))
        )
        return angle, norm(aim)

    def _look(self, motion: Interval, begin: Ball, run: Ball) -> None:
        """Check that the last link looks into its cone all through an interval.

        Over a slice the angle is the mean of those at its ends at most and half of what
        the axis and the aim turn; slices are halved until that is enough.
        """
        if self.looks is None or self.drawing is None:
            return
        slices, limit = [(0.0, 1.0)], self.looks.cone + SLACK
        while slices:
            times = slices.pop()
            h, moves = times[1] - times[0], motion.sweep(0, self.link, times)
            seen = [self._angle(motion, t, begin + run * t) for t in times]
            speed = self.drawing.steepest * abs(run)
            if self.looks.target is not None:
                speed = moves.at(self.last)[0]
            nearest = (seen[0][1] + seen[1][1] - speed * h) / 2
            if nearest > 0:
                turned = moves.turn * h + speed * h / nearest
                if (seen[0][0] + seen[1][0] + turned) / 2 <= limit:
                    continue
            claim(h > 2.0**-HALVINGS, "the last link may look aside between rows")
            middle = (times[0] + times[1]) / 2
            slices += [(times[0], middle), (middle, times[1])]

    def close(self, header: Mapping[str, Any]) -> None:
        """Check what is said of the whole motion, and its limits; -x bounds x below."""
        arm = self.problem.manipulator
        claim(set(header["limits"]) == set(LIMITS), f"limits: expected {LIMITS}")
        alpha, theta, psi, low, high = (header["limits"][key] for key in LIMITS)
        cosine = self.most[2]
        widest = arb.atan2((1 - cosine * cosine).nonnegative_part().sqrt(), cosine)
        claims = [
            ("alpha_rad", alpha, self.most[0], arm.max_joint_angle),
            ("theta_rad", theta, self.most[1], arm.max_joint_angle),
            ("psi_rad", psi, widest, arm.max_link_angle),
            ("-x0_min_m", -low, self.most[3], -arm.base_range[0]),
            ("x0_max_m", high, self.most[4], arm.base_range[1]),
        ]
        tip, share = header["tip_deviation_m"], header["coverage"]
        drawing = self.drawing
        if drawing is None:
            claim(tip is share is None, "claims a desired path, the problem has none")
        else:
            path, drawn = self.problem.path, drawing.coverage()
            past = drawing.advanced - drawing.length - self.problem.tip_tolerance
            again = self.ordered and drawing.left and drawing.closed
            once = past <= SLACK or not again
            claim(once, "the path is begun again, {} mm past its end", MM * past)
            claims += [
                ("tip_deviation_m", tip, drawing.deviation, path.spacing),
                ("-coverage", -share, -drawn, -path.required_coverage),
            ]
        for name, claimed, proved, limit in claims:
            bound, value = arb(proved), number(claimed)
            rough = name == "tip_deviation_m" and self.smooth  # it may be cut less fine
            holds = bound <= value and (value <= bound + SLACK or rough)
            claim(holds, name + " is {}, proved is {}", value, bound)
            claim(bound <= limit + SLACK, name + " is {}, the limit {}", bound, limit)
