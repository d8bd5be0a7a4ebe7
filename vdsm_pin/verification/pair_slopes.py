"""How the clearance of one pair changes with every joint, in compiled code.

The distance of two bodies changes as their nearest points part along the line between
them: each joint moves the link's nearest point by axis x arm (the slope is exact where
the nearest points are the only ones).
"""

from math import sqrt

import numpy as np

from vdsm_pin.geometry.arm import place
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.compiled import apart, borrowed, compiled
from vdsm_pin.geometry.kernels import BRACKET, FAR, NEAR, NORMAL, SCRATCH_ROWS, UPPER
from vdsm_pin.geometry.obstacles import STACK, obstacle_bracket
from vdsm_pin.proof.swept_bodies import load_disc, local_point, place_point
from vdsm_pin.proof.terms import BASE, Task, mover_of


@compiled
def _slopes(
    centres: FloatArray,
    frames: FloatArray,
    first: int,
    link: int,
    near: FloatArray,
    far: FloatArray,
    gap: float,
    slopes: FloatArray,
) -> float:
    """Slopes of the distance of two points, of which the joints move one.

    Args:
        centres: Joint centres, shape (N + 1, 3); [m].
        frames: R_base_link, shape (N, 3, 3); [-].
        first: The first joint that moves the link and not its partner.
        link: The link that moves.
        near: Its point, shape (3,); [m].
        far: The point of its partner, shape (3,); [m].
        gap: The distance; below zero the points have passed each other; [m].
        slopes: Those of alpha and theta are written, shape (1 + 2 N,); [m/rad].

    Returns:
        How much the distance falls as the point moves along X; [-].
    """
    apart()
    x, y, z = far[0] - near[0], far[1] - near[1], far[2] - near[2]
    size = sqrt(x * x + y * y + z * z)
    if not size > 0.0:
        return 0.0
    size = -size if gap < 0.0 else size
    x, y, z = x / size, y / size, z / size
    for joint in range(first, link + 1):
        ax = near[0] - centres[joint, 0]
        ay, az = near[1] - centres[joint, 1], near[2] - centres[joint, 2]
        # The way of the point along n is n . (axis x arm) = axis . (arm x n).
        tx, ty, tz = ay * z - az * y, az * x - ax * z, ax * y - ay * x
        # Yaw turns about z of the link before, pitch about y of the link itself.
        if joint > 0:
            before = frames[joint - 1]
            yaw = before[0, 2] * tx + before[1, 2] * ty + before[2, 2] * tz
        else:
            yaw = tz
        own = frames[joint]
        pitch = own[0, 1] * tx + own[1, 1] * ty + own[2, 1] * tz
        slopes[1 + 2 * joint], slopes[2 + 2 * joint] = -yaw, -pitch
    return float(x)


@compiled
def pair_slopes(
    task: Task, pair: int, joints: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Clearances of one pair, and how they change with every joint.

    Args:
        task: The scene, bodies and pairs.
        pair: The pair.
        joints: Rows q = (x0, alpha1, theta1, ..), shape (m, 1 + 2 N); [m], [rad].

    Returns:
        Upper bounds of the clearance, below zero only the sign is meant, shape (m,)
        [m]; their slopes, shape (m, 1 + 2 N) [-], [m/rad].
    """
    task, joints = borrowed(task), borrowed(joints)
    mover, lengths = mover_of(task, pair), task.rules.lengths
    n_links, corners, frame = lengths.size, mover.levers.size, mover.first - 1
    gaps, slopes = np.zeros(joints.shape[0]), np.zeros(joints.shape)
    centres, frames = np.zeros((n_links + 1, 3)), np.zeros((n_links, 3, 3))
    scratch = np.zeros((SCRATCH_ROWS + 2, 3))
    stack = np.zeros(STACK, np.int64)
    trial, out = np.zeros(BRACKET + 4), np.zeros(BRACKET + 4)
    near, far = np.zeros(3), np.zeros(3)
    body = new_body(corners, corners, 0)
    out[NORMAL] = 1.0
    for m in range(joints.shape[0]):
        q = joints[m]
        place(q[0], q[1::2], q[2::2], lengths, centres, frames)
        for k in range(corners):
            point = body.points[k]
            place_point(centres, frames, mover.link, mover.corners[k], point)
            local_point(centres, frames, frame, point)
        load_disc(mover, frames, body.discs[0])
        obstacle_bracket(
            task.pieces,
            task.pairs.obstacle[pair],
            body,
            task.rules.goal,
            scratch,
            stack,
            trial,
            out,
        )
        gaps[m] = out[UPPER] - mover.radius
        near[:], far[:] = out[NEAR:FAR], out[FAR:BRACKET]
        if frame != BASE:
            place_point(centres, frames, frame, out[NEAR:FAR], near)
            place_point(centres, frames, frame, out[FAR:BRACKET], far)
        moved = _slopes(
            centres, frames, mover.first, mover.link, near, far, out[UPPER], slopes[m]
        )
        if frame == BASE:
            slopes[m, 0] = -moved
    return gaps, slopes
