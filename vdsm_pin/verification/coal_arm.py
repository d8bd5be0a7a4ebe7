"""An arm and its scene as Coal has them, on frames that Pinocchio places."""

from collections.abc import Sequence

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Solid
from vdsm_pin.problem.scene import Moving, Obstacle, solid_of
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.coal_bodies import CoalBody, CoalObstacle, coal_bodies
from vdsm_pin.verification.coal_shapes import CoalShapes
from vdsm_pin.verification.robot_model import RobotModel


def arm_shapes(
    robot: RobotModel,
    carried: Sequence[tuple[int, Solid]] = (),
    obstacles: Sequence[Obstacle] = (),
    deadline: Deadline = NO_LIMIT,
) -> tuple[CoalShapes, dict[str, int]]:
    """Coal's shapes of links and tool, of what they carry, and of obstacles.

    Args:
        robot: The arm in Pinocchio and Coal.
        carried: Solids in the frames of links, by their numbers; the feed's is 0.
        obstacles: Those that move are counted in this order in `arm_poses`.
        deadline: When to give up.

    Returns:
        The shapes in this order, and the number of each by its name.

    Raises:
        OutOfTime: If the time is over.
        VerificationFailed: If Coal refuses a shape.
    """
    import coal

    n = robot.manipulator.n_links
    rods = [
        (CoalBody(rod, coal.Transform3s(local[:3, :3].copy(), local[:3, 3].copy())),)
        for rod, local in zip(robot.capsules, robot.T_link_capsule, strict=True)
    ]
    frames = [min(k + 1, n) for k in range(len(rods))]  # the tool is on the last link
    frames += [link or n + 1 for link, _ in carried]
    next_frame = n + 2
    for one in obstacles:
        moves = isinstance(one, Moving)
        frames.append(next_frame if moves else 0)
        next_frame += moves

    def shape(solid: Solid) -> CoalObstacle:
        deadline.check()
        return coal_bodies(solid)

    solids = [*(solid for _, solid in carried), *map(solid_of, obstacles)]
    names = [*robot.manipulator.axis_names, *(solid.name for solid in solids)]
    shapes = CoalShapes(frames, [*rods, *map(shape, solids)])
    return shapes, {name: k for k, name in enumerate(names)}


def arm_poses(
    robot: RobotModel,
    joints: tuple[FloatArray, FloatArray, FloatArray],
    moving: Sequence[FloatArray] = (),
) -> FloatArray:
    """T_base_frame at some rows, shape (n_rows, n_frames, 3, 4); [m].

    The base is frame 0 and link k frame k; then come the feed's, which does not turn,
    and those of what moves.

    Args:
        robot: The arm in Pinocchio.
        joints: x0, alpha and theta at the rows.
        moving: T_base_solid of each obstacle that moves, shape (n_rows, 4, 4); [m].
    """
    n = robot.manipulator.n_links
    poses = np.zeros((len(joints[0]), n + 2 + len(moving), 3, 4))
    poses[..., :3] = np.eye(3)
    poses[:, 1 : n + 1] = robot.poses(*joints)[:, :n]
    poses[:, n + 1, :, 3] = poses[:, 1, :, 3]
    for k, pose in enumerate(moving, start=n + 2):
        poses[:, k] = pose[:, :3]
    return poses
