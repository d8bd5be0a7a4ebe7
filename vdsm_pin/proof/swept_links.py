"""A link over a slice of an interval and the error box as a convex body, compiled.

Its support is the bound of docs/certificate.md: the points are the joint centres at
both ends of the slice, each error adds a generator to the zonotopes, and the balls hold
what is bounded by its length alone. So the plane that proves most is the one that
separates this body from the partner.
"""

from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import second_order
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import Body
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.terms import BASE, Rules


class Ends(NamedTuple):
    """Configurations at the two ends of a slice and what lies between.

    Args:
        centres: Joint centres at both ends, shape (2, N + 1, 3); [m].
        frames: Link frames at both ends, shape (2, N, 3, 3); [-].
        bends: M of the interval, shape (N + 1, N + 1); [m].
        drifts: D of the interval, shape (N + 1, N + 1); [m].
    """

    centres: FloatArray
    frames: FloatArray
    bends: FloatArray
    drifts: FloatArray


@compiled
def new_ends(n_links: int) -> Ends:
    """Fresh working space for two configurations."""
    n = n_links + 1
    return Ends(
        np.zeros((2, n, 3)),
        np.zeros((2, n_links, 3, 3)),
        np.zeros((n, n)),
        np.zeros((n, n)),
    )


@compiled
def room_of(n_links: int) -> int:
    """Most generators of one end: two angles a joint at two instants, and the base."""
    return 4 * n_links + 1


@compiled
def local_points(
    centres: FloatArray, frames: FloatArray, link: int, frame: int, points: FloatArray
) -> None:
    """O_i and O_{i+1} of a link in the frame of its partner, shape (2, 3); [m]."""
    if frame == BASE:
        for k in range(2):
            for c in range(3):
                points[k, c] = centres[link + k, c]
        return
    for k in range(2):
        x = centres[link + k, 0] - centres[frame, 0]
        y = centres[link + k, 1] - centres[frame, 1]
        z = centres[link + k, 2] - centres[frame, 2]
        for c in range(3):
            points[k, c] = (
                frames[frame, 0, c] * x
                + frames[frame, 1, c] * y
                + frames[frame, 2, c] * z
            )


@compiled
def _add_joints(
    ends: Ends, instant: int, frame: int, joint: int, error: float, body: Body, end: int
) -> None:
    """Add what errors of all angles before O_joint do, at one end of the slice.

    Each adds error (axis x arm): yaw turns about z of the frame before, pitch about y
    of the joint's own; written in the partner's frame.
    """
    apart()
    centres, frames = ends.centres[instant], ends.frames[instant]
    size, ux, uy, uz = body.sizes[end], 0.0, 0.0, 1.0
    for k in range(frame + 1, joint):
        ax = centres[joint, 0] - centres[k, 0]
        ay = centres[joint, 1] - centres[k, 1]
        az = centres[joint, 2] - centres[k, 2]
        for turn in range(2):
            if turn == 1:
                ux, uy, uz = frames[k, 0, 1], frames[k, 1, 1], frames[k, 2, 1]
            elif k > 0:
                j = k - 1
                ux, uy, uz = frames[j, 0, 2], frames[j, 1, 2], frames[j, 2, 2]
            x = error * (uy * az - uz * ay)
            y = error * (uz * ax - ux * az)
            z = error * (ux * ay - uy * ax)
            for c in range(3):
                if frame == BASE:
                    body.swings[end, size, c] = x if c == 0 else y if c == 1 else z
                else:
                    f = frames[frame]
                    body.swings[end, size, c] = f[0, c] * x + f[1, c] * y + f[2, c] * z
            size += 1
    body.sizes[end] = size


@compiled
def load_errors(
    rules: Rules, ends: Ends, body: Body, link: int, frame: int, h: float
) -> None:
    """Grow a link over a slice by the error box.

    Args:
        rules: The error box.
        ends: The slice; read only where joints may err.
        body: Its points and the sags in its balls are set; zonotopes are written and
            the balls grown.
        link: The link.
        frame: Frame of the partner.
        h: Length of the slice; 0 for an instant.
    """
    first, error = frame + 1, rules.joint_error
    for end in range(2):
        body.sizes[end] = 0
        if frame == BASE and rules.base_error > 0.0:
            body.swings[end, 0] = 0.0
            body.swings[end, 0, 0] = rules.base_error
            body.sizes[end] = 1
        if not error > 0.0:
            continue
        joint = link + end
        body.balls[end] += second_order(rules.lengths, first, joint, error)
        if h > 0.0:
            body.balls[end] += 0.5 * error * h * ends.drifts[first, joint]
            _add_joints(ends, 0, frame, joint, 0.5 * error, body, end)
            _add_joints(ends, 1, frame, joint, 0.5 * error, body, end)
        else:
            _add_joints(ends, 0, frame, joint, error, body, end)


@compiled
def load_link(
    rules: Rules, ends: Ends, body: Body, link: int, frame: int, h: float
) -> None:
    """A link over a slice and the error box; arguments as for `load_errors`."""
    apart()
    local_points(ends.centres[0], ends.frames[0], link, frame, body.points[:2])
    local_points(ends.centres[1], ends.frames[1], link, frame, body.points[2:])
    for end in range(2):
        body.balls[end] = 0.125 * ends.bends[frame + 1, link + end] * h * h
    load_errors(rules, ends, body, link, frame, h)
