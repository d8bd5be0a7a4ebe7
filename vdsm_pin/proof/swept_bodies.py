"""A body over a slice of an interval and the error box as a convex body, compiled.

Its support is the bound of docs/certificate.md: the points are the corners at both ends
of the slice, each joint error adds a generator to the zonotopes, and the balls hold
what is bounded by its length alone. So the plane that proves most is the one that
separates this body from the partner.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS, Body
from vdsm_pin.proof.bends import Bends, new_bends
from vdsm_pin.proof.error_growth import second_order
from vdsm_pin.proof.packed_tree import PRISMATIC, PackedTree, Pose, new_pose
from vdsm_pin.proof.terms import WORLD, Mover, Task


class Ends(NamedTuple):
    """Configurations at the two ends of a slice and what lies between.

    Args:
        start: At the start of the slice.
        end: At its end.
        bends: Of the frames along the way that is asked about.
        q: Working space for a configuration, shape (n_columns,).
    """

    start: Pose
    end: Pose
    bends: Bends
    q: FloatArray


@compiled
def new_ends(n_frames: int, n_ways: int, n_columns: int) -> Ends:
    """Fresh working space for two configurations."""
    return Ends(
        new_pose(n_frames),
        new_pose(n_frames),
        new_bends(n_ways, n_frames),
        np.zeros(n_columns),
    )


@compiled
def room_of(n_turning: int) -> int:
    """Most generators of one corner: joints that turn at two instants, one tried."""
    return 2 * n_turning + 1


@compiled
def place_point(pose: Pose, frame: int, at: FloatArray, out: FloatArray) -> None:
    """A point of a frame in the world's, shape (3,); [m]."""
    x, y, z = at[0], at[1], at[2]
    for c in range(3):
        f = pose.frames[frame, c]
        out[c] = pose.origins[frame, c] + (f[0] * x + f[1] * y + f[2] * z)


@compiled
def turn_back(pose: Pose, frame: int, out: FloatArray) -> None:
    """A direction of the world's frame in another, shape (3,)."""
    if frame == WORLD:
        return
    x, y, z = out[0], out[1], out[2]
    f = pose.frames[frame]
    for c in range(3):
        out[c] = f[0, c] * x + f[1, c] * y + f[2, c] * z


@compiled
def local_point(pose: Pose, frame: int, out: FloatArray) -> None:
    """A point of the world's frame in another, shape (3,); [m]."""
    if frame != WORLD:
        for c in range(3):
            out[c] -= pose.origins[frame, c]
        turn_back(pose, frame, out)


@compiled
def to_body(mover: Mover, pose: Pose, at: FloatArray) -> None:
    """A point of the partner's frame in that of the body, shape (3,); [m]."""
    if mover.rest != WORLD:
        place_point(pose, mover.rest, at, at)
    local_point(pose, mover.frame, at)


@compiled
def _turn_generator(
    tree: PackedTree, pose: Pose, joint: int, error: float, out: FloatArray
) -> None:
    """Replace the arm from a joint to a point by error (axis x arm), (3,); [m]."""
    f, axis = pose.frames[joint + 1], tree.axis[joint]
    ux = f[0, 0] * axis[0] + f[0, 1] * axis[1] + f[0, 2] * axis[2]
    uy = f[1, 0] * axis[0] + f[1, 1] * axis[1] + f[1, 2] * axis[2]
    uz = f[2, 0] * axis[0] + f[2, 1] * axis[1] + f[2, 2] * axis[2]
    ax, ay, az = out[0], out[1], out[2]
    out[0] = error * (uy * az - uz * ay)
    out[1] = error * (uz * ax - ux * az)
    out[2] = error * (ux * ay - uy * ax)


@compiled
def _placed_at(tree: PackedTree, pose: Pose, joint: int, out: FloatArray) -> None:
    """Where a joint's placement stands in the world, shape (3,); [m]."""
    if tree.kind[joint] == PRISMATIC:
        place_point(pose, tree.parent[joint], tree.shift[joint], out)
    else:
        out[:] = pose.origins[joint + 1]


@compiled(inline=False)
def _add_turns(
    task: Task, pose: Pose, place: int, share: float, swings: FloatArray
) -> tuple[int, float]:
    """Add what errors of all turns along a place's way do, in one configuration.

    Args:
        task: The tree and the error box.
        pose: The configuration.
        place: The place.
        share: Part of the errors of joints to add; [-].
        swings: Generators in the partner's frame are written, shape (room, 3); [m].

    Returns:
        Number of generators, and the radius of a ball for turns of placements; [m].
    """
    tree, ways, errors = task.tree, task.ways, task.errors
    way = task.places.way[place]
    frame, rest = ways.frame[way], ways.rest[way]
    point, at = np.zeros(3), np.zeros(3)
    place_point(pose, frame, task.places.at[place], point)
    size, ball = 0, 0.0
    while ways.before[way] >= 0:
        joint = ways.joint[way]
        error, tilt = share * errors.turn[joint], errors.tilt[joint]
        way = ways.before[way]
        if not (error > 0.0 or tilt > 0.0):
            continue
        _placed_at(tree, pose, joint, at)
        arm = swings[size]
        for c in range(3):
            arm[c] = point[c] - at[c]
        if tilt > 0.0:
            ball += tilt * sqrt(arm[0] ** 2 + arm[1] ** 2 + arm[2] ** 2)
        if error > 0.0:
            _turn_generator(tree, pose, joint, error, arm)
            turn_back(pose, rest, arm)
            size += 1
    return size, ball


@compiled
def load_errors(task: Task, mover: Mover, ends: Ends, loaded: Body, h: float) -> None:
    """Grow a body over a slice by turns in the error box.

    Args:
        task: The tree and the error box.
        mover: The body.
        ends: The slice; read only where the errors are not steady.
        loaded: Its points and the sags in its balls are set; zonotopes are written and
            the balls grown.
        h: Length of the slice; 0 for an instant.
    """
    errors, places, bends = task.errors, task.places, ends.bends
    for corner in range(mover.slots.size):
        loaded.sizes[corner] = 0
        if task.rules.steady:
            continue
        place, size = mover.slots[corner], 0
        way, lever = places.way[place], places.lever[place]
        erring, far = errors.erring[way], 0.0
        ball = second_order(errors, way, lever)
        ball += mover.disc[RADIUS] * errors.turned[mover.way]
        share = 1.0
        if h > 0.0:
            drift = bends.drifts[way] + lever * erring * bends.turns[way]
            ball, share = ball + 0.5 * h * drift, 0.5
        for instant in range(2 if h > 0.0 else 1):
            pose = ends.end if instant else ends.start
            part = loaded.swings[corner, size:]
            more, tilted = _add_turns(task, pose, place, share, part)
            size, far = size + more, max(far, tilted)
        loaded.sizes[corner] = size
        # The arm of a turn, a length, is convex but for the sag.
        sag = loaded.balls[corner] * (errors.turned[way] - erring)
        loaded.balls[corner] += ball + far + sag


@compiled(inline=False)
def load_body(task: Task, mover: Mover, ends: Ends, loaded: Body, h: float) -> None:
    """A body over a slice and the error box; arguments as for `load_errors`."""
    corners, places, bends = mover.slots.size, task.places, ends.bends
    instants = 2 if h > 0.0 else 1
    loaded.used[0], loaded.used[1] = instants * corners, corners
    for instant in range(instants):
        pose = ends.end if instant else ends.start
        _load_corners(mover, pose, loaded.points[instant * corners :])
        load_disc(mover, pose, loaded.discs[instant])
    for k in range(corners):
        place = mover.slots[k]
        way, lever = places.way[place], places.lever[place]
        rate = bends.turns[way]
        bend = bends.bends[way] + lever * (rate * rate + bends.swings[way])
        loaded.balls[k] = 0.125 * bend * h * h
    load_errors(task, mover, ends, loaded, h)


@compiled
def _load_corners(mover: Mover, pose: Pose, points: FloatArray) -> None:
    """The corners of a body in the frame of its partner, the first rows of points."""
    f, o, at = pose.frames[mover.frame], pose.origins[mover.frame], mover.corners
    r, base = pose.frames[mover.rest], pose.origins[mover.rest]
    for c in range(3):
        x, y, z, shift = f[c, 0], f[c, 1], f[c, 2], o[c]
        if mover.rest != WORLD:
            u, v, w = r[0, c], r[1, c], r[2, c]
            x = u * f[0, 0] + v * f[1, 0] + w * f[2, 0]
            y = u * f[0, 1] + v * f[1, 1] + w * f[2, 1]
            z = u * f[0, 2] + v * f[1, 2] + w * f[2, 2]
            shift = u * (o[0] - base[0]) + v * (o[1] - base[1]) + w * (o[2] - base[2])
        for k in range(at.shape[0]):
            points[k, c] = shift + (x * at[k, 0] + y * at[k, 1] + z * at[k, 2])


@compiled
def load_disc(mover: Mover, pose: Pose, disc: FloatArray) -> None:
    """The disc of a body in the frame of its partner, shape (4,)."""
    own = mover.disc
    disc[RADIUS] = own[RADIUS]
    if own[RADIUS] > 0.0:
        for c in range(3):
            f = pose.frames[mover.frame, c]
            disc[c] = f[0] * own[0] + f[1] * own[1] + f[2] * own[2]
        turn_back(pose, mover.rest, disc)
