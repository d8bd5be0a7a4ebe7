"""A body over a slice of an interval and the error box as a convex body, compiled.

Its support is the bound of docs/certificate.md: the points are the corners at both ends
of the slice, each joint error adds a generator to the zonotopes, and the balls hold
what is bounded by its length alone. So the plane that proves most is the one that
separates this body from the partner.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import second_order, turned_by
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS, Body
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.terms import BASE, Mover, Rules


class Ends(NamedTuple):
    """Configurations at the two ends of a slice and what lies between.

    Args:
        centres: Joint centres at both ends, shape (2, N + 1, 3); [m].
        frames: Link frames at both ends, shape (2, N, 3, 3); [-].
        bends: M of the interval, shape (N + 1, N + 1); [m].
        drifts: D of the interval, shape (N + 1, N + 1); [m].
        rates: W of the interval, shape (N, N); [rad].
    """

    centres: FloatArray
    frames: FloatArray
    bends: FloatArray
    drifts: FloatArray
    rates: FloatArray


@compiled
def new_ends(n_links: int) -> Ends:
    """Fresh working space for two configurations."""
    n = n_links + 1
    return Ends(
        np.zeros((2, n, 3)),
        np.zeros((2, n_links, 3, 3)),
        np.zeros((n, n)),
        np.zeros((n, n)),
        np.zeros((n_links, n_links)),
    )


@compiled
def room_of(n_links: int) -> int:
    """Most generators of one corner: two angles a joint at two instants."""
    return 4 * n_links


@compiled
def place_point(
    centres: FloatArray, frames: FloatArray, link: int, at: FloatArray, out: FloatArray
) -> None:
    """A point of a link's frame in the base frame, shape (3,); [m]."""
    for c in range(3):
        f = frames[link, c]
        out[c] = centres[link, c] + (f[0] * at[0] + f[1] * at[1] + f[2] * at[2])


@compiled
def turn_back(frames: FloatArray, frame: int, out: FloatArray) -> None:
    """A direction of the base frame in that of a link, or of BASE, shape (3,)."""
    if frame == BASE:
        return
    x, y, z = out[0], out[1], out[2]
    f = frames[frame]
    for c in range(3):
        out[c] = f[0, c] * x + f[1, c] * y + f[2, c] * z


@compiled
def local_point(
    centres: FloatArray, frames: FloatArray, frame: int, out: FloatArray
) -> None:
    """A point of the base frame in that of a link, or of BASE, shape (3,); [m]."""
    if frame != BASE:
        for c in range(3):
            out[c] -= centres[frame, c]
        turn_back(frames, frame, out)


@compiled
def to_link(
    mover: Mover, centres: FloatArray, frames: FloatArray, at: FloatArray
) -> None:
    """A point of the partner's frame in that of the body's link, shape (3,); [m]."""
    frame = mover.first - 1
    if frame != BASE:
        x, y, z = at[0], at[1], at[2]
        for c in range(3):
            f = frames[frame, c]
            at[c] = centres[frame, c] + (f[0] * x + f[1] * y + f[2] * z)
    local_point(centres, frames, mover.link, at)


@compiled
def _add_joints(
    rules: Rules, ends: Ends, instant: int, frame: int, share: float, swings: FloatArray
) -> int:
    """Add what errors of all angles before a point do, at one end of the slice.

    Each adds error (axis x arm): yaw turns about z of the frame before, pitch about y
    of the joint's own; written in the partner's frame.

    Args:
        rules: The error box.
        ends: The slice.
        instant: Which end of it.
        frame: Frame of the partner.
        share: Part of the errors to add; [-].
        swings: The first row is the point in the base frame, overwritten by the first
            generator; shape (2 joints, 3); [m].

    Returns:
        Number of generators written.
    """
    apart()
    centres, frames = ends.centres[instant], ends.frames[instant]
    px, py, pz = swings[0, 0], swings[0, 1], swings[0, 2]
    size, ux, uy, uz = 0, 0.0, 0.0, 1.0
    for k in range(frame + 1, frame + 1 + swings.shape[0] // 2):
        ax, ay, az = px - centres[k, 0], py - centres[k, 1], pz - centres[k, 2]
        for turn in range(2):
            if turn == 1:
                ux, uy, uz = frames[k, 0, 1], frames[k, 1, 1], frames[k, 2, 1]
            elif k > 0:
                j = k - 1
                ux, uy, uz = frames[j, 0, 2], frames[j, 1, 2], frames[j, 2, 2]
            error = share * rules.joint_errors[k, turn]
            swings[size, 0] = error * (uy * az - uz * ay)
            swings[size, 1] = error * (uz * ax - ux * az)
            swings[size, 2] = error * (ux * ay - uy * ax)
            turn_back(frames, frame, swings[size])
            size += 1
    return size


@compiled
def _turn_base(
    mover: Mover, turn: float, ends: Ends, loaded: Body, corner: int
) -> float:
    """How far a turn of the base moves a corner over the slice and the box; [m]."""
    at, far = np.zeros(3), 0.0
    for instant in range(2):
        centres, frames = ends.centres[instant], ends.frames[instant]
        place_point(centres, frames, mover.link, mover.corners[corner], at)
        far = max(far, sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]))
    far += loaded.balls[corner] + mover.disc[RADIUS]
    for k in range(loaded.sizes[corner]):
        g = loaded.swings[corner, k]
        far += sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
    return float(turn * far)


@compiled
def _add_joint_errors(
    rules: Rules, mover: Mover, ends: Ends, loaded: Body, corner: int, h: float
) -> None:
    """Grow one corner by what joint errors do to it."""
    link, f, lever = mover.link, mover.first, mover.levers[corner]
    turned = turned_by(rules.joint_errors, f, link)
    ball = second_order(rules.lengths, rules.joint_errors, f, link, lever)
    ball += mover.disc[RADIUS] * turned
    n_instants, share, size = 1, 1.0, 0
    if h > 0.0:
        drift = ends.drifts[f, link] + lever * turned * ends.rates[f, link]
        ball += 0.5 * h * drift
        n_instants, share = 2, 0.5
    # A corner at the joint's centre is not moved by this joint.
    room = 2 * (link + (1 if lever > 0.0 else 0) - f)
    for instant in range(n_instants if room > 0 else 0):
        part = loaded.swings[corner, size : size + room]
        centres, frames = ends.centres[instant], ends.frames[instant]
        place_point(centres, frames, link, mover.corners[corner], part[0])
        size += _add_joints(rules, ends, instant, f - 1, share, part)
    loaded.sizes[corner] = size
    loaded.balls[corner] += ball


@compiled
def load_errors(rules: Rules, mover: Mover, ends: Ends, loaded: Body, h: float) -> None:
    """Grow a body over a slice by the error box.

    Args:
        rules: The error box.
        mover: The body.
        ends: The slice; read only where the errors are not steady.
        loaded: Its points and the sags in its balls are set; zonotopes are written and
            the balls grown.
        h: Length of the slice; 0 for an instant.
    """
    turn = mover.first == BASE + 1 and rules.base_turn > 0.0
    for corner in range(mover.levers.size):
        loaded.sizes[corner] = 0
        if rules.joints_err:
            _add_joint_errors(rules, mover, ends, loaded, corner, h)
        if turn:
            far = _turn_base(mover, rules.base_turn, ends, loaded, corner)
            loaded.balls[corner] += far


@compiled
def load_body(rules: Rules, mover: Mover, ends: Ends, loaded: Body, h: float) -> None:
    """A body over a slice and the error box; arguments as for `load_errors`."""
    apart()
    corners, frame, link = mover.levers.size, mover.first - 1, mover.link
    loaded.used[0], loaded.used[1] = 2 * corners, corners
    for instant in range(2):
        centres, frames = ends.centres[instant], ends.frames[instant]
        for k in range(corners):
            point = loaded.points[instant * corners + k]
            place_point(centres, frames, link, mover.corners[k], point)
            local_point(centres, frames, frame, point)
        load_disc(mover, frames, loaded.discs[instant])
    rate = ends.rates[mover.first, link]
    for k in range(corners):
        bend = ends.bends[mover.first, link] + mover.levers[k] * rate * rate
        loaded.balls[k] = 0.125 * bend * h * h
    load_errors(rules, mover, ends, loaded, h)


@compiled
def load_disc(mover: Mover, frames: FloatArray, disc: FloatArray) -> None:
    """The disc of a body in the frame of its partner, shape (4,)."""
    own = mover.disc
    disc[RADIUS] = own[RADIUS]
    if own[RADIUS] > 0.0:
        for c in range(3):
            f = frames[mover.link, c]
            disc[c] = f[0] * own[0] + f[1] * own[1] + f[2] * own[2]
        turn_back(frames, mover.first - 1, disc)
