"""The arm between two rows: how far it reaches in a direction (docs/certificate.md).

Links and joint centres count from 0 in here: link i joins centres i and i + 1.
"""

from collections.abc import Iterator, Sequence
from functools import reduce
from typing import Any, Final, NamedTuple

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import (
    ROUNDING,
    Ball,
    Matrix,
    column,
    dot,
    norm,
)

SCREEN: Final = 1e-9
"""Corners are looked at that doubles find as near to the farthest; [m].

Doubles are off by some 1e-13 m within the extent that files may have.
"""


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

    The base's frame is number 0, that at O_1 which never turns 1, that of link i i + 2.
    """

    def __init__(self, lengths: Sequence[Ball], joints: Sequence[Ball]) -> None:
        self.centres, self.psi = [column(joints[0], 0, 0)], arb(0)
        self.frames = [arb_mat(3, 3, 1), arb_mat(3, 3, 1)]
        for i, length in enumerate(lengths):
            step = turn(2, joints[2 * i + 1]) * turn(1, joints[2 * i + 2])
            x, y, z = (step[k, 0] for k in range(3))
            self.psi = self.psi.max(arb.atan2(norm(column(0, y, z)), x))
            self.frames.append(self.frames[-1] * step)
            along = self.frames[-1] * column(length, 0, 0)
            self.centres.append(self.centres[i] + along)
        self.origins = [column(0, 0, 0), self.centres[0], *self.centres]

    def point(self, link: int, corner: Matrix) -> Matrix:
        """A point of the frame of a link, or of the feed (-1), in the base's."""
        return self.origins[link + 2] + self.frames[link + 2] * corner

    def seen(self, n: Matrix, frame: int, link: int) -> tuple[Ball, Matrix]:
        """Height of a link's origin along n of a frame, and n in the link's frame."""
        turned = self.frames[frame] * n
        away = self.origins[link + 2] - self.origins[frame]
        return dot(turned, away), self.frames[link + 2].transpose() * turned

    def swings(self, first: int, link: int, point: Matrix) -> Iterator[Matrix]:
        """How a point moves with the angles of joints first..link, yaw before pitch."""
        for i in range(first, link + 1):
            arm = point - self.centres[i]
            for frame, axis in ((self.frames[i + 1], 2), (self.frames[i + 2], 1)):
                yield cross(column(*(frame[k, axis] for k in range(3))), arm)


class Bounds(NamedTuple):
    """Bounds of a point over an interval: M, D, the errors' two orders, their sum."""

    bend: Ball
    drift: Ball
    first: Ball
    second: Ball
    turned: Ball


class Interval:
    """The motion between two rows of joint values, under errors.

    Args:
        lengths: Of the links; [m].
        ends: Joint values x0, alpha1, theta1, .. of both rows; [m], [rad].
        errors: Of alpha1, theta1, ..; [rad].
        base: Turn of the base about its origin, [rad], and how far from it O_1 gets.
    """

    def __init__(
        self, lengths: Sequence[Ball], ends: Any, errors: Sequence[Ball], base: Any
    ) -> None:
        self.lengths, self.start, self.errors = lengths, ends[0], errors
        self.base, self.err = base, any(e > 0 for e in [base[0], *errors])
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

    def bounds(self, link: int, frame: int, lever: Ball) -> Bounds:
        """Of a point of a link, so far from its origin, as seen from a frame."""
        rate = error = bend = drift = linear = arb(0)
        turned, stroke = self.base if frame == 0 else (arb(0), arb(0))
        second = stroke * turned * turned / 2
        for i in range(max(0, frame - 1), link + 1):
            length = lever if i == link else self.lengths[i]
            rate += abs(self.change[2 * i + 1]) + abs(self.change[2 * i + 2])
            error += self.errors[2 * i] + self.errors[2 * i + 1]
            bend += length * rate * rate
            drift += length * rate * error
            linear += length * error
            second += length * (turned + error) * (turned + error) / 2
        if link < 0:  # the feed
            second += lever * turned * turned / 2
        return Bounds(bend, drift, linear, second, turned + error)

    def reach(self, body: Any, frame: int, times: Sequence[float], n: Matrix) -> Ball:
        """Largest n.x over a body without its ball, a slice [a, b] and all errors.

        Args:
            body: Its link and its solid of one piece.
            frame: Of the poses' frames the one that n and x are in.
            times: a and b.
            n: A unit vector.
        """
        poses, h = [self.pose(time) for time in times], arb(times[1]) - times[0]
        solid, tops = body.solid, []
        views = [pose.seen(n, frame, body.link) for pose in poses]
        doubt = arb(0, solid.extent * ROUNDING)  # in which doubles the corners are
        discs = [z + solid.across(turned) + doubt for z, turned in views]
        for corner in self._extreme(body, frame, views, h):
            bounds = self.bounds(body.link, frame, norm(corner) + solid.disc_radius)
            ends = [d + dot(corner, v[1]) for d, v in zip(discs, views, strict=True)]
            top = ends[0].max(ends[1]) + bounds.bend * h * h / 8
            if self.err:
                top += self._strayed(body, frame, poses, (n, corner), bounds, h)
            tops.append(top)
        return reduce(arb.max, tops)

    def _extreme(self, body: Any, frame: int, views: Any, h: Ball) -> list[Matrix]:
        """The corners of a body that may be the farthest, as doubles tell."""
        points = body.solid.points[0]
        if len(points) > 2 and not self.base[0] > 0:
            lever = body.solid.extent * 2 + body.solid.disc_radius
            bounds = self.bounds(body.link, frame, lever)
            spare = bounds.bend * h * h / 8 + h * bounds.drift + bounds.first
            normals = [[float(x) for x in view[1].entries()] for view in views]
            heights = [float(view[0]) for view in views]
            rough = (points @ np.array(normals).T + heights).max(axis=1)
            most = float(spare + bounds.second) + SCREEN
            points = points[rough >= rough.max() - most]
        return [column(*point) for point in points.tolist()]

    def _strayed(
        self, body: Any, frame: int, poses: Any, at: Any, bounds: Bounds, h: Ball
    ) -> Ball:
        """How far errors carry a corner along n."""
        (n, corner), disc, first = at, body.solid.disc_radius, max(0, frame - 1)
        blunt = bounds.second + h * bounds.drift / 2 + disc * bounds.turned
        along = far = arb(0)
        for pose in poses:
            point, turned = pose.point(body.link, corner), pose.frames[frame] * n
            swings = pose.swings(first, body.link, point)
            for error, swing in zip(self.errors[2 * first :], swings, strict=False):
                along += error * abs(dot(turned, swing)) / 2
            far = far.max(norm(point))
        if frame == 0:
            along += self.base[0] * (far + bounds.bend * h * h / 8)
        return along + blunt
