"""How the clearance of one pair changes with every joint, in compiled code.

The distance of two bodies changes as their nearest points part along the line between
them: each joint between them moves one of the points by axis x arm, or along its axis
(the slope is exact where the nearest points are the only ones).
"""

from math import sqrt

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.kernels import BRACKET, FAR, NEAR, UPPER
from vdsm_pin.geometry.obstacles import new_measuring, obstacle_bracket
from vdsm_pin.proof.packed_tree import PRISMATIC, REVOLUTE, Pose, new_pose, place_tree
from vdsm_pin.proof.swept_bodies import load_disc, local_point, place_point
from vdsm_pin.proof.terms import Mover, Task, mover_of


@compiled(inline=False)
def _slopes(
    task: Task,
    mover: Mover,
    pose: Pose,
    near: FloatArray,
    far: FloatArray,
    gap: float,
    slopes: FloatArray,
) -> None:
    """Slopes of the distance of two points, of which joints move one.

    Args:
        task: The tree.
        mover: The body of the pair.
        pose: The configuration.
        near: Its point in the world, shape (3,); [m].
        far: The point of its partner, shape (3,); [m].
        gap: The distance; below zero the points have passed each other; [m].
        slopes: Of the columns of q, shape (n_columns,); added to; [-], [m/rad].
    """
    tree, ways, way = task.tree, task.ways, mover.way
    x, y, z = far[0] - near[0], far[1] - near[1], far[2] - near[2]
    size = sqrt(x * x + y * y + z * z)
    if not size > 0.0:
        return
    size = -size if gap < 0.0 else size
    x, y, z = x / size, y / size, z / size
    while ways.before[way] >= 0:
        joint = ways.joint[way]
        # Where the joint carries the partner the body moves the other way round.
        sense = -tree.ratio[joint] if ways.up[way] else tree.ratio[joint]
        f, axis, o = pose.frames[joint + 1], tree.axis[joint], pose.origins[joint + 1]
        ux = f[0, 0] * axis[0] + f[0, 1] * axis[1] + f[0, 2] * axis[2]
        uy = f[1, 0] * axis[0] + f[1, 1] * axis[1] + f[1, 2] * axis[2]
        uz = f[2, 0] * axis[0] + f[2, 1] * axis[1] + f[2, 2] * axis[2]
        moved = 0.0
        if tree.kind[joint] == PRISMATIC:
            moved = ux * x + uy * y + uz * z
        elif tree.kind[joint] == REVOLUTE:
            ax, ay, az = near[0] - o[0], near[1] - o[1], near[2] - o[2]
            # The way of the point along n is n . (axis x arm) = axis . (arm x n).
            moved = ux * (ay * z - az * y) + uy * (az * x - ax * z)
            moved += uz * (ax * y - ay * x)
        if tree.column[joint] >= 0:
            slopes[tree.column[joint]] -= sense * moved
        way = ways.before[way]


@compiled
def pair_slopes(
    task: Task, pair: int, joints: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Clearances of one pair, and how they change with every joint.

    Args:
        task: The scene, bodies and pairs.
        pair: The pair.
        joints: Rows of q, shape (m, n_columns); [m], [rad].

    Returns:
        Upper bounds of the clearance, below zero only the sign is meant, shape (m,)
        [m]; their slopes, shape (m, n_columns) [-], [m/rad].
    """
    task, joints = borrowed(task), borrowed(joints)
    mover = mover_of(task, pair)
    corners, pose = mover.corners.shape[0], new_pose(task.tree.parent.size + 1)
    gaps, slopes = np.zeros(joints.shape[0]), np.zeros(joints.shape)
    near, far = np.zeros(3), np.zeros(3)
    body, work = new_body(corners, corners, 0), new_measuring()
    pieces, obstacle, out = task.pieces, task.pairs.obstacle[pair], work.out
    for m in range(joints.shape[0]):
        place_tree(task.tree, joints[m], pose)
        for k in range(corners):
            point = body.points[k]
            place_point(pose, mover.frame, mover.corners[k], point)
            local_point(pose, mover.rest, point)
        load_disc(mover, pose, body.discs[0])
        obstacle_bracket(pieces, obstacle, body, task.rules.goal, work)
        gaps[m] = out[UPPER] - mover.radius
        place_point(pose, mover.rest, out[NEAR:FAR], near)
        place_point(pose, mover.rest, out[FAR:BRACKET], far)
        _slopes(task, mover, pose, near, far, out[UPPER], slopes[m])
    return gaps, slopes
