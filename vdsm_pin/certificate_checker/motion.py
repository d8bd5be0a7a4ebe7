"""The arm between two rows: how far it reaches in a direction (docs/certificate.md).

Links and joint centres count from 0 in here: link i joins centres i and i + 1.
"""

from collections.abc import Sequence
from typing import Any

from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import Ball, Matrix, column, dot, norm


def cross(a: Matrix, b: Matrix) -> Matrix:
    """Vector product."""
    (ax, ay, az), (bx, by, bz) = a.entries(), b.entries()
    return column(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def turn(axis: int, angle: Ball) -> Matrix:
    """Rotation about x, y or z (0, 1, 2)."""
    matrix, i, j = arb_mat(3, 3, 1), (axis + 1) % 3, (axis + 2) % 3
    sine, cosine = angle.sin_cos()
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = cosine, -sine, sine, cosine
    return matrix


class Pose:
    """One configuration: joint centres, largest psi, and frames with their origins.

    The base's frame is number 0, that of link i number i + 1.
    """

    def __init__(self, lengths: Sequence[Ball], joints: Sequence[Ball]) -> None:
        self.frames, self.centres = [arb_mat(3, 3, 1)], [column(joints[0], 0, 0)]
        self.psi = arb(0)
        for i, length in enumerate(lengths):
            step = turn(2, joints[2 * i + 1]) * turn(1, joints[2 * i + 2])
            x, y, z = (step[k, 0] for k in range(3))
            self.psi = self.psi.max(arb.atan2(norm(column(0, y, z)), x))
            self.frames.append(self.frames[i] * step)
            along = self.frames[i + 1] * column(length, 0, 0)
            self.centres.append(self.centres[i] + along)
        self.origins = [column(0, 0, 0), *self.centres]

    def point(self, link: int, along: float) -> Matrix:
        """A point of a link's axis, so far along it."""
        return self.centres[link] + self.frames[link + 1] * column(along, 0, 0)

    def height(self, n: Matrix, first: int, point: Matrix) -> Ball:
        """n.p from the origin of frame `first`, in which n is."""
        return dot(self.frames[first] * n, point - self.origins[first])

    def gain(self, n: Matrix, first: int, link: int, point: Matrix) -> Ball:
        """G: how fast n.p grows at most with the angles of joints first..link."""
        total, turned = arb(0), self.frames[first] * n
        for i in range(first, link + 1):
            lever = cross(point - self.centres[i], turned)
            for frame, axis in ((self.frames[i], 2), (self.frames[i + 1], 1)):
                total += abs(dot(column(*(frame[k, axis] for k in range(3))), lever))
        return total


class Interval:
    """The motion between two rows of joint values, under joint errors up to E.

    Args:
        lengths: Of the links; [m].
        ends: Joint values x0, alpha1, theta1, .. of both rows; [m], [rad].
        error: E; [rad].
    """

    def __init__(
        self, lengths: Sequence[Ball], ends: Sequence[list[Ball]], error: Ball
    ) -> None:
        self.lengths, self.start, self.error = lengths, ends[0], error
        self.change = [b - a for a, b in zip(*ends, strict=True)]
        self.poses: dict[float, Pose] = {}

    def pose(self, time: float) -> Pose:
        """The configuration at a time in [0, 1]; pairs share most of their times."""
        if len(self.poses) > 1_000:  # as many are held at a time
            self.poses.clear()
        if time not in self.poses:
            steps = zip(self.start, self.change, strict=True)
            joints = [start + change * time for start, change in steps]
            self.poses[time] = Pose(self.lengths, joints)
        return self.poses[time]

    def bounds(self, link: int, first: int, along: float) -> tuple[Ball, Ball, Ball]:
        """M, D and the second order in E of a point, so far along a link.

        Only joints from `first` on move it.
        """
        rate = error = bend = drift = second = arb(0)
        for i in range(first, link + 1):
            length = arb(along) if i == link else self.lengths[i]
            rate += abs(self.change[2 * i + 1]) + abs(self.change[2 * i + 2])
            error += 2 * self.error
            bend += length * rate * rate
            drift += length * rate * error
            second += length * error * error / 2
        return bend, drift, second

    def reach(self, body: Any, first: int, times: Sequence[float], n: Matrix) -> Ball:
        """Largest n.x over the axis of a body, a slice [a, b] and all joint errors.

        Args:
            body: Its link, and where its axis starts and ends along it.
            first: Of the poses' frames the one that n and x are in; only the joints
                from this one on move the link in it.
            times: a and b.
            n: A unit vector.
        """
        a, b = map(self.pose, times)
        h, tops = arb(times[1]) - times[0], []
        for along in (body.start, body.end):
            bend, drift, second = self.bounds(body.link, first, along)
            p, q = a.point(body.link, along), b.point(body.link, along)
            top = a.height(n, first, p).max(b.height(n, first, q))
            top += bend * h * h / 8 + second
            if self.error > 0:
                gain = a.gain(n, first, body.link, p) + b.gain(n, first, body.link, q)
                top += (self.error * gain + h * drift) / 2
            tops.append(top)
        return tops[0].max(tops[1])
